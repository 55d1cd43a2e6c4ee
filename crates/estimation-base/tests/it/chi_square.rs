//! The chi-square distribution against closed forms and printed tables.

use estimation_base::{ChiSquareError, chi_square_cdf, chi_square_quantile};

/// Two degrees of freedom are exponential, four a sum of two exponentials.
#[test]
fn even_degrees_have_closed_forms() {
    for x in [1e-6, 0.1, 1.0, 3.9, 4.1, 9.0, 20.0] {
        let tail = (-0.5_f64 * x).exp();
        let cases = [
            (2.0, 1.0 - tail),
            (4.0, 1.0 - tail * (1.0 + 0.5 * x)),
            (6.0, 1.0 - tail * (1.0 + 0.5 * x + 0.125 * x * x)),
        ];
        for (dof, expected) in cases {
            let found = chi_square_cdf(dof, x);
            assert!((found - expected).abs() < 1e-14, "{dof} {x}");
        }
    }
    for p in [0.01_f64, 0.5, 0.95, 0.99, 0.9999] {
        let expected = -2.0 * (1.0 - p).ln();
        let found = chi_square_quantile(2.0, p).unwrap();
        assert!((found - expected).abs() < 1e-11 * expected.max(1.0), "{p}");
    }
}

/// Values of printed tables, three decimals.
#[test]
fn val_tables_of_quantiles() {
    for (dof, p, expected) in [
        (1.0, 0.95, 3.841),
        (1.0, 0.99, 6.635),
        (3.0, 0.025, 0.216),
        (3.0, 0.975, 9.348),
        (10.0, 0.05, 3.940),
        (100.0, 0.975, 129.561),
    ] {
        let found = chi_square_quantile(dof, p).unwrap();
        assert!((found - expected).abs() < 6e-4, "{dof} {p} {found}");
    }
}

#[test]
fn the_quantile_inverts_the_distribution() {
    for dof in [1.0, 1.5, 2.0, 7.0, 300.0, 1e5] {
        for p in [1e-9, 0.01, 0.5, 0.99, 0.999_999] {
            let back = chi_square_cdf(dof, chi_square_quantile(dof, p).unwrap());
            // the relative error of the distribution, and of its tail where the tail is what is known
            assert!((back - p).abs() < 1e-11, "{dof} {p} {back}");
        }
    }
}

#[test]
fn bad_questions_are_errors() {
    for value in [0.0, 1.0, -1.0, f64::NAN] {
        assert!(matches!(
            chi_square_quantile(2.0, value),
            Err(ChiSquareError::Probability { .. })
        ));
    }
    for value in [0.0, -1.0, 0.99, f64::INFINITY, f64::NAN] {
        assert!(matches!(
            chi_square_quantile(value, 0.5),
            Err(ChiSquareError::DegreesOfFreedom { .. })
        ));
        assert!(chi_square_cdf(value, 1.0).is_nan());
    }
    assert!(chi_square_cdf(1.0, f64::NAN).is_nan());
    assert_eq!(chi_square_cdf(2.0, -1.0), 0.0);
    assert_eq!(chi_square_cdf(2.0, f64::INFINITY), 1.0);
}
