//! Homographies: exact recovery, derivatives, degenerate points, and the covariance against its own errors.

use mono_geometry::homography::{Homography, HomographyError, fit, keeps_orientation};
use nalgebra::{DMatrix, Matrix2, Matrix3, SVector, Vector2};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn config(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn gauss(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// A view of a board in metres by a camera with a focal length of 400 px.
fn board_to_pixel(tilt: f64, turn: f64) -> Matrix3<f64> {
    let (s, c) = tilt.sin_cos();
    let (st, ct) = turn.sin_cos();
    // Columns r1, r2, t of R_z(turn) R_y(tilt), 0.7 m away.
    let pose = Matrix3::new(ct * c, -st, 0.02, st * c, ct, -0.01, -s, 0.0, 0.7);
    Matrix3::new(400.0, 0.0, 320.0, 0.0, 405.0, 240.0, 0.0, 0.0, 1.0) * pose
}

fn board() -> Vec<Vector2<f64>> {
    (0..54)
        .map(|k| Vector2::new(f64::from(k % 9) * 0.03, f64::from(k / 9) * 0.03))
        .collect()
}

fn apart(a: &Homography, b: &Homography) -> f64 {
    let sign = a.matrix().dot(b.matrix()).signum();
    (a.matrix() * sign - b.matrix()).amax()
}

proptest! {
    #![proptest_config(config(256))]

    #[test]
    fn four_points_are_mapped_exactly_and_the_inverse_undoes_it(
        values in proptest::array::uniform16(-1.0..1.0_f64),
        scale in -3.0..3.0_f64,
        offset in -1000.0..1000.0_f64,
    ) {
        let at = |k: usize| Vector2::new(values[k], values[k + 1]);
        let corner = |k: usize| Vector2::new(f64::from(k as u32 & 1), f64::from(k as u32 >> 1)) * 2.0;
        // Corners of a square, moved by up to 0.35: never three in a line.
        let size = 10.0_f64.powf(scale);
        let source: [_; 4] = std::array::from_fn(|k| corner(k) + at(2 * k) * 0.35);
        let target: [_; 4] =
            std::array::from_fn(|k| (corner(k) + at(8 + 2 * k) * 0.35) * size + Vector2::new(offset, -offset));
        let h = Homography::from_four_points(&source, &target).expect("general position");
        for k in 0..4 {
            let tolerance = 1e-12 * (size + offset.abs());
            prop_assert!((h.map(&source[k]).unwrap() - target[k]).amax() < tolerance * 10.0);
            let back = h.map_inverse(&target[k]).unwrap() - source[k];
            // H in floating point knows the target to eps of its offset, and its inverse squares that.
            prop_assert!(back.amax() < 1e-13 * (1.0 + offset.abs() / size).powi(2) + 1e-12);
            let round = h.inverse().inverse();
            prop_assert!(apart(&round, &h) < 1e-14);
        }
        prop_assert!(keeps_orientation(&source, &target));
        // The fit of the same four points is the same matrix.
        let fitted = fit(&source, &target).unwrap();
        prop_assert!(fitted.rms < 1e-12 * (size + offset.abs()));
        for k in 0..4 {
            let moved = fitted.homography.map(&source[k]).unwrap() - target[k];
            prop_assert!(moved.amax() < 1e-11 * (size + offset.abs()));
        }
    }

    #[test]
    fn three_collinear_or_coincident_points_give_no_model(
        values in proptest::array::uniform8(-1.0..1.0_f64),
        along in -2.0..3.0_f64,
        which in 0..4_usize,
        shift in -100.0..100.0_f64,
    ) {
        let at = |k: usize| Vector2::new(values[2 * k], values[2 * k + 1]);
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| Vector2::new(x, y));
        let mut bad = [at(0), at(1), at(2), at(3)].map(|p| p + Vector2::new(shift, shift));
        let (a, b, c) = ((which + 1) % 4, (which + 2) % 4, which);
        bad[c] = bad[a] + (bad[b] - bad[a]) * along;
        prop_assert!(Homography::from_four_points(&bad, &square).is_none());
        prop_assert!(Homography::from_four_points(&square, &bad).is_none());
        bad[c] = bad[a];
        prop_assert!(Homography::from_four_points(&bad, &square).is_none());
    }

    #[test]
    fn jacobian_is_the_central_difference(
        tilt in -1.0..1.0_f64,
        turn in -3.0..3.0_f64,
        x in 0.0..0.3_f64,
        y in 0.0..0.2_f64,
    ) {
        let h = Homography::from_matrix(&board_to_pixel(tilt, turn)).unwrap();
        let point = Vector2::new(x, y);
        let (value, jacobian) = h.map_with_jacobian(&point).unwrap();
        prop_assert_eq!(value, h.map(&point).unwrap());
        let step = 1e-6;
        let column = |axis: usize| {
            let mut d = Vector2::zeros();
            d[axis] = step;
            (h.map(&(point + d)).unwrap() - h.map(&(point - d)).unwrap()) / (2.0 * step)
        };
        let numeric = Matrix2::from_columns(&[column(0), column(1)]);
        prop_assert!((numeric - jacobian).amax() < 1e-6 * jacobian.amax());
    }
}

#[test]
fn a_square_to_itself_is_the_identity_and_a_swap_is_no_view() {
    let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| Vector2::new(x, y));
    let h = Homography::from_four_points(&square, &square).unwrap();
    let expected = Matrix3::identity() / 3.0_f64.sqrt();
    assert!((h.matrix() - expected).amax() < 1e-15);
    let mut swapped = square;
    swapped.swap(0, 1);
    assert!(Homography::from_four_points(&square, &swapped).is_some());
    assert!(!keeps_orientation(&square, &swapped));
    // A mirror is a view from behind: all four triples turn.
    let mirror = square.map(|p| Vector2::new(-p.x, p.y));
    assert!(keeps_orientation(&square, &mirror));
}

