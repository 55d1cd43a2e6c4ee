//! Linear algebra on generated spectra: exact rank loss, repeated, tiny and widely spread singular values.

use mono_geometry::GeometryError;
use mono_geometry::linalg::{lstsq, nearest_rotation, null_vector, svd, svd3};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use proptest::prelude::*;
use proptest::test_runner::Config;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// A matrix with orthonormal columns, Haar distributed.
fn orthonormal(rows: usize, columns: usize, rng: &mut ChaCha8Rng) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| StandardNormal.sample(&mut *rng))
        .qr()
        .q()
}

/// U diag(s) V^T with random orthonormal factors.
fn with_spectrum(
    rows: usize,
    columns: usize,
    spectrum: &[f64],
    seed: u64,
) -> (DMatrix<f64>, DMatrix<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let size = rows.min(columns);
    let u = orthonormal(rows, size, &mut rng);
    let v = orthonormal(columns, columns, &mut rng);
    let s = DMatrix::from_diagonal(&DVector::from_column_slice(&spectrum[..size]));
    (&u * s * v.columns(0, size).transpose(), v)
}

/// Descending spectra of length 12 that break weak algorithms.
fn spectrum() -> impl Strategy<Value = Vec<f64>> {
    (
        0_usize..12,
        prop_oneof![Just(0.0), Just(1e-16), Just(1e-10)],
        0..4_u8,
        prop_oneof![Just(1.0), Just(1e-150), Just(1e150)],
    )
        .prop_map(|(kept, tail, kind, scale)| {
            (0..12)
                .map(|k| {
                    let value = match kind {
                        0 => 1.0,
                        1 => 1.0 - 0.05 * k as f64,
                        2 => 10.0_f64.powi(-(k as i32)),
                        _ => {
                            if k < 4 {
                                1.0
                            } else {
                                1e-3
                            }
                        }
                    };
                    scale
                        * if k <= kept {
                            value
                        } else {
                            f64::min(tail, value)
                        }
                })
                .collect()
        })
}

proptest! {
    #![proptest_config(Config { cases: 400, failure_persistence: None, ..Config::default() })]

    #[test]
    fn svd_reconstructs(rows in 1_usize..13, columns in 1_usize..13, spectrum in spectrum(), seed in 0_u64..1_000_000) {
        let (matrix, _) = with_spectrum(rows, columns, &spectrum, seed);
        let d = svd(&matrix).unwrap();
        let size = rows.min(columns);
        let unit = f64::EPSILON * 12.0;
        let rebuilt = &d.u * DMatrix::from_diagonal(&d.singular_values) * d.v.transpose();
        prop_assert!((rebuilt - &matrix).amax() <= 8.0 * unit * spectrum[0]);
        prop_assert!((d.u.transpose() * &d.u - DMatrix::identity(size, size)).amax() <= 8.0 * unit);
        prop_assert!((d.v.transpose() * &d.v - DMatrix::identity(size, size)).amax() <= 8.0 * unit);
        for k in 0..size {
            prop_assert!((d.singular_values[k] - spectrum[k]).abs() <= 8.0 * unit * spectrum[0]);
            prop_assert!(k == 0 || d.singular_values[k] <= d.singular_values[k - 1]);
        }
    }

    /// A x = 0 exactly in the model; found to a few eps over the gap.
    #[test]
    fn null_vector_is_the_last_direction(rows in 3_usize..13, seed in 0_u64..1_000_000, low in prop_oneof![Just(0.0), Just(1e-12), Just(1e-3)]) {
        let columns = 4;
        let mut spectrum = vec![2.0, 1.0, 0.5, low];
        spectrum.resize(12, 0.0);
        let (matrix, v) = with_spectrum(rows, columns, &spectrum, seed);
        let null = null_vector(&matrix).unwrap();
        let expected = v.column(3).into_owned();
        let error = (&null.vector - &expected).norm().min((&null.vector + &expected).norm());
        prop_assert!(error < 200.0 * f64::EPSILON, "{error}");
        prop_assert!((null.second_smallest - 0.5).abs() < 1e-14);
        prop_assert_eq!(null.rank, if rows > 3 && low > 1e-13 { 4 } else { 3 });
    }

    /// b = A x + (something orthogonal to the columns): the minimal-norm x comes back, whatever the rank.
    #[test]
    fn least_squares_of_any_rank(rows in 5_usize..13, rank in 1_usize..5, seed in 0_u64..1_000_000) {
        let columns = 4;
        let rank = rank.min(columns);
        let mut spectrum = vec![3.0, 1.0, 0.3, 0.1];
        spectrum[rank..].fill(0.0);
        spectrum.resize(12, 0.0);
        let (matrix, v) = with_spectrum(rows, columns, &spectrum, seed);
        let mut rng = ChaCha8Rng::seed_from_u64(seed + 1);
        let coefficients = DVector::from_fn(rank, |_, _| StandardNormal.sample(&mut rng));
        let expected = v.columns(0, rank) * coefficients;
        let noise: DVector<f64> = DVector::from_fn(rows, |_, _| StandardNormal.sample(&mut rng));
        let d = svd(&matrix).unwrap();
        let range = d.u.columns(0, rank);
        let outside = &noise - range * (range.transpose() * &noise);
        let b = &matrix * &expected + &outside;
        let solved = lstsq(&matrix, &b).unwrap();
        prop_assert_eq!(solved.rank, rank);
        prop_assert!((&solved.solution - &expected).norm() < 1e-12 * (1.0 + b.norm()));
        prop_assert!((solved.residual_norm - outside.norm()).abs() < 1e-12 * (1.0 + b.norm()));
        prop_assert!((solved.condition - 3.0 / spectrum[rank - 1]).abs() < 1e-10);
    }

    #[test]
    fn svd3_and_nearest_rotation(a in -1.0..1.0_f64, b in -1.0..1.0_f64, c in -1.0..1.0_f64, noise in -0.1..0.1_f64) {
        let rotation = mono_geometry::so3::exp(&Vector3::new(a, b, c));
        let bent = rotation.matrix() + Matrix3::new(noise, 0.0, -noise, 0.3 * noise, noise, 0.0, 0.0, 0.5 * noise, noise);
        let d = svd3(&bent).unwrap();
        prop_assert!((d.u * Matrix3::from_diagonal(&d.singular_values) * d.v_transposed - bent).amax() < 8e-15);
        let nearest = nearest_rotation(&bent).unwrap();
        // The optimum is where R^T A is symmetric (polar decomposition).
        let polar = nearest.matrix().transpose() * bent;
        prop_assert!((polar - polar.transpose()).amax() < 1e-14);
        prop_assert!((nearest.matrix().determinant() - 1.0).abs() < 1e-14);
    }
}

