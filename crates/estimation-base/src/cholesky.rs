//! Cholesky factorisation P = L L^T that names the pivot at which it fails.
//!
//! A pivot is the variance left in row k once the rows before it are known. It is compared with the rounding of its own
//! computation, N eps P_kk: a pivot above that is a variance, one within it is zero, one below is negative.
//! [`CholeskyFactor::definite`] accepts the first only; [`CholeskyFactor::semidefinite`] accepts zero too, with a zero column, for
//! covariances that are points in some direction (a pose just drawn). The test does not depend on the units of the
//! variables. Only the lower triangle is read; [`check_symmetric`] compares it with the upper one. O(N^3 / 6)
//! multiplications.

use nalgebra::{ComplexField, Dim, RawStorage, SMatrix, SVector, SquareMatrix, StorageMut};

use crate::readable::Readable;
use crate::real::Real;

/// Why a matrix is no covariance. A library above adds which covariance it was and in which step.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CholeskyError {
    /// A pivot at or below its bound.
    #[error(
        "pivot {pivot} of the matrix is {}, more than {} required",
        Readable(*.value),
        Readable(*.required)
    )]
    NotPositiveDefinite {
        /// Row of the failing pivot, from 0.
        pivot: usize,
        /// The pivot, the variance left in its row once the rows before are known.
        value: f64,
        /// The bound: N eps P_kk for a definite matrix, the negative of it for a semidefinite one.
        required: f64,
    },
    /// A pivot of zero with a covariance left below it, which no semidefinite matrix has.
    #[error(
        "pivot {pivot} of the matrix is zero and row {row} has a covariance of {} with it, at most {} allowed",
        Readable(*.value),
        Readable(*.at_most)
    )]
    CovarianceWithoutVariance {
        /// Row of the zero pivot, from 0.
        pivot: usize,
        /// Row of the covariance, from 0.
        row: usize,
        /// The covariance left.
        value: f64,
        /// The largest absolute value that rounding explains.
        at_most: f64,
    },
    /// The two triangles differ by more than rounding.
    #[error(
        "entries ({row}, {column}) and ({column}, {row}) of the matrix differ by {}, a symmetric matrix required",
        Readable(*.difference)
    )]
    NotSymmetric {
        /// Row of the entry below the diagonal, from 0.
        row: usize,
        /// Its column.
        column: usize,
        /// Lower less upper entry.
        difference: f64,
    },
    /// An entry is NaN or infinite.
    #[error(
        "entry ({row}, {column}) of the matrix is {}, a finite number required",
        Readable(*.value)
    )]
    NotFinite {
        /// Row of the entry, from 0.
        row: usize,
        /// Its column.
        column: usize,
        /// The entry.
        value: f64,
    },
}

/// The lower triangular factor L of a symmetric positive (semi-)definite matrix P = L L^T.
///
/// ```
/// use estimation_base::{CholeskyFactor, Manifold, Se2, chi_square_quantile};
/// use nalgebra::{Matrix3, Vector3};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let estimated = Se2::new(1.0, 2.0, 3.1);
/// let true_pose = Se2::new(1.1, 1.9, -3.1); // the headings are 0.08 rad apart, not 6.2
/// let error = estimated.local(&true_pose);
///
/// let covariance = Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 0.01));
/// let squared_distance = CholeskyFactor::definite(&covariance)?.mahalanobis_squared(&error);
/// assert!(squared_distance < chi_square_quantile(3.0, 0.99)?);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CholeskyFactor<T, const N: usize> {
    lower: SMatrix<T, N, N>,
}

impl<T: Real, const N: usize> CholeskyFactor<T, N> {
    /// Factorises a positive definite matrix; only its lower triangle is read.
    ///
    /// # Errors
    /// [`CholeskyError::NotFinite`], [`CholeskyError::NotPositiveDefinite`] with the pivot.
    pub fn definite(matrix: &SMatrix<T, N, N>) -> Result<Self, CholeskyError> {
        Self::factorised(matrix, false)
    }

