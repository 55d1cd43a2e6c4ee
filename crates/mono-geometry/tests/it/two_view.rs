//! The optimal correction of a match: against the polynomial of Hartley and Sturm, near epipoles, and as a triangulation.

use crate::common::{config, gauss, look_at, pinhole, see};
use mono_geometry::epipolar::EpipolarPair;
use mono_geometry::triangulation::{
    Acceptance, NoCorrection, Rejection, correct_match, triangulate, triangulate_two_views,
};
use mono_geometry::{Mount, Se2, Se3};
use nalgebra::{Matrix3, Matrix6, Vector2, Vector3};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Least squared move by Hartley and Sturm (1997): both epipolar lines by one parameter t, the stationary points of
/// s(t) = t^2 / (1 + f^2 t^2) + (c t + d)^2 / ((a t + b)^2 + g^2 (c t + d)^2) as roots of a sextic, and s at infinity.
fn hartley_sturm(fundamental: &Matrix3<f64>, first: &Vector2<f64>, second: &Vector2<f64>) -> f64 {
    let shift = |p: &Vector2<f64>| Matrix3::new(1.0, 0.0, p.x, 0.0, 1.0, p.y, 0.0, 0.0, 1.0);
    let moved = shift(second).transpose() * fundamental * shift(first);
    let moved = moved / moved.amax();
    // Null vectors by the largest cross product of two rows or columns.
    let null = |m: &Matrix3<f64>| {
        let rows = [
            m.row(0).transpose(),
            m.row(1).transpose(),
            m.row(2).transpose(),
        ];
        [(0, 1), (1, 2), (2, 0)]
            .map(|(i, j)| rows[i].cross(&rows[j]))
            .into_iter()
            .max_by(|p, q| p.norm().total_cmp(&q.norm()))
            .expect("valid")
    };
    let scaled = |e: Vector3<f64>| e / e.xy().norm();
    let (e, e2) = (scaled(null(&moved)), scaled(null(&moved.transpose())));
    let turn = |e: &Vector3<f64>| Matrix3::new(e.x, e.y, 0.0, -e.y, e.x, 0.0, 0.0, 0.0, 1.0);
    let turned = turn(&e2) * moved * turn(&e).transpose();
    let (f, g) = (e.z, e2.z);
    let (a, b, c, d) = (
        turned[(1, 1)],
        turned[(1, 2)],
        turned[(2, 1)],
        turned[(2, 2)],
    );
    let cost = |t: f64| {
        let (p, q) = (a * t + b, c * t + d);
        t * t / (1.0 + f * f * t * t) + q * q / (p * p + g * g * q * q)
    };
    // t ((a t + b)^2 + g^2 (c t + d)^2)^2 - (a d - b c) (1 + f^2 t^2)^2 (a t + b) (c t + d).
    let times = |p: &[f64], q: &[f64]| {
        let mut out = vec![0.0; p.len() + q.len() - 1];
        for (i, x) in p.iter().enumerate() {
            for (j, y) in q.iter().enumerate() {
                out[i + j] += x * y;
            }
        }
        out
    };
    let p2 = times(&[b, a], &[b, a]);
    let q2 = times(&[d, c], &[d, c]);
    let sum: Vec<f64> = (0..3).map(|k| p2[k] + g * g * q2[k]).collect();
    let mut left = times(&[0.0, 1.0], &times(&sum, &sum));
    left.resize(7, 0.0);
    let by_f = times(&[1.0, 0.0, f * f], &[1.0, 0.0, f * f]);
    let right = times(&by_f, &times(&[b, a], &[d, c]));
    let polynomial: Vec<f64> = (0..7)
        .map(|k| left[k] - (a * d - b * c) * right[k])
        .collect();
    let evaluate = |t: f64| polynomial.iter().rev().fold(0.0, |sum, k| sum * t + k);
    let slope = |t: f64| {
        (1..7)
            .rev()
            .fold(0.0, |sum, k| sum * t + k as f64 * polynomial[k])
    };
    let companion = Matrix6::from_fn(|i, j| {
        if j == 5 {
            -polynomial[i] / polynomial[6]
        } else {
            f64::from(u8::from(i == j + 1))
        }
    });
    let mut best = 1.0 / (f * f) + c * c / (a * a + g * g * c * c);
    for root in companion.complex_eigenvalues().iter() {
        let mut t = root.re;
        for _ in 0..20 {
            let next = t - evaluate(t) / slope(t);
            if !next.is_finite() {
                break;
            }
            t = next;
            best = best.min(cost(t));
        }
        best = best.min(cost(root.re));
    }
    best
}

fn pair(first: &Se3, second: &Se3) -> EpipolarPair {
    EpipolarPair::new(&pinhole(), first, second).expect("valid")
}