/// The 4x4 rank-3 matrices on which nalgebra's general SVD errs by up to 0.15; here 2 000 of them.
#[test]
fn rank_three_four_by_four_never_fails() {
    let mut worst = 0.0_f64;
    for seed in 0..2_000 {
        let mut spectrum = vec![1.0, 0.7, 0.2, 0.0];
        spectrum.resize(12, 0.0);
        let (matrix, _) = with_spectrum(4, 4, &spectrum, seed);
        let d = svd(&matrix).unwrap();
        let rebuilt = &d.u * DMatrix::from_diagonal(&d.singular_values) * d.v.transpose();
        worst = worst.max((rebuilt - matrix).amax());
        assert_eq!(d.rank(), 3);
    }
    assert!(worst < 1e-14, "{worst}");
}

#[test]
fn bad_shapes_and_numbers_are_errors() {
    assert!(matches!(
        svd(&DMatrix::zeros(0, 3)),
        Err(GeometryError::Shape { .. })
    ));
    assert!(matches!(
        svd(&DMatrix::from_element(4, 3, f64::NAN)),
        Err(GeometryError::Svd {
            rows: 4,
            columns: 3
        })
    ));
    assert!(matches!(
        null_vector(&DMatrix::zeros(3, 1)),
        Err(GeometryError::Shape { .. })
    ));
    assert!(matches!(
        null_vector(&DMatrix::zeros(0, 3)),
        Err(GeometryError::Shape { .. })
    ));
    assert!(matches!(
        lstsq(&DMatrix::zeros(3, 2), &DVector::zeros(2)),
        Err(GeometryError::Shape { .. })
    ));
    let infinite = DVector::from_element(3, f64::INFINITY);
    assert!(matches!(
        lstsq(&DMatrix::zeros(3, 2), &infinite),
        Err(GeometryError::InvalidParameter { .. })
    ));
    assert!(svd3(&Matrix3::from_element(f64::NAN)).is_err());
    assert!(nearest_rotation(&Matrix3::from_element(f64::INFINITY)).is_err());
    let zero = lstsq(&DMatrix::zeros(3, 2), &DVector::from_element(3, 1.0)).unwrap();
    assert_eq!((zero.rank, zero.solution.norm()), (0, 0.0));
    // The zero matrix shrinks everything: rank 0, and the vector is still a unit vector.
    let null = null_vector(&DMatrix::zeros(3, 3)).unwrap();
    assert_eq!(null.rank, 0);
    assert!((null.vector.norm() - 1.0).abs() < 1e-15);
}
/// Exact zeros stay zeros: the first vanishing singular value is rounding error of the size of a few eps, for every
/// shape.
#[test]
fn rank_deficient_shapes_keep_their_zeros() {
    for (rows, columns) in [
        (4, 4),
        (8, 4),
        (10, 4),
        (12, 4),
        (4, 10),
        (20, 6),
        (6, 20),
        (12, 12),
    ] {
        let size = rows.min(columns);
        for rank in 1..size {
            for seed in 0..(6_000 / size) as u64 {
                let spectrum: Vec<f64> = (0..size)
                    .map(|k| {
                        if k >= rank {
                            0.0
                        } else if seed % 2 == 0 {
                            1.0 - 0.05 * k as f64
                        } else {
                            0.3_f64.powi(k as i32)
                        }
                    })
                    .collect();
                let (matrix, _) = with_spectrum(rows, columns, &spectrum, seed);
                let d = svd(&matrix).unwrap();
                assert!(
                    d.singular_values[rank] < 4.0 * f64::EPSILON,
                    "{rows}x{columns} seed {seed}"
                );
                assert_eq!(d.rank(), rank);
                let rebuilt = &d.u * DMatrix::from_diagonal(&d.singular_values) * d.v.transpose();
                assert!(
                    (rebuilt - matrix).norm() < 80.0 * f64::EPSILON,
                    "{rows}x{columns} seed {seed}"
                );
            }
        }
    }
}

