//! Rank-one changes of a Cholesky factor, the arithmetic of the square-root filter.
//!
//! - [`update`]: L' L'^T = L L^T + v v^T by Givens rotations that turn v into L column by column.
//!   Applied to the rows of a stack one after the other, beginning with L = 0, it is the QR
//!   factorisation of the stack (R^T = L), without the stack: n rows cost 2 n N^2 multiplications.
//!   It cannot fail, and the diagonal stays non-negative.
//! - [`downdate`]: L' L'^T = L L^T - v v^T. With p = L^-1 v this has a factor only while
//!   1 - |p|^2 > 0; the rotations then run backwards (LINPACK's `dchdd`: Dongarra et al. 1979, ch. 10;
//!   Stewart 1979 for its stability).

use estimation_base::{CholeskyError, Real};
use nalgebra::{ComplexField, SMatrix, SVector};

/// Adds `vector vector^T` to L L^T.
pub(crate) fn update<T: Real, const N: usize>(
    lower: &mut SMatrix<T, N, N>,
    mut vector: SVector<T, N>,
) {
    for column in 0..N {
        let (diagonal, entry) = (lower[(column, column)], vector[column]);
        if entry == T::zero() {
            continue;
        }
        let (cos, sin, length) = rotation(diagonal, entry);
        lower[(column, column)] = length;
        for row in column + 1..N {
            let (l, v) = (lower[(row, column)], vector[row]);
            lower[(row, column)] = cos * l + sin * v;
            vector[row] = cos * v - sin * l;
        }
    }
}

/// Adds the equation `vector`^T t = `value`, of unit noise, to the least squares problem L^T t = `right`, and returns the
/// residual that its rotation leaves: the squares of all residuals sum to the sum of squares at the solution.
pub(crate) fn update_with_right_side<T: Real, const N: usize>(
    lower: &mut SMatrix<T, N, N>,
    right: &mut SVector<T, N>,
    mut vector: SVector<T, N>,
    mut value: T,
) -> T {
    for column in 0..N {
        let (diagonal, entry) = (lower[(column, column)], vector[column]);
        if entry == T::zero() {
            continue;
        }
        let (cos, sin, length) = rotation(diagonal, entry);
        lower[(column, column)] = length;
        for row in column + 1..N {
            let (l, v) = (lower[(row, column)], vector[row]);
            lower[(row, column)] = cos * l + sin * v;
            vector[row] = cos * v - sin * l;
        }
        let (y, b) = (right[column], value);
        right[column] = cos * y + sin * b;
        value = cos * b - sin * y;
    }
    value
}

/// A lower triangular factor, in one piece or in blocks.
pub(crate) trait Lower<T> {
    fn at(&self, row: usize, column: usize) -> T;
    fn set(&mut self, row: usize, column: usize, value: T);
}

impl<T: Real, const N: usize> Lower<T> for SMatrix<T, N, N> {
    fn at(&self, row: usize, column: usize) -> T {
        self[(row, column)]
    }

    fn set(&mut self, row: usize, column: usize, value: T) {
        self[(row, column)] = value;
    }
}

/// Takes `vector vector^T` from L L^T; `lower` is unchanged after an error.
///
/// # Errors
/// [`CholeskyError::NotPositiveDefinite`] with the first row at which nothing is left, and 1 - |p|^2 up to
/// there (of the variance that L held).
pub(crate) fn downdate<T: Real, const N: usize>(
    lower: &mut SMatrix<T, N, N>,
    vector: &SVector<T, N>,
) -> Result<(), CholeskyError> {
    let lengths: [T; N] = core::array::from_fn(|row| lower.row(row).norm());
    downdate_rows::<T, N, 0>(lower, |row| vector[row], |row| lengths[row])
}

/// [`downdate`] for a factor of A + B rows, whose entries are known to the rounding of `length`(row).
///
/// A centre deviates by nothing but rounding where the function is linear: that is no reason to fail where a direction has no variance.
pub(crate) fn downdate_rows<T: Real, const A: usize, const B: usize>(
    lower: &mut impl Lower<T>,
    vector: impl Fn(usize) -> T,
    length: impl Fn(usize) -> T,
) -> Result<(), CholeskyError> {
    let mut p = Rows([T::zero(); A], [T::zero(); B]);
    let mut left = T::one();
    for row in 0..A + B {
        let mut entry = vector(row);
        for before in 0..row {
            entry -= lower.at(row, before) * *p.get(before);
        }
        if ComplexField::abs(entry) <= T::of(8.0 * (A + B) as f64) * T::EPSILON * length(row) {
            continue;
        }
        entry /= lower.at(row, row);
        left -= entry * entry;
        // also false for the NaN or infinity of a zero diagonal
        if !(left > T::zero() && left.is_finite()) {
            return Err(CholeskyError::NotPositiveDefinite {
                pivot: row,
                value: left.into(),
                required: 0.0,
            });
        }
        *p.get(row) = entry;
    }
    let mut rotations = Rows([(T::one(), T::zero()); A], [(T::one(), T::zero()); B]);
    let mut alpha = ComplexField::sqrt(left);
    for row in (0..A + B).rev() {
        let (cos, sin, length) = rotation(alpha, *p.get(row));
        *rotations.get(row) = (cos, sin);
        alpha = length;
    }
    for row in 0..A + B {
        let mut carried = T::zero();
        for column in (0..=row).rev() {
            let (cos, sin) = *rotations.get(column);
            let entry = lower.at(row, column);
            lower.set(row, column, cos * entry - sin * carried);
            carried = cos * carried + sin * entry;
        }
    }
    Ok(())
}

