//! The innovation of a measurement: how far it is from its prediction, and how likely that is.
//!
//! ```text
//! nis = (z - z^)^T S^-1 (z - z^)
//! log p(z) = -(nis + log det S + M log 2 pi) / 2
//! ```

use core::f64::consts::TAU;

use estimation_base::Cholesky;
use nalgebra::{ComplexField, SMatrix, SVector};

/// The innovation of a measurement of dimension M.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation<const M: usize> {
    /// z - z^, in the tangent at z^.
    pub residual: SVector<f64, M>,
    /// S, measurement noise included.
    pub covariance: SMatrix<f64, M, M>,
    /// Normalised innovation squared; chi-square of M degrees of freedom for a consistent filter.
    pub nis: f64,
    /// log N(z; z^, S).
    pub log_likelihood: f64,
}

impl<const M: usize> Innovation<M> {
    /// `factor` is that of `covariance`, S.
    pub(crate) fn new(
        residual: SVector<f64, M>,
        covariance: SMatrix<f64, M, M>,
        factor: &Cholesky<M>,
    ) -> Self {
        let nis = factor.mahalanobis_squared(&residual);
        Self {
            residual,
            covariance,
            nis,
            log_likelihood: -0.5 * (nis + log_normaliser(factor)),
        }
    }
}

/// log det(2 pi S).
pub(crate) fn log_normaliser<const M: usize>(factor: &Cholesky<M>) -> f64 {
    factor.log_determinant() + M as f64 * ComplexField::ln(TAU)
}
