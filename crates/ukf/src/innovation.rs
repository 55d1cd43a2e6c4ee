//! The innovation of a measurement: how far it is from its prediction, and how likely that is.
//!
//! ```text
//! nis = (z - z^)^T S^-1 (z - z^)
//! log p(z) = -(nis + log det S + M log 2 pi) / 2
//! ```

use estimation_base::Real;
use estimation_base::generic::CholeskyFactor;
use nalgebra::{ComplexField, SMatrix, SVector};

/// The innovation of a measurement of dimension M.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Innovation<T, const M: usize> {
    /// z - z^, in the tangent at z^.
    pub residual: SVector<T, M>,
    /// S, measurement noise included.
    pub covariance: SMatrix<T, M, M>,
    /// Normalised innovation squared; chi-square of M degrees of freedom for a consistent filter.
    pub nis: T,
    /// log N(z; z^, S).
    pub log_likelihood: T,
}

impl<T: Real, const M: usize> Innovation<T, M> {
    /// `factor` is that of `covariance`, S.
    pub(crate) fn new(
        residual: SVector<T, M>,
        covariance: SMatrix<T, M, M>,
        factor: &CholeskyFactor<T, M>,
    ) -> Self {
        let nis = factor.mahalanobis_squared(&residual);
        Self {
            residual,
            covariance,
            nis,
            log_likelihood: T::of(-0.5) * (nis + log_normaliser(factor)),
        }
    }
}

/// log det(2 pi S).
pub(crate) fn log_normaliser<T: Real, const M: usize>(factor: &CholeskyFactor<T, M>) -> T {
    factor.log_determinant() + T::of(M as f64) * ComplexField::ln(T::two_pi())
}