/// A + B values in two arrays.
struct Rows<T, const A: usize, const B: usize>([T; A], [T; B]);

impl<T, const A: usize, const B: usize> Rows<T, A, B> {
    const fn get(&mut self, row: usize) -> &mut T {
        if row < A {
            &mut self.0[row]
        } else {
            &mut self.1[row - A]
        }
    }
}

/// cos, sin and length of (x, y), without overflow; x >= 0, not both zero.
pub(crate) fn rotation<T: Real>(x: T, y: T) -> (T, T, T) {
    let scale = ComplexField::abs(x) + ComplexField::abs(y);
    let (a, b) = (x / scale, y / scale);
    let length = ComplexField::sqrt(a * a + b * b);
    (a / length, b / length, scale * length)
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use nalgebra::{Matrix3, Vector3};
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn update_and_downdate_change_the_product_and_undo_each_other(
            rows in prop::array::uniform9(-2.0..2.0_f64), v in prop::array::uniform3(-3.0..3.0_f64),
            rank in 0..3_usize,
        ) {
            let rows = Matrix3::from_row_slice(&rows);
            let v = Vector3::from(v);
            let mut lower = Matrix3::zeros();
            // rank 1, 2 or 3, row by row: the QR factorisation
            let mut product = Matrix3::zeros();
            for k in 0..=rank {
                update(&mut lower, rows.column(k).into_owned());
                product += rows.column(k) * rows.column(k).transpose();
            }
            // each rotation rounds by a few eps of the length it keeps
            let tolerance = 32.0 * f64::EPSILON * (product.trace() + v.norm_squared());
            prop_assert!((lower * lower.transpose() - product).amax() < tolerance);
            prop_assert!(lower == lower.lower_triangle());
            prop_assert!((0..3).all(|k| lower[(k, k)] >= 0.0));

            let before = lower;
            update(&mut lower, v);
            let grown = product + v * v.transpose();
            prop_assert!((lower * lower.transpose() - grown).amax() < tolerance);
            // what was added can be taken back where a fair share stays (error grows with 1 / left)
            if rank == 2 {
                let left = 1.0 / (1.0 + v.dot(&product.lu().solve(&v).unwrap_or(v * 1e9)));
                if left > 1e-3 {
                    downdate(&mut lower, &v).unwrap();
                    prop_assert!((lower * lower.transpose() - product).amax() < tolerance / left);
                    prop_assert!((lower - before).amax() < 1e-6 * before.amax());
                }
            }
        }
    }

    #[test]
    fn a_downdate_that_takes_too_much_names_the_row_and_changes_nothing() {
        let lower = Matrix3::new(1.0, 0.0, 0.0, 0.5, 2.0, 0.0, 0.0, 0.0, 3.0);
        let mut changed = lower;
        // p = (0.6, 0.9, ..): 1 - 0.36 - 0.81 = -0.17 in row 1
        let v = Vector3::new(0.6, 0.3 + 1.8, 1.0);
        match downdate(&mut changed, &v) {
            Err(CholeskyError::NotPositiveDefinite {
                pivot: 1, value, ..
            }) => assert!((value + 0.17).abs() < 1e-15),
            other => panic!("{other:?}"),
        }
        assert_eq!(changed, lower);
        // a direction without variance, and NaN
        let mut flat = Matrix3::from_diagonal(&Vector3::new(1.0, 0.0, 1.0));
        let along = Vector3::new(0.0, 1e-9, 0.0);
        assert!(matches!(
            downdate(&mut flat, &along),
            Err(CholeskyError::NotPositiveDefinite { pivot: 1, .. })
        ));
        let nan = Vector3::new(0.0, 0.0, f64::NAN);
        assert!(downdate(&mut flat, &nan).is_err());
        downdate(&mut flat, &Vector3::new(0.6, 0.0, 0.0)).unwrap();
        assert!((flat[(0, 0)] - 0.8).abs() < 1e-15);
    }
}
