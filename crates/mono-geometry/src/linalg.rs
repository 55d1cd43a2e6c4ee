//! Dense linear algebra that can be trusted: the only place of the workspace that computes an SVD.
//!
//! The general SVD of nalgebra 0.35 returns wrong factors for a few in a hundred rank-deficient matrices of size 4x4
//! and more (reconstruction errors up to 0.15); its 3x3 case is exact to 4e-15. So: 3x3 by nalgebra, everything larger
//! by one-sided Jacobi rotations after a QR reduction, sequentially, because the order of the sums must not depend on
//! the machine. Every result carries what the caller has to look at: singular values, rank, pivots.
//!
//! A rank is a count of singular values above max(rows, columns) eps s_max, the size of what rounding alone leaves of an
//! exact zero.

use estimation_base::symmetric;
use nalgebra::linalg::Cholesky;
use nalgebra::{Const, DMatrix, DVector, Matrix3, Rotation3, SMatrix, Vector3};

use crate::error::GeometryError;

#[cfg(feature = "bundle")]
mod dense_cholesky;
mod jacobi;
mod null_space;

#[cfg(feature = "bundle")]
pub use dense_cholesky::DenseCholesky;
pub(crate) use null_space::null_space;

/// Thin singular value decomposition A = U diag(s) V^T of an m x n matrix, k = min(m, n).
#[derive(Debug, Clone, PartialEq)]
pub struct Svd {
    /// Left singular vectors, m x k, orthonormal columns.
    pub u: DMatrix<f64>,
    /// Singular values, k of them, descending.
    pub singular_values: DVector<f64>,
    /// Right singular vectors, n x k, orthonormal columns.
    pub v: DMatrix<f64>,
}

impl Svd {
    /// Number of singular values above max(m, n) eps s_max.
    #[must_use]
    pub fn rank(&self) -> usize {
        let size = self.u.nrows().max(self.v.nrows());
        rank(self.singular_values.as_slice(), size)
    }
}

/// Thin SVD of any matrix with finite entries. O(m n min(m, n)); meant for up to a few hundred columns.
///
/// # Errors
/// [`GeometryError::Shape`] for an empty matrix, [`GeometryError::Svd`] for NaN or infinite entries.
pub fn svd(matrix: &DMatrix<f64>) -> Result<Svd, GeometryError> {
    let (rows, columns) = matrix.shape();
    if rows == 0 || columns == 0 {
        return Err(GeometryError::Shape {
            rows,
            columns,
            required: "at least 1x1",
        });
    }
    let fail = GeometryError::Svd { rows, columns };
    let scale = matrix.amax();
    if !matrix.iter().all(|v| v.is_finite()) {
        return Err(fail);
    }
    // A power of two changes no digit, and keeps the squares of huge or tiny entries in range.
    let factor = power_of_two_near(scale);
    let scaled = matrix / factor;
    let transposed = rows < columns;
    let tall = if transposed {
        scaled.transpose()
    } else {
        scaled
    };
    let (u, values, v) = jacobi::thin_svd(tall).ok_or(fail)?;
    let (u, v) = if transposed { (v, u) } else { (u, v) };
    Ok(Svd {
        u,
        singular_values: values * factor,
        v,
    })
}

/// SVD of a 3x3 matrix, A = U diag(s) V^T.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Svd3 {
    /// U, orthogonal.
    pub u: Matrix3<f64>,
    /// Singular values, descending.
    pub singular_values: Vector3<f64>,
    /// V^T, orthogonal.
    pub v_transposed: Matrix3<f64>,
}

/// SVD of a 3x3 matrix. O(1).
///
/// # Errors
/// [`GeometryError::Svd`] for NaN or infinite entries.
pub fn svd3(matrix: &Matrix3<f64>) -> Result<Svd3, GeometryError> {
    let fail = GeometryError::Svd {
        rows: 3,
        columns: 3,
    };
    if !matrix.iter().all(|v| v.is_finite()) {
        return Err(fail);
    }
    #[expect(
        clippy::disallowed_methods,
        reason = "the 3x3 case is exact to 4e-15; larger matrices go to Jacobi rotations"
    )]
    let svd = matrix.svd(true, true);
    match (svd.u, svd.v_t) {
        (Some(u), Some(v_transposed)) => Ok(Svd3 {
            u,
            singular_values: svd.singular_values,
            v_transposed,
        }),
        _ => Err(fail),
    }
}

