//! Cholesky factors of matrices of known spectrum, and the pivot at which the others fail.

use std::f64::consts::TAU;

use estimation_base::{
    CholeskyError, CholeskyFactor, check_symmetric, cholesky_in_place, symmetric,
};
use nalgebra::{DMatrix, Matrix2, Matrix3, Matrix4, SMatrix, SVector, Vector2, Vector3, Vector4};
use proptest::prelude::*;

use super::config;

/// An orthogonal matrix by Gram-Schmidt; `None` where the columns are nearly dependent.
fn orthogonal(entries: &[f64]) -> Option<Matrix4<f64>> {
    let mut q = Matrix4::from_column_slice(entries);
    for column in 0..4 {
        // twice is enough
        for _ in 0..2 {
            for before in 0..column {
                let share = q.column(before).dot(&q.column(column));
                let taken = q.column(before) * share;
                q.set_column(column, &(q.column(column) - taken));
            }
        }
        let norm = q.column(column).norm();
        if norm < 1e-2 {
            return None;
        }
        q.set_column(column, &(q.column(column) / norm));
    }
    Some(q)
}

fn spectrum() -> impl Strategy<Value = Vector4<f64>> {
    let exponent = prop_oneof![Just(0.0), -6.0..6.0_f64, -1.0..1.0_f64];
    prop::array::uniform4(exponent).prop_map(|e| Vector4::from(e).map(|e: f64| 10.0_f64.powf(e)))
}

proptest! {
    #![proptest_config(config(400))]

    /// The factorisation is backward stable: L L^T is P up to N eps of P, at any condition number.
    #[test]
    fn definite_matrices_of_any_condition(
        entries in prop::collection::vec(-1.0..1.0_f64, 16), values in spectrum(), right in prop::array::uniform4(-1.0..1.0_f64),
    ) {
        let Some(q) = orthogonal(&entries) else { return Ok(()) };
        let matrix = symmetric(&(q * Matrix4::from_diagonal(&values) * q.transpose()));
        let (largest, condition) = (values.max(), values.max() / values.min());
        // below that the smallest eigenvalue of the matrix as stored is uncertain by more than itself
        prop_assume!(condition < 1e12);
        check_symmetric(&matrix).unwrap();
        let factor = CholeskyFactor::definite(&matrix).unwrap();
        prop_assert!((factor.product() - matrix).amax() < 16.0 * f64::EPSILON * largest);
        prop_assert_eq!(*factor.lower(), factor.lower().lower_triangle());
        prop_assert_eq!(CholeskyFactor::semidefinite(&matrix).unwrap(), factor);

        let right = Vector4::from(right);
        let tolerance = 64.0 * f64::EPSILON * condition;
        let x = factor.solve(&right);
        prop_assert!((matrix * x - right).norm() <= tolerance * right.norm());
        let whitened = factor.whiten(&right);
        prop_assert!((factor.lower() * whitened - right).norm() <= tolerance * right.norm());
        prop_assert!((factor.lower().transpose() * x - whitened).norm() <= tolerance * whitened.norm());
        let squared = factor.mahalanobis_squared(&right);
        prop_assert!((squared - right.dot(&x)).abs() <= tolerance * squared);
        let logarithm: f64 = values.iter().map(|v| v.ln()).sum();
        prop_assert!((factor.log_determinant() - logarithm).abs() <= tolerance);
        let density = -0.5 * (squared + factor.log_determinant() + 4.0 * TAU.ln());
        prop_assert!((factor.log_density(&right) - density).abs() <= 1e-14 * (1.0 + squared + density.abs()));

        // the same numbers whether the size is known to the compiler or not
        let mut dynamic = DMatrix::from_column_slice(4, 4, matrix.as_slice());
        cholesky_in_place(&mut dynamic).unwrap();
        let same = dynamic.lower_triangle();
        prop_assert_eq!(same.as_slice(), factor.lower().as_slice());
    }

    /// A matrix of rank r has a semidefinite factor with 4 - r columns that are zero or rounding, and no definite one.
    #[test]
    fn matrices_that_lack_rank(entries in prop::collection::vec(-3.0_f64..3.0, 16), rank in 0..4_usize) {
        // small integers: the products are exact
        let root = Matrix4::from_fn(|i, j| if j < rank { entries[4 * j + i].round() } else { 0.0 });
        let matrix = root * root.transpose();
        let factor = CholeskyFactor::semidefinite(&matrix);
        if let Ok(factor) = factor {
            prop_assert!((factor.product() - matrix).amax() < 1e-6 * (1.0 + matrix.amax()));
        }
        if rank == 0 {
            prop_assert_eq!(*factor.unwrap().lower(), Matrix4::zeros());
        }
        if rank < 2 {
            let failed = CholeskyFactor::definite(&matrix);
            let named = matches!(failed, Err(CholeskyError::NotPositiveDefinite { .. }));
            prop_assert!(named, "{failed:?}");
        }
    }

    /// One negative eigenvalue clear of rounding is found by both forms.
    #[test]
    fn indefinite_matrices_are_refused(entries in prop::collection::vec(-1.0..1.0_f64, 16), values in spectrum(), which in 0..4_usize) {
        let Some(q) = orthogonal(&entries) else { return Ok(()) };
        let mut values = values;
        values[which] = -1e-6 * values.max();
        let matrix = symmetric(&(q * Matrix4::from_diagonal(&values) * q.transpose()));
        prop_assert!(CholeskyFactor::definite(&matrix).is_err());
        prop_assert!(CholeskyFactor::semidefinite(&matrix).is_err());
    }

    /// Scaling the variables by powers of two scales the factor, bit for bit: the test knows no units.
    #[test]
    fn units_do_not_matter(exponents in prop::array::uniform3(-300..300_i32), entries in prop::array::uniform9(-2.0..2.0_f64)) {
        let root = Matrix3::from_row_slice(&entries);
        let matrix = symmetric(&(root * root.transpose()));
        let units = Vector3::from(exponents.map(|e| 2.0_f64.powi(e)));
        let scaled = matrix.map_with_location(|i, j, entry| entry * units[i] * units[j]);
        match (CholeskyFactor::definite(&matrix), CholeskyFactor::definite(&scaled)) {
            (Ok(one), Ok(other)) => {
                let expected = one.lower().map_with_location(|i, _, entry| entry * units[i]);
                prop_assert_eq!(*other.lower(), expected);
            }
            (one, other) => prop_assert_eq!(one.is_err(), other.is_err()),
        }
    }
}