#[test]
fn unusable_matrices_and_points_are_refused() {
    assert!(Homography::from_matrix(&Matrix3::zeros()).is_none());
    assert!(Homography::from_matrix(&Matrix3::repeat(1.0)).is_none());
    assert!(Homography::from_matrix(&Matrix3::repeat(f64::NAN)).is_none());
    assert!(Homography::from_matrix(&(Matrix3::identity() * 1e200)).is_some());
    let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(x, y)| Vector2::new(x, y));
    for bad in [f64::NAN, f64::INFINITY] {
        let mut broken = square;
        broken[2].x = bad;
        assert!(Homography::from_four_points(&broken, &square).is_none());
        assert!(Homography::from_four_points(&square, &broken).is_none());
        assert_eq!(
            fit(&square, &broken),
            Err(HomographyError::NotFinite { point: 2 })
        );
    }
    assert_eq!(
        fit(&square[..3], &square[..3]),
        Err(HomographyError::TooFewPoints { points: 3 })
    );
    assert!(matches!(
        fit(&square, &square[..3]),
        Err(HomographyError::CountMismatch { .. })
    ));
    let h = Homography::from_matrix(&Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0));
    // Rank 2.
    assert!(h.is_none());
    let h = Homography::from_matrix(&Matrix3::new(1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0))
        .unwrap();
    assert!(h.map(&Vector2::new(0.0, 0.5)).is_none());
    assert!(h.map(&Vector2::new(f64::NAN, 0.5)).is_none());
}

#[test]
fn many_points_are_recovered_to_rounding() {
    for (tilt, turn) in [(0.0, 0.0), (0.5, 0.3), (-0.9, 2.0)] {
        let truth = Homography::from_matrix(&board_to_pixel(tilt, turn)).unwrap();
        let source = board();
        let target: Vec<_> = source.iter().map(|p| truth.map(p).unwrap()).collect();
        let fitted = fit(&source, &target).unwrap();
        assert!(apart(&fitted.homography, &truth) < 1e-13);
        assert!(fitted.rms < 1e-11);
        assert!(fitted.condition < 100.0);
    }
}