/// The unit vector that a matrix shrinks most, and how far it stands out.
#[derive(Debug, Clone, PartialEq)]
pub struct NullVector {
    /// Unit right singular vector of the smallest singular value; its sign is arbitrary.
    pub vector: DVector<f64>,
    /// |A x| of that vector.
    pub smallest: f64,
    /// The next singular value: the vector is unique only while this is clearly above `smallest`.
    pub second_smallest: f64,
    /// Rank of the matrix; a null vector is unique if it is columns - 1 (or columns, for a least-squares one).
    pub rank: usize,
}

/// argmin |A x| over |x| = 1 for an m x n matrix, n >= 2, any m >= 1. O(max(m, n) n^2).
///
/// # Errors
/// As [`svd()`]; [`GeometryError::Shape`] for fewer than two columns.
///
/// ```
/// use mono_geometry::linalg::null_vector;
/// use nalgebra::DMatrix;
///
/// // The line a x + b y + c = 0 through points near y = 2 x + 1.
/// let points = DMatrix::from_row_slice(4, 3, &[0.0, 1.0, 1.0, 1.0, 3.001, 1.0, 2.0, 4.999, 1.0, 3.0, 7.0, 1.0]);
/// let line = null_vector(&points)?;
/// assert!((line.vector[0] / line.vector[1] + 2.0).abs() < 1e-2);
/// assert!(line.second_smallest > 100.0 * line.smallest);
/// # Ok::<(), mono_geometry::GeometryError>(())
/// ```
pub fn null_vector(matrix: &DMatrix<f64>) -> Result<NullVector, GeometryError> {
    let (rows, columns) = matrix.shape();
    if columns < 2 {
        return Err(GeometryError::Shape {
            rows,
            columns,
            required: "at least two columns",
        });
    }
    // The thin SVD of a wide matrix lacks its null space: rows of zeros change nothing but bring it in.
    let decomposition = if rows < columns && rows > 0 {
        svd(&matrix.clone().resize_vertically(columns, 0.0))?
    } else {
        svd(matrix)?
    };
    Ok(NullVector {
        vector: decomposition.v.column(columns - 1).into_owned(),
        smallest: decomposition.singular_values[columns - 1],
        second_smallest: decomposition.singular_values[columns - 2],
        rank: decomposition.rank(),
    })
}

/// Solution of a linear least-squares problem.
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquares {
    /// The minimiser of |A x - b|; of minimal norm where there are several.
    pub solution: DVector<f64>,
    /// Rank of A; the solution is unique if it equals the number of columns.
    pub rank: usize,
    /// |A x - b| at the solution.
    pub residual_norm: f64,
    /// Largest over smallest retained singular value: the factor by which relative errors grow.
    pub condition: f64,
}

/// argmin |A x - b| for an m x n matrix of any shape and rank, by SVD. O(m n min(m, n)).
///
/// # Errors
/// As [`svd()`]; [`GeometryError::Shape`] if `b` has not m entries, [`GeometryError::InvalidParameter`] if one of them is
/// not finite.
pub fn lstsq(matrix: &DMatrix<f64>, b: &DVector<f64>) -> Result<LeastSquares, GeometryError> {
    let (rows, columns) = matrix.shape();
    if rows != b.len() {
        return Err(GeometryError::Shape {
            rows,
            columns,
            required: "as many rows as the right-hand side has entries",
        });
    }
    if let Some(value) = b.iter().find(|v| !v.is_finite()) {
        return Err(GeometryError::InvalidParameter {
            name: "right-hand side",
            value: *value,
            required: "finite",
        });
    }
    let decomposition = svd(matrix)?;
    let rank = decomposition.rank();
    let mut solution = DVector::zeros(columns);
    for k in 0..rank {
        let coefficient = decomposition.u.column(k).dot(b) / decomposition.singular_values[k];
        solution.axpy(coefficient, &decomposition.v.column(k), 1.0);
    }
    let residual_norm = (matrix * &solution - b).norm();
    let condition = if rank == 0 {
        f64::INFINITY
    } else {
        decomposition.singular_values[0] / decomposition.singular_values[rank - 1]
    };
    Ok(LeastSquares {
        solution,
        rank,
        residual_norm,
        condition,
    })
}

