//! Cholesky factorisation P = L L^T that names the pivot at which it fails.
//!
//! A pivot is the variance left in row k once the rows before it are known. It is compared with
//! the rounding of its own computation, N eps P_kk: a pivot above is a variance, one within it
//! is zero, one below is negative. [`Cholesky::positive_definite`] accepts the first only;
//! [`Cholesky::semidefinite`] accepts zero too, with a zero column, for covariances that
//! are points in some direction (a pose just drawn). Only the lower triangle is read. O(N^3 / 6)
//! multiplications.

use crate::error::{Step, UkfError};
use crate::math::{ln, sqrt};
use nalgebra::{SMatrix, SVector};

/// A lower triangular factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cholesky<const N: usize> {
    lower: SMatrix<f64, N, N>,
}

impl<const N: usize> Cholesky<N> {
    /// Factorises a positive definite matrix.
    ///
    /// # Errors
    /// [`UkfError::NotFinite`], [`UkfError::NotPositiveDefinite`] with the pivot; `step` goes
    /// into the error.
    pub fn positive_definite(matrix: &SMatrix<f64, N, N>, step: Step) -> Result<Self, UkfError> {
        factorise(matrix, step, false)
    }

    /// Factorises a positive semidefinite matrix. The factor is a square root; [`Self::solve`]
    /// needs a definite one.
    ///
    /// # Errors
    /// [`UkfError::NotFinite`], [`UkfError::NotPositiveDefinite`] for a pivot below zero by more
    /// than rounding.
    pub fn semidefinite(matrix: &SMatrix<f64, N, N>, step: Step) -> Result<Self, UkfError> {
        factorise(matrix, step, true)
    }

    /// From a factor at hand; only its lower triangle is read.
    ///
    /// # Errors
    /// [`UkfError::NotFinite`], or [`UkfError::NotPositiveDefinite`] for a negative diagonal entry.
    pub fn from_lower(lower: &SMatrix<f64, N, N>, step: Step) -> Result<Self, UkfError> {
        let lower = lower.lower_triangle();
        if !lower.iter().all(|entry| entry.is_finite()) {
            return Err(UkfError::NotFinite {
                step,
                what: "the factor",
            });
        }
        match (0..N).find(|&k| lower[(k, k)] < 0.0) {
            Some(pivot) => Err(UkfError::NotPositiveDefinite {
                step,
                pivot,
                value: lower[(pivot, pivot)],
            }),
            None => Ok(Self { lower }),
        }
    }

    /// The matrix, L L^T.
    #[must_use]
    pub fn product(&self) -> SMatrix<f64, N, N> {
        self.lower * self.lower.transpose()
    }

    /// The factor, lower triangular.
    #[must_use]
    pub const fn lower(&self) -> &SMatrix<f64, N, N> {
        &self.lower
    }

    /// P^-1 B by two triangular solves. Not finite if the matrix was only semidefinite.
    #[must_use]
    pub fn solve<const K: usize>(&self, right: &SMatrix<f64, N, K>) -> SMatrix<f64, N, K> {
        let mut x = self.whiten(right);
        for row in (0..N).rev() {
            for column in 0..K {
                let mut sum = x[(row, column)];
                for below in row + 1..N {
                    sum -= self.lower[(below, row)] * x[(below, column)];
                }
                x[(row, column)] = sum / self.lower[(row, row)];
            }
        }
        x
    }

    /// L^-1 B, the whitened right-hand side. Not finite if the matrix was only semidefinite.
    #[must_use]
    pub fn whiten<const K: usize>(&self, right: &SMatrix<f64, N, K>) -> SMatrix<f64, N, K> {
        let mut x = *right;
        for row in 0..N {
            for column in 0..K {
                let mut sum = x[(row, column)];
                for before in 0..row {
                    sum -= self.lower[(row, before)] * x[(before, column)];
                }
                x[(row, column)] = sum / self.lower[(row, row)];
            }
        }
        x
    }

    /// d^T P^-1 d, the squared Mahalanobis length of `difference`.
    #[must_use]
    pub fn mahalanobis_squared(&self, difference: &SVector<f64, N>) -> f64 {
        self.whiten(difference).norm_squared()
    }

    /// log det P.
    #[must_use]
    pub fn log_determinant(&self) -> f64 {
        2.0 * (0..N).map(|row| ln(self.lower[(row, row)])).sum::<f64>()
    }
}

/// Refuses a matrix that is not symmetric.
///
/// Products such as F P F^T round each triangle by a few N eps of sqrt(P_ii P_jj): what differs by
/// more than sqrt(eps) of that is another matrix, and halving the difference would hide a mistake.
pub(crate) fn check_symmetric<const N: usize>(
    matrix: &SMatrix<f64, N, N>,
    step: Step,
) -> Result<(), UkfError> {
    for row in 1..N {
        for column in 0..row {
            let difference = matrix[(row, column)] - matrix[(column, row)];
            let scale = (matrix[(row, row)] * matrix[(column, column)]).abs();
            if difference * difference > f64::EPSILON * scale {
                return Err(UkfError::NotSymmetric {
                    step,
                    row,
                    column,
                    difference,
                });
            }
        }
    }
    Ok(())
}

fn factorise<const N: usize>(
    matrix: &SMatrix<f64, N, N>,
    step: Step,
    zero_allowed: bool,
) -> Result<Cholesky<N>, UkfError> {
    if !matrix.iter().all(|entry| entry.is_finite()) {
        return Err(UkfError::NotFinite {
            step,
            what: "the covariance",
        });
    }
    let mut lower = SMatrix::<f64, N, N>::zeros();
    for column in 0..N {
        let rounding = N as f64 * f64::EPSILON * matrix[(column, column)].abs();
        let pivot = remainder(matrix, &lower, column, column);
        let failed = UkfError::NotPositiveDefinite {
            step,
            pivot: column,
            value: pivot,
        };
        if pivot > rounding {
            let root = sqrt(pivot);
            lower[(column, column)] = root;
            for row in column + 1..N {
                lower[(row, column)] = remainder(matrix, &lower, row, column) / root;
            }
        } else if !zero_allowed || pivot < -rounding {
            return Err(failed);
        } else {
            // no variance left: in a semidefinite matrix the rest of the column is zero,
            // by Schwarz up to the root of the two roundings
            for row in column + 1..N {
                let rest = remainder(matrix, &lower, row, column);
                if rest * rest > 4.0 * rounding * matrix[(row, row)].abs() {
                    return Err(failed);
                }
            }
        }
    }
    Ok(Cholesky { lower })
}

/// The entry of the matrix less what the columns already found explain.
fn remainder<const N: usize>(
    matrix: &SMatrix<f64, N, N>,
    lower: &SMatrix<f64, N, N>,
    row: usize,
    column: usize,
) -> f64 {
    let mut sum = matrix[(row, column)];
    for before in 0..column {
        sum -= lower[(row, before)] * lower[(column, before)];
    }
    sum
}
