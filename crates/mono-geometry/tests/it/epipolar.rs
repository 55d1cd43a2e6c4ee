//! Epipolar geometry: closed forms, exact matches, the distribution of the Sampson distance, no baseline.

use crate::common::{config, gauss, look_at, pinhole, see};
use mono_geometry::epipolar::{
    Correspondence, EpipolarPair, SampsonScorer, essential, fundamental,
};
use mono_geometry::linalg::svd3;
use mono_geometry::ransac::Scorer;
use mono_geometry::{Se3, so3};
use nalgebra::{Vector2, Vector3, Vector6};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

proptest! {
    #![proptest_config(config(300))]

    #[test]
    fn exact_matches_satisfy_the_epipolar_constraint(
        x in -0.5..0.5_f64, y in -0.4..0.4_f64, depth in 1.0..10.0_f64,
        t in (-0.3..0.3_f64, -0.3..0.3_f64, -0.3..0.3_f64), w in (-0.1..0.1_f64, -0.1..0.1_f64, -0.1..0.1_f64),
    ) {
        let first = look_at(Vector3::new(1.0, 2.0, 0.5), Vector3::new(1.0, 5.0, 0.5));
        let second = first.compose(&Se3::exp(&Vector6::new(t.0, t.1, t.2, w.0, w.1, w.2)));
        prop_assume!((first.translation - second.translation).norm() > 0.01);
        let world = first.transform_point(&(Vector3::new(x, y, 1.0) * depth));
        let in_second = second.inverse().transform_point(&world);
        prop_assume!(in_second.z > 0.3);
        let p1 = pinhole().project(&first.inverse().transform_point(&world)).unwrap();
        let p2 = pinhole().project(&in_second).unwrap();
        let pair = EpipolarPair::new(&pinhole(), &first, &second).unwrap();
        let sampson = pair.sampson(&p1, &p2, 1.0, 1.0).unwrap();
        prop_assert!(sampson.distance_px.abs() < 1e-8);
        prop_assert!((sampson.sigma_px - 1.0).abs() < 1e-12);
        // Off by d along the normal of its line: the distance to the line is d, Sampson's at most that.
        let line = pair.line_in_second(&p1).unwrap();
        let off = p2 + line.xy() * 0.25;
        prop_assert!((line.dot(&off.push(1.0)) - 0.25).abs() < 1e-8);
        prop_assert!(pair.sampson(&p1, &off, 1.0, 1.0).unwrap().distance_px.abs() <= 0.25 + 1e-8);
        prop_assert!(pair.symmetric_distance_px(&p1, &off).unwrap() >= 0.25 - 1e-8);
        // RANSAC's scorer measures the same.
        let s = pair.sampson(&p1, &off, 0.5, 0.5).unwrap();
        let expected = (s.distance_px / s.sigma_px).powi(2);
        let datum = Correspondence { first: p1, second: off };
        let scored = SampsonScorer::pixels(0.5).squared_residual(pair.fundamental(), &datum);
        prop_assert!((scored - expected).abs() < 1e-6 * expected, "{scored} {expected}");
        let narrow = datum.normalized(&pinhole());
        let pixel_from_normalized = nalgebra::Matrix3::new(
            pinhole().fx, 0.0, pinhole().cx, 0.0, pinhole().fy, pinhole().cy, 0.0, 0.0, 1.0,
        );
        let matrix = pixel_from_normalized.transpose() * pair.fundamental() * pixel_from_normalized;
        let scored = SampsonScorer::normalized(&pinhole(), 0.5).squared_residual(&matrix, &narrow);
        prop_assert!((scored - expected).abs() < 1e-6 * expected, "{scored} {expected}");
        // Swapping the views changes nothing.
        let back = EpipolarPair::new(&pinhole(), &second, &first).unwrap();
        let swapped = back.symmetric_distance_px(&off, &p1).unwrap();
        prop_assert!((swapped - pair.symmetric_distance_px(&p1, &off).unwrap()).abs() < 1e-8);
    }
}