    /// Factorises a positive semidefinite matrix; only its lower triangle is read. The factor is a square root to
    /// multiply with: [`Self::solve`] and [`Self::whiten`] need a definite one.
    ///
    /// # Errors
    /// [`CholeskyError::NotFinite`], [`CholeskyError::NotPositiveDefinite`] for a pivot below zero by more than rounding,
    /// [`CholeskyError::CovarianceWithoutVariance`] for a zero one that cannot be.
    pub fn semidefinite(matrix: &SMatrix<T, N, N>) -> Result<Self, CholeskyError> {
        Self::factorised(matrix, true)
    }

    /// Takes a factor that is already known; only its lower triangle is read.
    ///
    /// # Errors
    /// [`CholeskyError::NotFinite`], or [`CholeskyError::NotPositiveDefinite`] for a negative diagonal entry.
    pub fn from_lower(lower: &SMatrix<T, N, N>) -> Result<Self, CholeskyError> {
        check_finite_lower(lower)?;
        match (0..N).find(|&k| lower[(k, k)] < T::zero()) {
            Some(pivot) => Err(CholeskyError::NotPositiveDefinite {
                pivot,
                value: lower[(pivot, pivot)].into(),
                required: 0.0,
            }),
            None => Ok(Self {
                lower: lower.lower_triangle(),
            }),
        }
    }

    /// The factor L, lower triangular.
    #[must_use]
    pub const fn lower(&self) -> &SMatrix<T, N, N> {
        &self.lower
    }

    /// The matrix, L L^T.
    #[must_use]
    pub fn product(&self) -> SMatrix<T, N, N> {
        self.lower * self.lower.transpose()
    }

    /// P^-1 B by two triangular solves. Not finite if the matrix was only semidefinite.
    #[must_use]
    pub fn solve<const K: usize>(&self, right: &SMatrix<T, N, K>) -> SMatrix<T, N, K> {
        self.solve_transposed(&self.whiten(right))
    }