/// The Cholesky factor of [`estimation_base`], which names the pivot at which it fails, with nalgebra's solutions.
///
/// # Errors
/// [`GeometryError::NotPositiveDefinite`] with the first pivot at or below N eps times its diagonal entry (or NaN).
pub(crate) fn cholesky<const N: usize>(
    matrix: &SMatrix<f64, N, N>,
) -> Result<Cholesky<f64, Const<N>>, GeometryError> {
    let factor = estimation_base::CholeskyFactor::definite(matrix)?;
    Ok(Cholesky::pack_dirty(*factor.lower()))
}

/// The covariance whose inverse has this factor.
///
/// # Errors
/// [`GeometryError::NotPositiveDefinite`] with the smallest pivot where it is so small that its inverse is no finite number.
pub(crate) fn covariance<const N: usize>(
    information: &Cholesky<f64, Const<N>>,
) -> Result<SMatrix<f64, N, N>, GeometryError> {
    let covariance = symmetric(&information.inverse());
    if covariance.iter().all(|v| v.is_finite()) {
        return Ok(covariance);
    }
    let (pivot, root) = information.l_dirty().diagonal().argmin();
    Err(GeometryError::NotPositiveDefinite {
        pivot,
        value: root * root,
        required: f64::MIN_POSITIVE,
    })
}

/// The rotation nearest to a matrix in the Frobenius norm: U diag(1, 1, det(U V^T)) V^T.
///
/// # Errors
/// [`GeometryError::Svd`] for NaN or infinite entries.
pub fn nearest_rotation(matrix: &Matrix3<f64>) -> Result<Rotation3<f64>, GeometryError> {
    let Svd3 {
        u, v_transposed, ..
    } = svd3(matrix)?;
    let sign = if (u * v_transposed).determinant() < 0.0 {
        -1.0
    } else {
        1.0
    };
    let proper = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign));
    Ok(Rotation3::from_matrix_unchecked(u * proper * v_transposed))
}

/// Count of (descending) values above size eps s_max.
fn rank(singular_values: &[f64], size: usize) -> usize {
    let largest = singular_values.first().copied().unwrap_or(0.0);
    let threshold = size as f64 * f64::EPSILON * largest;
    singular_values.iter().filter(|s| **s > threshold).count()
}

/// A power of two within a factor 2 of a positive number (clamped to the normal range); 1 for zero.
fn power_of_two_near(value: f64) -> f64 {
    if value == 0.0 {
        return 1.0;
    }
    let exponent = value.log2().floor().clamp(-1000.0, 1000.0);
    exponent.exp2()
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix4;

    use super::*;

    #[test]
    fn cholesky_solves_or_names_the_pivot() {
        let a = Matrix4::new(
            4.0, 2.0, 0.0, 0.0, 2.0, 5.0, 1.0, 0.0, 0.0, 1.0, 3.0, 0.5, 0.0, 0.0, 0.5, 1.0,
        );
        let x = nalgebra::Vector4::new(1.0, -2.0, 3.0, 0.5);
        assert!((a.cholesky().unwrap().solve(&(a * x)) - x).norm() < 1e-14);
        let mut bad = a;
        bad[(2, 2)] = 0.2;
        assert!(matches!(
            cholesky(&bad).unwrap_err(),
            GeometryError::NotPositiveDefinite { pivot: 2, .. }
        ));
        // Exactly singular: rounding must not pass for a pivot.
        let v = Vector3::new(0.1, 0.2, 0.3);
        let singular = v * v.transpose() + Vector3::x() * Vector3::x().transpose();
        assert!(matches!(
            cholesky(&singular).unwrap_err(),
            GeometryError::NotPositiveDefinite { pivot: 2, .. }
        ));
        assert!(cholesky(&Matrix3::<f64>::zeros()).is_err());
        assert!(cholesky(&Matrix3::from_element(f64::NAN)).is_err());
        // Neither the scale nor the mixture of units matters.
        assert!(cholesky(&Matrix3::from_diagonal(&Vector3::new(1e8, 1e-12, 1.0))).is_ok());
        assert!(cholesky(&(Matrix3::identity() * 1e-200)).is_ok());
    }
}
