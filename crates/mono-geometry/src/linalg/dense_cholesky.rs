//! Cholesky factorisation of a symmetric positive definite matrix whose size is known only at run time.
//!
//! A = L L^T by faer's blocked algorithm in one thread, so the order of the sums does not depend on the machine. Faster
//! than the textbook loops from about 30 rows on, and several times so at 200 (normal equations of a bundle).
//!
//! Degenerate: a semi-definite matrix leaves pivots that are rounding error, of either sign. Which size counts as
//! rounding depends on how the matrix was made (a Schur complement has lost digits that its entries do not show), so
//! the caller gives a floor for every pivot.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::{factor, inverse, solve};
use faer::{MatMut, MatRef, Par};
use nalgebra::DMatrix;

use crate::error::GeometryError;

/// Lower factor of a symmetric positive definite matrix.
#[derive(Debug, Clone, PartialEq)]
pub struct DenseCholesky {
    /// L in the lower triangle; what is above is not read.
    lower: DMatrix<f64>,
}

impl DenseCholesky {
    /// Factorises a square matrix in place; only its lower triangle is read. O(n^3 / 3).
    ///
    /// # Errors
    /// [`GeometryError::Shape`] if the matrix is not square or `pivot_floor` has another length,
    /// [`GeometryError::NotPositiveDefinite`] with the first pivot (square of the diagonal entry of L) that is not
    /// above its floor, or not finite.
    pub fn new(mut matrix: DMatrix<f64>, pivot_floor: &[f64]) -> Result<Self, GeometryError> {
        let (rows, columns) = matrix.shape();
        if rows != columns || rows != pivot_floor.len() {
            return Err(GeometryError::Shape {
                rows,
                columns,
                required: "square, with one pivot floor a row",
            });
        }
        if rows == 0 {
            return Ok(Self { lower: matrix });
        }
        let scratch = factor::cholesky_in_place_scratch::<f64>(rows, Par::Seq, Default::default());
        let failed = factor::cholesky_in_place(
            MatMut::from_column_major_slice_mut(matrix.as_mut_slice(), rows, rows),
            Default::default(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
            Default::default(),
        )
        .is_err();
        for j in 0..rows {
            let entry = matrix[(j, j)];
            // After a failure the diagonal holds roots up to the bad pivot, and the bad pivot itself.
            let good = entry > 0.0 && entry.is_finite() && entry * entry > pivot_floor[j];
            if !good {
                return Err(GeometryError::NotPositiveDefinite {
                    pivot: j,
                    value: if entry > 0.0 { entry * entry } else { entry },
                    required: pivot_floor[j],
                });
            }
        }
        if failed {
            return Err(GeometryError::NotPositiveDefinite {
                pivot: rows - 1,
                value: f64::NAN,
                required: pivot_floor[rows - 1],
            });
        }
        Ok(Self { lower: matrix })
    }

    /// Overwrites each column of `right` (n entries each, one after the other) by the solution of A x = column.
    /// O(n^2) a column.
    ///
    /// # Errors
    /// [`GeometryError::Shape`] if the length is not a multiple of n.
    pub fn solve_in_place(&self, right: &mut [f64]) -> Result<(), GeometryError> {
        let rows = self.lower.nrows();
        if rows == 0 && right.is_empty() {
            return Ok(());
        }
        if rows == 0 || !right.len().is_multiple_of(rows) {
            return Err(GeometryError::Shape {
                rows,
                columns: right.len(),
                required: "right-hand sides of as many entries as the matrix has rows",
            });
        }
        let columns = right.len() / rows;
        solve::solve_in_place(
            MatRef::from_column_major_slice(self.lower.as_slice(), rows, rows),
            MatMut::from_column_major_slice_mut(right, rows, columns),
            Par::Seq,
            MemStack::new(&mut []),
        );
        Ok(())
    }

    /// A^-1, both triangles. O(2 n^3 / 3).
    #[must_use]
    pub fn inverse(&self) -> DMatrix<f64> {
        let rows = self.lower.nrows();
        let mut result = DMatrix::zeros(rows, rows);
        if rows == 0 {
            return result;
        }
        let scratch = inverse::inverse_scratch::<f64>(rows, Par::Seq);
        inverse::inverse(
            MatMut::from_column_major_slice_mut(result.as_mut_slice(), rows, rows),
            MatRef::from_column_major_slice(self.lower.as_slice(), rows, rows),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
        result.fill_upper_triangle_with_lower_triangle();
        result
    }

    /// The buffer, to be filled and factorised again; its contents are L below and unspecified above.
    #[must_use]
    pub(crate) fn into_buffer(self) -> DMatrix<f64> {
        self.lower
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spd(n: usize) -> DMatrix<f64> {
        let root = DMatrix::from_fn(n, n, |i, j| ((i * n + 3 * j) as f64 * 0.7).sin());
        &root * root.transpose() + DMatrix::identity(n, n)
    }

    #[test]
    fn solves_sizes_around_the_block_size() {
        for n in [1, 2, 7, 63, 64, 65, 150] {
            let matrix = spd(n);
            let truth = DMatrix::from_fn(n, 3, |i, j| (i as f64 - 4.0 * j as f64).cos());
            let mut right = &matrix * &truth;
            let factor = DenseCholesky::new(matrix, &vec![0.0; n]).expect("positive definite");
            factor.solve_in_place(right.as_mut_slice()).expect("fits");
            assert!((right - truth).amax() < 1e-11, "{n}");
            let product = factor.inverse() * spd(n);
            assert!((product - DMatrix::identity(n, n)).amax() < 1e-11, "{n}");
        }
    }

    #[test]
    fn names_the_pivot_that_is_not_positive() {
        for n in [3, 80] {
            for bad in [0, n / 2, n - 1] {
                let mut matrix = spd(n);
                matrix[(bad, bad)] = -1.0;
                match DenseCholesky::new(matrix, &vec![0.0; n]) {
                    Err(GeometryError::NotPositiveDefinite { pivot, value, .. }) => {
                        assert_eq!(pivot, bad);
                        assert!(value <= 0.0, "{value}");
                    }
                    other => panic!("{other:?}"),
                }
            }
            let mut singular = spd(n);
            for k in 0..n {
                singular[(n - 1, k)] = singular[(0, k)];
                singular[(k, n - 1)] = singular[(k, 0)];
            }
            singular[(n - 1, n - 1)] = singular[(0, 0)];
            let floor: Vec<_> = singular.diagonal().iter().map(|d| 1e-13 * d).collect();
            assert!(matches!(
                DenseCholesky::new(singular, &floor),
                Err(GeometryError::NotPositiveDefinite { pivot, .. }) if pivot == n - 1
            ));
            let mut nan = spd(n);
            nan[(n - 1, 0)] = f64::NAN;
            assert!(DenseCholesky::new(nan, &vec![0.0; n]).is_err());
        }
    }

    #[test]
    fn shapes_are_checked_and_nothing_is_fine() {
        assert!(DenseCholesky::new(DMatrix::zeros(2, 3), &[0.0; 2]).is_err());
        assert!(DenseCholesky::new(DMatrix::identity(2, 2), &[0.0; 3]).is_err());
        let factor = DenseCholesky::new(DMatrix::identity(2, 2), &[0.0; 2]).expect("identity");
        assert!(factor.solve_in_place(&mut [0.0; 3]).is_err());
        let empty = DenseCholesky::new(DMatrix::zeros(0, 0), &[]).expect("empty");
        assert!(empty.solve_in_place(&mut []).is_ok());
    }
}
