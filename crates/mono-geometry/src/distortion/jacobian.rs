//! The derivative of a lens by its parameters, with room for the model that has most of them.

use nalgebra::SMatrix;

/// Most parameters a lens has (the rational model).
pub(crate) const MAX_LENS_PARAMETERS: usize = 8;

/// Derivative of a distorted normalised point by the parameters of the lens, in the order of
/// [`super::Distortion::parameters`]; columns beyond their number are zero.
pub type LensJacobian = SMatrix<f64, 2, MAX_LENS_PARAMETERS>;