proptest! {
    #![proptest_config(config(2_000))]

    #[test]
    fn it_is_the_minimum_of_hartley_and_sturm(
        seed in 0_u64..1_000_000, (sideways, forward) in prop_oneof![
            (-1.0..1.0_f64, 0.02..1.0_f64), (Just(0.0), 0.02..1.0_f64), (0.02..1.0_f64, Just(0.0)),
        ], up in -0.3..0.3_f64, turn in -0.3..0.3_f64,
        noise in prop_oneof![Just(0.5), Just(5.0), Just(80.0)],
    ) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mount = Mount::forward();
        let first = mount.world_from_camera(&Se2::new(0.0, 0.0, 0.0), 0.0, 0.0, 0.0);
        let second = mount.world_from_camera(&Se2::new(forward, sideways, turn), 0.02, -0.01, up);
        let pair = pair(&first, &second);
        // Anywhere in the image, near the epipoles as well, plus noise: not only plausible matches.
        let p1 = Vector2::new(160.0, 120.0) + Vector2::new(gauss(&mut rng), gauss(&mut rng)) * 60.0;
        let p2 = p1 + Vector2::new(gauss(&mut rng), gauss(&mut rng)) * noise;
        let got = correct_match(pair.fundamental(), &p1, &p2, 1.0, 1.0).expect("valid");
        let oracle = hartley_sturm(pair.fundamental(), &p1, &p2);
        // The sextic's own rounding: its coefficients hold the fourth power of pixels.
        prop_assert!((got.chi_square - oracle).abs() <= 1e-6 * oracle + 1e-12, "{} {}", got.chi_square, oracle);
        prop_assert!(got.chi_square <= oracle * (1.0 + 1e-9) + 1e-18);
        let left = pair.sampson(&got.first_px, &got.second_px, 1.0, 1.0).expect("valid");
        prop_assert!(left.distance_px.abs() < 1e-10, "{}", left.distance_px);
        let moved = (got.first_px - p1).norm_squared() + (got.second_px - p2).norm_squared();
        prop_assert!((moved - got.chi_square).abs() <= 1e-9 * (moved + 1e-3));
        // The Sampson distance is its first-order value: equal for small moves, not for large ones.
        if noise == 0.5 && oracle < 1.0 && forward == 0.0 {
            let sampson = pair.sampson(&p1, &p2, 1.0, 1.0).expect("valid").distance_px.powi(2);
            prop_assert!((sampson - oracle).abs() < 0.05 * oracle);
        }
    }

    #[test]
    fn two_views_give_the_point_of_the_iteration_in_space(
        seed in 0_u64..1_000_000, angle in 0.01..1.5_f64, depth in 0.5..20.0_f64,
        sigmas in (0.2..2.0_f64, 0.2..2.0_f64),
    ) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let target = Vector3::new(3.0, -2.0, 0.4);
        let mut observations = [(0.0, sigmas.0), (angle, sigmas.1)].map(|(a, sigma_px)| {
            let position = target + Vector3::new(a.sin(), -a.cos(), 0.1 * a) * depth;
            let camera = look_at(position, target + Vector3::new(0.1, 0.0, 0.05) * depth);
            see(&camera, &target, sigma_px)
        });
        for o in &mut observations {
            o.pixel_ideal += Vector2::new(gauss(&mut rng), gauss(&mut rng)) * (o.sigma_px * 0.3);
        }
        let open = Acceptance { min_parallax_rad: 0.0, chi_square_probability: 1.0, max_iterations: 50 };
        let iterated = triangulate(&pinhole(), &observations, &open).expect("valid");
        let direct = triangulate_two_views(&pinhole(), &observations, &open).expect("valid");
        // The iteration stops within 1e-6 standard deviations.
        for axis in 0..3 {
            let sigma = iterated.covariance[(axis, axis)].sqrt();
            prop_assert!((iterated.point - direct.point)[axis].abs() < 2e-6 * sigma + 1e-9 * depth);
        }
        prop_assert!((iterated.chi_square - direct.chi_square).abs() < 1e-9 * (1.0 + direct.chi_square));
        prop_assert!((iterated.covariance - direct.covariance).amax() < 1e-5 * direct.covariance.amax());
        prop_assert_eq!(direct.degrees_of_freedom, 1);
    }
}