/// The sizes that calibration and bundles reach, and more: errors by the size, not by the spread of the spectrum.
#[test]
fn large_shapes_and_wide_spectra() {
    for (rows, columns) in [(60, 13), (13, 60), (90, 40), (150, 150)] {
        let size = rows.min(columns);
        for (kind, seed) in [(0, 7), (1, 8), (2, 9), (3, 10)] {
            let spectrum: Vec<f64> = (0..size)
                .map(|k| match kind {
                    0 => 1.0 - 0.5 * k as f64 / size as f64,
                    1 => 10.0_f64.powf(-20.0 * k as f64 / size as f64),
                    2 if k < size / 2 => 1.0,
                    2 => 0.0,
                    _ => f64::from(u8::try_from(k % 3).expect("below 3")) + 1.0,
                })
                .collect();
            let mut sorted = spectrum.clone();
            sorted.sort_by(|a, b| b.total_cmp(a));
            let (matrix, _) = with_spectrum(rows, columns, &spectrum, seed);
            let d = svd(&matrix).unwrap();
            let rebuilt = &d.u * DMatrix::from_diagonal(&d.singular_values) * d.v.transpose();
            let unit = f64::EPSILON * sorted[0];
            let error = (rebuilt - &matrix).norm() / unit;
            let u = (d.u.transpose() * &d.u - DMatrix::identity(size, size)).norm() / f64::EPSILON;
            let v = (d.v.transpose() * &d.v - DMatrix::identity(size, size)).norm() / f64::EPSILON;
            let values = (0..size)
                .map(|k| (d.singular_values[k] - sorted[k]).abs() / unit)
                .fold(0.0, f64::max);
            println!(
                "{rows}x{columns} kind {kind}: A {error:.0} U {u:.0} V {v:.0} s {values:.0} eps"
            );
            let bound = 20.0 * size as f64;
            assert!(error < bound && u < bound && v < bound && values < bound);
        }
    }
}

/// One-sided Jacobi finds small singular values of a badly scaled matrix to full relative precision: A = B D with B well
/// conditioned. A method that is only backward stable is off by eps times the largest one.
#[test]
fn small_singular_values_of_scaled_columns_are_relatively_exact() {
    let (b, _) = with_spectrum(12, 12, &[1.0; 12], 3);
    // With orthonormal B the singular values are the scales.
    let scales = DVector::from_fn(12, |k, _| 10.0_f64.powi(-(13 * k as i32) / 2));
    let d = svd(&(b * DMatrix::from_diagonal(&scales))).unwrap();
    for k in 0..12 {
        let relative = d.singular_values[k] / scales[k] - 1.0;
        assert!(relative.abs() < 1e-14, "{k}: {relative}");
    }
    assert_eq!(d.rank(), 3);
}