#[test]
fn solves_and_densities_of_a_known_matrix() {
    let root = Matrix3::new(2.0, 0.0, 0.0, -1.0, 0.5, 0.0, 3.0, 1.0, 1e-3);
    let factor = CholeskyFactor::definite(&(root * root.transpose())).unwrap();
    // the last pivot, 1e-6 beside 10, keeps eps * 10 / 1e-6 of its digits
    assert!((factor.lower() - root).amax() < 1e-8);
    let plane = CholeskyFactor::definite(&Matrix2::new(2.0, 0.5, 0.5, 1.0)).unwrap();
    // det 1.75, d^T P^-1 d = (1 - 1 + 2) / 1.75 for d = (1, 1)
    let expected = -0.5 * (2.0 / 1.75 + 1.75_f64.ln()) - TAU.ln();
    assert!((plane.log_density(&Vector2::new(1.0, 1.0)) - expected).abs() < 1e-15);
    let known = CholeskyFactor::from_lower(&root).unwrap();
    assert_eq!(*known.lower(), root);
    assert_eq!(known.product(), root * root.transpose());
}

#[test]
fn wrong_matrices_are_named() {
    let indefinite = Matrix2::new(1.0, 2.0, 2.0, 1.0);
    let rounding = 2.0 * f64::EPSILON;
    for (result, required) in [
        (CholeskyFactor::definite(&indefinite), rounding),
        (CholeskyFactor::semidefinite(&indefinite), -rounding),
    ] {
        let (pivot, value) = (1, -3.0);
        let expected = CholeskyError::NotPositiveDefinite {
            pivot,
            value,
            required,
        };
        assert_eq!(result, Err(expected));
    }
    assert!(CholeskyFactor::definite(&Matrix2::zeros()).is_err());
    assert_eq!(
        CholeskyFactor::semidefinite(&Matrix2::new(0.0, 1e-3, 1e-3, 1.0)),
        Err(CholeskyError::CovarianceWithoutVariance {
            pivot: 0,
            row: 1,
            value: 1e-3,
            at_most: 0.0
        })
    );
    let skew = Matrix2::new(1.0, 0.1, 0.2, 1.0);
    assert!(matches!(
        check_symmetric(&skew),
        Err(CholeskyError::NotSymmetric { row: 1, column: 0, difference }) if (difference - 0.1).abs() < 1e-15
    ));
    assert!(matches!(
        CholeskyFactor::from_lower(&Matrix2::new(1.0, 0.0, 0.0, -1.0)),
        Err(CholeskyError::NotPositiveDefinite { pivot: 1, .. })
    ));
}

#[test]
fn numbers_that_are_not_finite_are_named() {
    for wrong in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for (row, column) in [(0, 0), (2, 1), (2, 2)] {
            let mut matrix = Matrix3::identity();
            matrix[(row, column)] = wrong;
            let named = |error| matches!(error, CholeskyError::NotFinite { row: r, column: c, .. } if (r, c) == (row, column));
            assert!(named(CholeskyFactor::definite(&matrix).unwrap_err()));
            assert!(named(CholeskyFactor::semidefinite(&matrix).unwrap_err()));
            assert!(named(CholeskyFactor::from_lower(&matrix).unwrap_err()));
            assert!(named(check_symmetric(&matrix).unwrap_err()));
        }
    }
    // overflow on the way is no zero pivot
    let mut large = Matrix2::new(1e-200, 1e200, 1e200, 1e300);
    assert!(
        CholeskyFactor::semidefinite(&large).is_err() && CholeskyFactor::definite(&large).is_err()
    );
    // what is above the diagonal is not read
    large = Matrix2::new(4.0, f64::NAN, 2.0, 2.0);
    assert_eq!(
        CholeskyFactor::definite(&large).unwrap().lower()[(1, 0)],
        1.0
    );
    assert!(check_symmetric(&large).is_err());
}

#[test]
fn nothing_is_a_matrix_too() {
    let factor = CholeskyFactor::definite(&SMatrix::<f64, 0, 0>::zeros()).unwrap();
    assert_eq!(factor.mahalanobis_squared(&SVector::<f64, 0>::zeros()), 0.0);
    assert_eq!(factor.log_determinant(), 0.0);
}
