//! Cholesky factor of a covariance, naming the covariance and the pivot at which it fails.
//!
//! A pivot is compared with the rounding of its own computation, N eps P_kk: above is a variance,
//! within is zero, below is negative. Asymmetry is refused beyond sqrt(eps) of the two variances:
//! less is what a formula that is symmetric on paper leaves behind, more is a wrong matrix.

use crate::error::RbpfError;
use nalgebra::{SMatrix, SVector};
use std::f64::consts::TAU;

/// P = L L^T.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Factor<const N: usize> {
    lower: SMatrix<f64, N, N>,
}

impl<const N: usize> Factor<N> {
    /// Of a positive definite matrix.
    pub(crate) fn definite(
        matrix: &SMatrix<f64, N, N>,
        what: &'static str,
    ) -> Result<Self, RbpfError> {
        factorise(matrix, what, false)
    }

    /// Of a positive semidefinite one: a square root, not to be solved with.
    pub(crate) fn semidefinite(
        matrix: &SMatrix<f64, N, N>,
        what: &'static str,
    ) -> Result<Self, RbpfError> {
        factorise(matrix, what, true)
    }

    #[cfg(any(test, feature = "ukf"))]
    pub(crate) const fn lower(&self) -> &SMatrix<f64, N, N> {
        &self.lower
    }

    /// L^-1 B.
    pub(crate) fn whiten<const K: usize>(&self, right: &SMatrix<f64, N, K>) -> SMatrix<f64, N, K> {
        let mut x = *right;
        for column in 0..K {
            for row in 0..N {
                let mut sum = x[(row, column)];
                for before in 0..row {
                    sum -= self.lower[(row, before)] * x[(before, column)];
                }
                x[(row, column)] = sum / self.lower[(row, row)];
            }
        }
        x
    }

    /// L^-T B.
    pub(crate) fn solve_transposed<const K: usize>(
        &self,
        right: &SMatrix<f64, N, K>,
    ) -> SMatrix<f64, N, K> {
        let mut x = *right;
        for column in 0..K {
            for row in (0..N).rev() {
                let mut sum = x[(row, column)];
                for below in row + 1..N {
                    sum -= self.lower[(below, row)] * x[(below, column)];
                }
                x[(row, column)] = sum / self.lower[(row, row)];
            }
        }
        x
    }

    /// P^-1 B.
    pub(crate) fn solve<const K: usize>(&self, right: &SMatrix<f64, N, K>) -> SMatrix<f64, N, K> {
        self.solve_transposed(&self.whiten(right))
    }

    /// d^T P^-1 d.
    pub(crate) fn mahalanobis_squared(&self, difference: &SVector<f64, N>) -> f64 {
        self.whiten(difference).norm_squared()
    }

    /// log det P.
    pub(crate) fn log_determinant(&self) -> f64 {
        2.0 * self.lower.diagonal().iter().map(|l| l.ln()).sum::<f64>()
    }

    /// log N(difference; 0, P).
    pub(crate) fn log_density(&self, difference: &SVector<f64, N>) -> f64 {
        let normaliser = self.log_determinant() + N as f64 * TAU.ln();
        -0.5 * (self.mahalanobis_squared(difference) + normaliser)
    }
}

/// (A + A^T) / 2.
pub(crate) fn symmetric<const N: usize>(matrix: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    (matrix + matrix.transpose()) * 0.5
}

fn factorise<const N: usize>(
    matrix: &SMatrix<f64, N, N>,
    what: &'static str,
    zero_allowed: bool,
) -> Result<Factor<N>, RbpfError> {
    if !matrix.iter().all(|entry| entry.is_finite()) {
        return Err(RbpfError::NotFinite { what });
    }
    let mut lower = SMatrix::<f64, N, N>::zeros();
    for column in 0..N {
        let variance = matrix[(column, column)];
        let rounding = N as f64 * f64::EPSILON * variance.abs();
        let mut pivot = variance;
        for before in 0..column {
            pivot -= lower[(column, before)] * lower[(column, before)];
        }
        let is_variance = pivot > rounding;
        let failed = Err(RbpfError::NotPositiveDefinite {
            what,
            pivot: column,
            value: pivot,
        });
        if !is_variance && (!zero_allowed || pivot < -rounding) {
            return failed;
        }
        let root = pivot.max(0.0).sqrt();
        lower[(column, column)] = if is_variance { root } else { 0.0 };
        for row in column + 1..N {
            let difference = matrix[(row, column)] - matrix[(column, row)];
            let scale = variance.abs() * matrix[(row, row)].abs();
            if difference * difference > f64::EPSILON * scale {
                return Err(RbpfError::NotSymmetric {
                    what,
                    row,
                    column,
                    difference,
                });
            }
            let mut rest = matrix[(row, column)];
            for before in 0..column {
                rest -= lower[(row, before)] * lower[(column, before)];
            }
            if is_variance {
                lower[(row, column)] = rest / root;
            } else if rest * rest > 4.0 * rounding * matrix[(row, row)].abs() {
                // without variance the rest of the column is zero, by Schwarz up to the roundings
                return failed;
            }
        }
    }
    Ok(Factor { lower })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

    #[test]
    fn solves_and_densities_of_a_known_matrix() {
        let root = Matrix3::new(2.0, 0.0, 0.0, -1.0, 0.5, 0.0, 3.0, 1.0, 1e-3);
        let matrix = root * root.transpose();
        let factor = Factor::definite(&matrix, "p").unwrap();
        // the last pivot, 1e-6 beside 10, keeps eps * 10 / 1e-6 of its digits
        assert!((factor.lower() - root).amax() < 1e-8);
        let x = Vector3::new(0.3, -2.0, 1.0);
        assert!((matrix * factor.solve(&x) - x).amax() < 1e-8);
        let plane = Factor::definite(&Matrix2::new(2.0, 0.5, 0.5, 1.0), "p").unwrap();
        // det 1.75, d^T P^-1 d = (1 - 1 + 2) / 1.75 for d = (1, 1)
        let expected = -0.5 * (2.0 / 1.75 + 1.75_f64.ln()) - TAU.ln();
        assert!((plane.log_density(&Vector2::new(1.0, 1.0)) - expected).abs() < 1e-15);
    }

    #[test]
    fn wrong_matrices_are_named() {
        let indefinite = Matrix2::new(1.0, 2.0, 2.0, 1.0);
        for result in [
            Factor::definite(&indefinite, "p"),
            Factor::semidefinite(&indefinite, "p"),
        ] {
            let Err(RbpfError::NotPositiveDefinite { what, pivot, value }) = result else {
                panic!("{result:?}");
            };
            assert_eq!((what, pivot, value), ("p", 1, -3.0));
        }
        let zero = Factor::semidefinite(&Matrix2::zeros(), "p").unwrap();
        assert_eq!(*zero.lower(), Matrix2::zeros());
        assert!(Factor::definite(&Matrix2::zeros(), "p").is_err());
        // a column under a zero variance must be zero
        assert!(Factor::semidefinite(&Matrix2::new(0.0, 1e-3, 1e-3, 1.0), "p").is_err());
        let skew = Matrix2::new(1.0, 0.1, 0.2, 1.0);
        let error = Factor::definite(&skew, "p").unwrap_err();
        assert!(matches!(
            error,
            RbpfError::NotSymmetric {
                row: 1,
                column: 0,
                ..
            }
        ));
        assert!(Factor::definite(&(indefinite * f64::NAN), "p").is_err());
    }
}