/// Without noise in the source, the rank is that of the points, whatever the noise in the target.
#[test]
fn all_but_one_collinear_points_are_degenerate_also_under_noise() {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let truth = Homography::from_matrix(&board_to_pixel(0.4, 0.2)).unwrap();
    let row: Vec<_> = board().into_iter().take(9).collect();
    let mut row_and_one = row.clone();
    row_and_one.push(Vector2::new(0.05, 0.11));
    for noise in [0.0, 0.3] {
        for (source, most) in [(&row, 5), (&row_and_one, 7)] {
            let target: Vec<_> = source
                .iter()
                .map(|p| {
                    truth.map(p).unwrap() + Vector2::new(gauss(&mut rng), gauss(&mut rng)) * noise
                })
                .collect();
            let error = fit(source, &target).unwrap_err();
            assert!(
                matches!(error, HomographyError::Degenerate { rank } if rank <= most + 1),
                "{error}"
            );
        }
    }
    let same = vec![Vector2::new(0.1, 0.2); 10];
    assert!(matches!(
        fit(&same, &same),
        Err(HomographyError::Degenerate { .. })
    ));
}

/// The refinement minimises the transfer error: no matrix nearby does better, and the linear solution does worse.
#[test]
fn the_fit_is_a_minimum_of_the_transfer_error() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let truth = Homography::from_matrix(&board_to_pixel(0.9, 0.1)).unwrap();
    let source = board();
    let target: Vec<_> = source
        .iter()
        .map(|p| truth.map(p).unwrap() + Vector2::new(gauss(&mut rng), gauss(&mut rng)) * 3.0)
        .collect();
    let cost = |h: &Homography| -> f64 {
        source
            .iter()
            .zip(&target)
            .map(|(s, t)| h.transfer_error(s, t).unwrap().norm_squared())
            .sum()
    };
    let fitted = fit(&source, &target).unwrap();
    let best = cost(&fitted.homography);
    assert!((fitted.rms.powi(2) * 54.0 - best).abs() < 1e-9 * best);
    for entry in 0..9 {
        for sign in [-1.0, 1.0] {
            let mut moved = *fitted.homography.matrix();
            moved[entry] *= 1.0 + sign * 1e-5;
            assert!(cost(&Homography::from_matrix(&moved).unwrap()) >= best * (1.0 - 1e-13));
        }
    }
    assert!(cost(&truth) > best);
}

/// Normalised estimation error squared of the mapped points' homography, 8 degrees of freedom.
#[test]
fn reported_covariance_matches_the_errors() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let truth = Homography::from_matrix(&board_to_pixel(0.6, 0.4)).unwrap();
    let source = board();
    let clean: Vec<_> = source.iter().map(|p| truth.map(p).unwrap()).collect();
    let sigma = 0.3;
    let runs = 400;
    let mut total = 0.0;
    for _ in 0..runs {
        let target: Vec<_> = clean
            .iter()
            .map(|p| p + Vector2::new(gauss(&mut rng), gauss(&mut rng)) * sigma)
            .collect();
        let fitted = fit(&source, &target).unwrap();
        let flat = |m: &Matrix3<f64>| SVector::<f64, 9>::from_fn(|i, _| m[(i / 3, i % 3)]);
        let h = flat(fitted.homography.matrix());
        assert!((fitted.unit_covariance * h).amax() < 1e-12 * fitted.unit_covariance.amax());
        let sign = fitted.homography.matrix().dot(truth.matrix()).signum();
        let error = flat(truth.matrix()) * sign - h;
        // Entries differ by orders of magnitude: whiten before the pseudo-inverse.
        let scale = fitted.unit_covariance.diagonal().map(f64::sqrt);
        let whitened = DMatrix::from_fn(9, 9, |i, j| {
            fitted.unit_covariance[(i, j)] / (scale[i] * scale[j])
                + h[i] * h[j] / (scale[i] * scale[j])
        });
        let rhs = nalgebra::DVector::from_fn(9, |i, _| error[i] / scale[i]);
        let solved = whitened.cholesky().expect("positive definite").solve(&rhs);
        total += rhs.dot(&solved) / (sigma * sigma);
    }
    let mean = total / f64::from(runs);
    // Standard error of the mean of chi-square(8): sqrt(16 / runs).
    let bound = 4.5 * (16.0 / f64::from(runs)).sqrt();
    assert!((mean - 8.0).abs() < bound, "{mean}");
}