#[test]
fn essential_matrix_closed_form() {
    // A step to the right: lines are image rows. E = [x]x.
    let right = Se3::new(so3::exp(&Vector3::zeros()), Vector3::new(-0.3, 0.0, 0.0));
    assert_eq!(essential(&right).unwrap(), so3::hat(&-Vector3::x()));
    let pair = EpipolarPair::new(&pinhole(), &Se3::identity(), &right.inverse()).unwrap();
    let line = pair.line_in_second(&Vector2::new(100.0, 50.0)).unwrap();
    assert!(line.x.abs() < 1e-15 && (line.z / line.y + 50.0).abs() < 1e-12);
    let motion = Se3::exp(&Vector6::new(0.3, -0.1, 0.2, 0.5, 0.2, -0.7));
    let s = svd3(&essential(&motion).unwrap()).unwrap().singular_values;
    assert!((s - Vector3::new(1.0, 1.0, 0.0)).amax() < 1e-15 * 8.0);
    // A pure step forward: the epipole, the focus of expansion, is the principal point and has no line.
    let forward = Se3::new(so3::exp(&Vector3::zeros()), Vector3::new(0.0, 0.0, -0.5));
    let centre = Vector2::new(pinhole().cx, pinhole().cy);
    let mut exact = pinhole();
    (exact.cx, exact.cy) = (160.0, 120.0);
    let pair = EpipolarPair::new(&exact, &Se3::identity(), &forward.inverse()).unwrap();
    assert!(pair.line_in_second(&Vector2::new(160.0, 120.0)).is_none());
    assert!(
        pair.sampson(
            &Vector2::new(160.0, 120.0),
            &Vector2::new(160.0, 120.0),
            1.0,
            1.0
        )
        .is_none()
    );
    assert!(pair.line_in_second(&centre).is_some());
    assert!((pair.baseline_m() - 0.5).abs() < 1e-15);
}

#[test]
fn without_baseline_there_is_no_constraint() {
    let camera = look_at(
        Vector3::new(100.0, 50.0, 0.3),
        Vector3::new(101.0, 50.0, 0.3),
    );
    let turned = camera.compose(&Se3::exp(&Vector6::new(0.0, 0.0, 0.0, 0.1, 0.2, 0.3)));
    assert!(EpipolarPair::new(&pinhole(), &camera, &turned).is_none());
    let mut rounded = turned;
    rounded.translation.x += 2.0 * f64::EPSILON * 100.0;
    assert!(EpipolarPair::new(&pinhole(), &camera, &rounded).is_none());
    let mut nan = turned;
    nan.translation.x = f64::NAN;
    assert!(EpipolarPair::new(&pinhole(), &camera, &nan).is_none());
    assert!(essential(&Se3::identity()).is_none());
    assert!(fundamental(&pinhole(), &Se3::identity()).is_none());
}

#[test]
fn sampson_over_sigma_is_standard_normal() {
    let target = Vector3::new(0.3, 3.0, 0.2);
    let first = look_at(Vector3::zeros(), Vector3::new(0.0, 3.0, 0.0));
    let second = look_at(Vector3::new(0.4, 0.2, 0.05), Vector3::new(0.1, 3.0, 0.0));
    let pair = EpipolarPair::new(&pinhole(), &first, &second).unwrap();
    let (p1, p2) = (
        see(&first, &target, 1.0).pixel_ideal,
        see(&second, &target, 1.0).pixel_ideal,
    );
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let trials = 20_000;
    let (sigma1, sigma2) = (0.3, 1.2);
    let mut squares = 0.0;
    let mut sum = 0.0;
    for _ in 0..trials {
        let a = p1 + Vector2::new(gauss(&mut rng), gauss(&mut rng)) * sigma1;
        let b = p2 + Vector2::new(gauss(&mut rng), gauss(&mut rng)) * sigma2;
        let s = pair.sampson(&a, &b, sigma1, sigma2).unwrap();
        let whitened = s.distance_px / s.sigma_px;
        sum += whitened;
        squares += whitened * whitened;
    }
    let count = f64::from(trials);
    assert!((sum / count).abs() < 4.5 / count.sqrt());
    assert!(
        (squares / count - 1.0).abs() < 4.5 * (2.0 / count).sqrt() + 1e-3,
        "{}",
        squares / count
    );
}
