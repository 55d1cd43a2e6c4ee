//! The unscented Kalman filter in square-root form (van der Merwe and Wan 2001).
//!
//! It takes the factors of all covariances and gives the factor L of its own, P = L L^T: half the digits suffice, and P cannot
//! lose its positive semidefiniteness. With deviations d_i from the mean and the Cholesky factor N of the noise,
//!
//! ```text
//! predict:  L = tri [ sqrt(W_i) d_i ..., N ]
//! update:   [ L_S 0; K L_S L' ] = tri [ N sqrt(W_i) dz_i ...; 0 sqrt(W_i) dx_i ... ]
//! ```
//!
//! where tri is the lower triangle of a QR factorisation, built row by row (`rank_one`, `joint`). The published form of the
//! update subtracts the columns of K L_S from L instead, which can fail by rounding when a measurement is far more
//! precise than the prior. The centre point enters last: with W_c0 >= 0 as one more row, with W_c0 < 0 by a rank-one
//! downdate, the only step that can fail, and an error that carries step and pivot then.
//!
//! [`crate::Ukf`] carries the same factor from step to step; it takes and shows covariances. Noise is given here as its
//! factor ([`CholeskyFactor`]), made once. Cost of a step: (2 L + 1) calls of the function and about 4 L^3 multiplications.

use estimation_base::generic::CholeskyFactor;
use estimation_base::{Manifold, Real};
use nalgebra::SMatrix;

use crate::covariance::finite;
use crate::error::{Step, UkfError};
use crate::innovation::Innovation;
use crate::joint::root_of_squares;
use crate::placed::Placed;
use crate::sigma_points::SigmaPoints;
use crate::transform::Images;
use crate::update::correct;

/// A Gaussian state, its covariance by its Cholesky factor, and its sigma points.
///
/// ```
/// use ukf::nalgebra::{Matrix1, Matrix2, Vector1, Vector2};
/// use ukf::{CholeskyFactor, SigmaPoints, SquareRootUkf};
///
/// let unit = CholeskyFactor::from_lower(&Matrix2::identity())?;
/// let noise = CholeskyFactor::from_lower(&Matrix1::new(0.1))?; // a standard deviation
/// let mut filter = SquareRootUkf::new(Vector2::new(0.0, 1.0), unit, SigmaPoints::default())?;
/// filter.update(&Vector1::new(0.5), &noise, |x| Vector1::new(x[0]))?;
/// assert!((filter.covariance()[(0, 0)] - 0.01 / 1.01).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquareRootUkf<T, X, const L: usize> {
    mean: X,
    root: CholeskyFactor<T, L>,
    set: SigmaPoints<T, L>,
}

impl<T: Real, X: Manifold<L, T>, const L: usize> SquareRootUkf<T, X, L> {
    /// A filter starting at `mean` with the covariance of which `root` is the factor.
    ///
    /// # Errors
    /// [`UkfError::NotFinite`] for the mean.
    pub fn new(
        mean: X,
        root: CholeskyFactor<T, L>,
        set: SigmaPoints<T, L>,
    ) -> Result<Self, UkfError> {
        finite(mean.local(&mean), Step::SigmaPoints, "the mean")?;
        Ok(Self { mean, root, set })
    }

    /// The mean.
    pub const fn mean(&self) -> &X {
        &self.mean
    }

    /// The factor of the covariance in the tangent at the mean.
    pub const fn root(&self) -> &CholeskyFactor<T, L> {
        &self.root
    }

    /// The covariance, formed anew: L^3 multiplications.
    pub fn covariance(&self) -> SMatrix<T, L, L> {
        self.root.product()
    }

    /// Moves the state by x' = f(x) + noise (in the tangent at the new mean).
    ///
    /// # Errors
    /// [`UkfError::NotFinite`] for a value of the function; [`UkfError::Covariance`] if the
    /// centre's negative weight takes more than the other points hold. The state is then unchanged.
    pub fn predict(
        &mut self,
        process_noise: &CholeskyFactor<T, L>,
        mut function: impl FnMut(&X) -> X,
    ) -> Result<(), UkfError> {
        let points = Placed::new(&self.mean, self.root.lower(), &self.set)?;
        let images = Images::new(&self.mean, &points, &mut function)?;
        self.root = root_of_squares(
            process_noise.lower(),
            points.count(),
            |index| (images.difference(index), points.covariance_weight(index)),
            Step::Prediction,
        )?;
        self.mean = images.mean;
        Ok(())
    }

    /// Takes in a measurement z = h(x) + noise.
    ///
    /// # Errors
    /// [`UkfError::NotFinite`] for the measurement or a value of the function;
    /// [`UkfError::Covariance`] for an innovation without variance in some direction, or if
    /// the centre's negative weight takes more than the other points hold. The state is then unchanged.
    pub fn update<Z: Manifold<M, T>, const M: usize>(
        &mut self,
        measurement: &Z,
        measurement_noise: &CholeskyFactor<T, M>,
        mut function: impl FnMut(&X) -> Z,
    ) -> Result<Innovation<T, M>, UkfError> {
        let corrected = correct(
            &self.mean,
            &self.root,
            &self.set,
            measurement,
            measurement_noise,
            &mut function,
        )?;
        self.root = corrected.root;
        self.mean = self.mean.retract(&corrected.correction);
        Ok(corrected.innovation)
    }
}