#[test]
fn next_to_equal_corrections_the_shorter_one_is_found() {
    // Pixels nearly at a right angle around the epipoles of a motion along the optical axis.
    let forward = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let (mut slow, trials) = (0, 500);
    for k in 0..trials {
        let small = 10.0_f64.powi(-(k % 8));
        let mut draw = || Vector2::new(gauss(&mut rng), gauss(&mut rng)) * small;
        let (p1, p2) = (
            Vector2::new(3.0, 0.0) + draw(),
            Vector2::new(0.0, 3.0) + draw(),
        );
        let got = correct_match(&forward, &p1, &p2, 1.0, 1.0).expect("valid");
        // Least squares distance of two points from a line through the origin: the smaller eigenvalue of their scatter.
        let scatter = p1 * p1.transpose() + p2 * p2.transpose();
        let (mean, half) = (
            0.5 * scatter.trace(),
            0.5 * (scatter[(0, 0)] - scatter[(1, 1)]),
        );
        let least = mean - half.hypot(scatter[(0, 1)]);
        assert!(
            (got.chi_square - least).abs() < 1e-8 * mean,
            "{} {least}",
            got.chi_square
        );
        let parallel = got.first_px.perp(&got.second_px);
        assert!(parallel.abs() < 1e-9 / small, "{parallel} {small}");
        slow += usize::from(got.iterations > 10);
    }
    // The secular equation is at work.
    assert!(slow > 100, "{slow} of {trials}");
}

#[test]
fn equal_corrections_are_refused_and_fulfilled_constraints_kept() {
    // Motion along the optical axis: the constraint asks both pixels onto one line through the centre. Two pixels at a
    // right angle and equal radius move by the same amount to any such line.
    let forward = Matrix3::new(0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    let right = Vector2::new(3.0, 0.0);
    let down = Vector2::new(0.0, 3.0);
    assert!(matches!(
        correct_match(&forward, &right, &down, 1.0, 1.0),
        Err(NoCorrection::AtEpipole { constraint, .. }) if constraint == 9.0
    ));
    let kept = correct_match(&forward, &right, &(right * 2.0), 1.0, 1.0).expect("valid");
    assert_eq!(
        (kept.first_px, kept.second_px, kept.iterations),
        (right, right * 2.0, 0)
    );
    // With unequal noise the noisier pixel goes to the centre: 3^2 / 2^2.
    let unequal = correct_match(&forward, &right, &down, 1.0, 2.0).expect("valid");
    assert!(
        (unequal.chi_square - 2.25).abs() < 1e-12 && unequal.second_px.norm() < 1e-12,
        "{unequal:?}"
    );
    for sigma in [0.0, f64::NAN, -1.0, f64::INFINITY] {
        assert!(correct_match(&forward, &right, &down, sigma, 1.0).is_err());
    }
    assert!(correct_match(&Matrix3::zeros(), &right, &down, 1.0, 1.0).is_err());
    assert!(correct_match(&forward, &Vector2::new(f64::NAN, 0.0), &down, 1.0, 1.0).is_err());
}

#[test]
fn refusals_of_two_views_carry_their_numbers() {
    let target = Vector3::new(0.0, 3.0, 0.0);
    let left = look_at(Vector3::new(-0.5, 0.0, 0.0), Vector3::new(-0.5, 3.0, 0.0));
    let right = look_at(Vector3::new(0.5, 0.0, 0.0), Vector3::new(0.5, 3.0, 0.0));
    let good = [see(&left, &target, 0.5), see(&right, &target, 0.5)];
    let default = Acceptance::default();
    assert!(triangulate_two_views(&pinhole(), &good, &default).is_ok());
    let mut swapped = good;
    swapped[0].pixel_ideal = good[1].pixel_ideal;
    swapped[1].pixel_ideal = good[0].pixel_ideal;
    match triangulate_two_views(&pinhole(), &swapped, &default) {
        Err(Rejection::BehindCamera { depth_m, .. }) => assert!((depth_m + 3.0).abs() < 1e-9),
        other => panic!("{other:?}"),
    }
    let mut wrong = good;
    wrong[1].pixel_ideal.y += 12.0;
    match triangulate_two_views(&pinhole(), &wrong, &default) {
        // Twelve pixels shared between both images: 144 / 2 / 0.25.
        Err(Rejection::ChiSquareTooLarge { chi_square, .. }) => {
            assert!((chi_square - 288.0).abs() < 1.0, "{chi_square}");
        }
        other => panic!("{other:?}"),
    }
    let twice = [good[0], good[0]];
    assert!(matches!(
        triangulate_two_views(
            &pinhole(),
            &twice,
            &Acceptance {
                min_parallax_rad: 0.0,
                ..default
            }
        ),
        Err(Rejection::ParallaxTooSmall { .. })
    ));
    let mut bad = good;
    bad[1].sigma_px = 0.0;
    assert_eq!(
        triangulate_two_views(&pinhole(), &bad, &default),
        Err(Rejection::BadObservation { view: 1, views: 2 })
    );
}