    /// L^-1 B, the whitened right-hand side. Not finite if the matrix was only semidefinite.
    #[must_use]
    pub fn whiten<const K: usize>(&self, right: &SMatrix<T, N, K>) -> SMatrix<T, N, K> {
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

    /// L^-T B. Not finite if the matrix was only semidefinite.
    #[must_use]
    pub fn solve_transposed<const K: usize>(&self, right: &SMatrix<T, N, K>) -> SMatrix<T, N, K> {
        let mut x = *right;
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

    /// d^T P^-1 d, the squared Mahalanobis length of `difference`.
    #[must_use]
    pub fn mahalanobis_squared(&self, difference: &SVector<T, N>) -> T {
        self.whiten(difference).norm_squared()
    }

    /// log det P; minus infinity if the matrix was only semidefinite.
    #[must_use]
    pub fn log_determinant(&self) -> T {
        let logarithms = (0..N).map(|row| ComplexField::ln(self.lower[(row, row)]));
        T::of(2.0) * logarithms.fold(T::zero(), |sum, one| sum + one)
    }

    /// log N(d; 0, P), the log density of the Gaussian of covariance P at `difference`.
    #[must_use]
    pub fn log_density(&self, difference: &SVector<T, N>) -> T {
        let normaliser = self.log_determinant() + T::of(N as f64) * ComplexField::ln(T::two_pi());
        T::of(-0.5) * (self.mahalanobis_squared(difference) + normaliser)
    }

    fn factorised(matrix: &SMatrix<T, N, N>, zero_allowed: bool) -> Result<Self, CholeskyError> {
        let mut lower = matrix.lower_triangle();
        factorise(&mut lower, zero_allowed)?;
        Ok(Self { lower })
    }
}

/// Overwrites the lower triangle of a positive definite matrix by its Cholesky factor; what is above the diagonal stays
/// and is not read. For matrices whose size is known at run time only, such as a view of a workspace. O(N^3 / 6), not
/// blocked: meant for some tens of rows.
///
/// # Errors
/// As [`CholeskyFactor::definite`]; the lower triangle then holds the columns of the factor before the failing pivot.
pub fn cholesky_in_place<T: Real, D: Dim, S: StorageMut<T, D, D>>(
    matrix: &mut SquareMatrix<T, D, S>,
) -> Result<(), CholeskyError> {
    factorise(matrix, false)
}

/// Refuses a matrix that is not symmetric.
///
/// Products such as F P F^T round each triangle by a few N eps of sqrt(P_ii P_jj): what differs by more than sqrt(eps) of
/// that is another matrix, and halving the difference would hide a mistake.
///
/// # Errors
/// [`CholeskyError::NotSymmetric`], or [`CholeskyError::NotFinite`].
pub fn check_symmetric<T: Real, D: Dim, S: RawStorage<T, D, D>>(
    matrix: &SquareMatrix<T, D, S>,
) -> Result<(), CholeskyError> {
    for row in 0..matrix.nrows() {
        for column in 0..=row {
            for (row, column) in [(row, column), (column, row)] {
                check_finite(row, column, matrix[(row, column)])?;
            }
            let difference = matrix[(row, column)] - matrix[(column, row)];
            let scale = ComplexField::abs(matrix[(row, row)] * matrix[(column, column)]);
            if difference * difference > T::EPSILON * scale {
                return Err(CholeskyError::NotSymmetric {
                    row,
                    column,
                    difference: difference.into(),
                });
            }
        }
    }
    Ok(())
}

/// (A + A^T) / 2.
#[must_use]
pub fn symmetric<T: Real, const N: usize>(matrix: &SMatrix<T, N, N>) -> SMatrix<T, N, N> {
    (matrix + matrix.transpose()) * T::of(0.5)
}

fn factorise<T: Real, D: Dim, S: StorageMut<T, D, D>>(
    matrix: &mut SquareMatrix<T, D, S>,
    zero_allowed: bool,
) -> Result<(), CholeskyError> {
    check_finite_lower(matrix)?;
    let size = matrix.nrows();
    for column in 0..size {
        let rounding =
            T::of(size as f64) * T::EPSILON * ComplexField::abs(matrix[(column, column)]);
        let pivot = remainder(matrix, column, column);
        let zero = zero_allowed && pivot >= -rounding;
        if pivot > rounding {
            let root = ComplexField::sqrt(pivot);
            for row in column + 1..size {
                matrix[(row, column)] = remainder(matrix, row, column) / root;
            }
            matrix[(column, column)] = root;
        } else if zero {
            // In a semidefinite matrix the rest of the column is zero, by Schwarz up to the root of the two roundings.
            for row in column + 1..size {
                let rest = remainder(matrix, row, column);
                let square = T::of(4.0) * rounding * ComplexField::abs(matrix[(row, row)]);
                if rest * rest > square {
                    return Err(CholeskyError::CovarianceWithoutVariance {
                        pivot: column,
                        row,
                        value: rest.into(),
                        at_most: ComplexField::sqrt(square).into(),
                    });
                }
                matrix[(row, column)] = T::zero();
            }
            matrix[(column, column)] = T::zero();
        } else {
            return Err(CholeskyError::NotPositiveDefinite {
                pivot: column,
                value: pivot.into(),
                required: if zero_allowed { -rounding } else { rounding }.into(),
            });
        }
    }
    Ok(())
}

/// The entry of the matrix less what the columns already found explain.
fn remainder<T: Real, D: Dim, S: RawStorage<T, D, D>>(
    matrix: &SquareMatrix<T, D, S>,
    row: usize,
    column: usize,
) -> T {
    let mut sum = matrix[(row, column)];
    for before in 0..column {
        sum -= matrix[(row, before)] * matrix[(column, before)];
    }
    sum
}

fn check_finite_lower<T: Real, D: Dim, S: RawStorage<T, D, D>>(
    matrix: &SquareMatrix<T, D, S>,
) -> Result<(), CholeskyError> {
    for column in 0..matrix.nrows() {
        for row in column..matrix.nrows() {
            check_finite(row, column, matrix[(row, column)])?;
        }
    }
    Ok(())
}

fn check_finite<T: Real>(row: usize, column: usize, value: T) -> Result<(), CholeskyError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(CholeskyError::NotFinite {
            row,
            column,
            value: value.into(),
        })
    }
}