/// Sampson's distance: zero on the map, the true distance to first order off it, and not the transfer error.
#[test]
fn sampson_is_the_first_order_distance_to_the_exact_pairs() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    // Pixels to pixels, with perspective.
    let h = Homography::from_matrix(&Matrix3::new(
        2.0, 0.1, 30.0, -0.2, 1.7, 20.0, 4e-4, 1e-4, 1.0,
    ))
    .unwrap();
    for _ in 0..50 {
        let s = Vector2::new(rng.random_range(0.0..600.0), rng.random_range(0.0..400.0));
        let (t, jacobian) = h.map_with_jacobian(&s).unwrap();
        assert!(h.sampson_squared(&s, &t).unwrap() < 1e-20);
        // Nearest exact pair to (s + a, t + b), by a linear oracle: minimise |a - e|^2 + |b - J e|^2 over e.
        let a = Vector2::new(gauss(&mut rng), gauss(&mut rng)) * 0.01;
        let b = Vector2::new(gauss(&mut rng), gauss(&mut rng)) * 0.01;
        let stacked = Matrix2::identity() + jacobian.transpose() * jacobian;
        let e = stacked.try_inverse().unwrap() * (a + jacobian.transpose() * b);
        let oracle = (a - e).norm_squared() + (b - jacobian * e).norm_squared();
        let sampson = h.sampson_squared(&(s + a), &(t + b)).unwrap();
        assert!(
            (sampson - oracle).abs() < 1e-3 * oracle,
            "{sampson} {oracle}"
        );
        let transfer = h.transfer_error(&(s + a), &(t + b)).unwrap().norm_squared();
        assert!(transfer > 1.2 * oracle);
        let both = h.symmetric_transfer_squared(&(s + a), &(t + b)).unwrap();
        assert!(both > transfer);
    }
    assert!(
        h.sampson_squared(&Vector2::new(f64::NAN, 0.0), &Vector2::zeros())
            .is_none()
    );
}

/// The four-point solution against the naive one: eight linear equations with the last entry fixed to 1.
#[test]
fn four_points_agree_with_the_inhomogeneous_equations() {
    let mut rng = ChaCha8Rng::seed_from_u64(21);
    for _ in 0..100 {
        let corner = |k: usize| Vector2::new((k & 1) as f64, (k >> 1) as f64) * 100.0;
        let mut near = |k: usize| {
            corner(k) + Vector2::new(rng.random_range(-20.0..20.0), rng.random_range(-20.0..20.0))
        };
        let source: [Vector2<f64>; 4] = std::array::from_fn(&mut near);
        let target: [Vector2<f64>; 4] = std::array::from_fn(&mut near);
        let mut a = DMatrix::zeros(8, 8);
        let mut b = nalgebra::DVector::zeros(8);
        for k in 0..4 {
            let (s, t) = (source[k], target[k]);
            let rows = [
                [s.x, s.y, 1.0, 0.0, 0.0, 0.0, -t.x * s.x, -t.x * s.y],
                [0.0, 0.0, 0.0, s.x, s.y, 1.0, -t.y * s.x, -t.y * s.y],
            ];
            for axis in 0..2 {
                for j in 0..8 {
                    a[(2 * k + axis, j)] = rows[axis][j];
                }
                b[2 * k + axis] = t[axis];
            }
        }
        let x = a.lu().solve(&b).unwrap();
        let naive = Matrix3::new(x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], 1.0);
        let naive = Homography::from_matrix(&naive).unwrap();
        let ours = Homography::from_four_points(&source, &target).unwrap();
        assert!(apart(&ours, &naive) < 1e-10);
    }
}
