//! Landmark forms: projection, Jacobian, point conversion, refocusing.

use crate::filter::landmark::{Landmark, LandmarkGeometry, PointEstimate};
use crate::filter::pose::PlacedCamera;
use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};
use ukf::{SigmaPoints, unscented_transform};

use super::common::*;

#[test]
fn known_point_projects_where_the_drawing_says() {
    // Body at (1, 2) heading along world y; the camera looks to its left, along world -x.
    let mut at = pose(1.0, 2.0, core::f64::consts::FRAC_PI_2);
    at.centre.z = 0.1;
    // Two metres ahead of the camera, 0.5 m to its right, 0.3 m above it.
    let p = Vector3::new(-1.0, 2.5, 0.4);
    let seen = project(&place(&at), &LandmarkGeometry::new(None), &p);
    let k = pinhole();
    let drawn = Vector2::new(k.cx + k.fx * 0.25, k.cy - k.fy * 0.15);
    assert!((seen - drawn).norm() < 1e-10, "{seen} {drawn}");
    let behind = Vector3::new(3.0, 2.5, 0.4);
    assert!(
        lens()
            .project(&place(&at), &LandmarkGeometry::new(None).ray(&behind))
            .is_none()
    );
}

#[test]
fn both_forms_of_a_landmark_project_alike() {
    let mut rng = rng(1);
    for _ in 0..500 {
        let from = random_pose(&mut rng);
        let anchor = place(&from);
        let camera = place(&near(&mut rng, &from));
        let (a, b) = (uniform(&mut rng, -0.3, 0.3), uniform(&mut rng, -0.3, 0.3));
        let depth = uniform(&mut rng, 1.0, 20.0);
        let p = ahead(&anchor, a, b, depth);
        let anchored = LandmarkGeometry::new(Some(&anchor));
        let by_depth = project(&camera, &anchored, &Vector3::new(a, b, 1.0 / depth));
        let by_point = project(&camera, &LandmarkGeometry::new(None), &p);
        let textbook = pixel_of(&camera, &p);
        // Pixels of some hundred, a few roundings each.
        assert!((by_depth - textbook).norm() < 1e-10);
        assert!((by_point - textbook).norm() < 1e-10);
    }
}

#[test]
fn parameter_jacobian_is_the_central_difference() {
    let mut rng = rng(2);
    for case in 0..500 {
        let from = random_pose(&mut rng);
        let anchor = place(&from);
        let camera = place(&near(&mut rng, &from));
        let (a, b) = (uniform(&mut rng, -0.3, 0.3), uniform(&mut rng, -0.3, 0.3));
        // Every fifth landmark at infinity.
        let rho = if case % 5 == 0 {
            0.0
        } else {
            uniform(&mut rng, 0.0, 0.8)
        };
        let (geometry, mean) = if case % 2 == 0 {
            (
                LandmarkGeometry::new(Some(&anchor)),
                Vector3::new(a, b, rho),
            )
        } else {
            (
                LandmarkGeometry::new(None),
                ahead(&anchor, a, b, 1.0 / (rho + 0.1)),
            )
        };
        let analytic = lens()
            .parameter_jacobian(&camera, &geometry, &mean)
            .unwrap();
        const H: f64 = 1e-6;
        let mut numeric = Matrix2x3::zeros();
        for j in 0..3 {
            let mut step = Vector3::zeros();
            step[j] = H;
            let difference = project(&camera, &geometry, &(mean + step))
                - project(&camera, &geometry, &(mean - step));
            numeric.set_column(j, &(difference / (2.0 * H)));
        }
        // Rounding of pixels of size 500 over 2 H: 500 eps / 1e-6 = 1e-7; truncation is below.
        let error = (analytic - numeric).norm();
        assert!(
            error < 1e-6 * (1.0 + analytic.norm()),
            "case {case}: {error:e}"
        );
    }
}

#[test]
fn point_covariance_is_that_of_sigma_points() {
    let mut rng = rng(3);
    for _ in 0..100 {
        let from = random_pose(&mut rng);
        let anchor = place(&from);
        let mean = Vector3::new(
            uniform(&mut rng, -0.4, 0.4),
            uniform(&mut rng, -0.4, 0.4),
            uniform(&mut rng, 0.1, 1.0),
        );
        // Correlated, a thousandth of the mean: curvature is of order 1e-6.
        let factor = Matrix3::new(
            1e-3,
            0.0,
            0.0,
            4e-4,
            9e-4,
            0.0,
            3e-4 * mean.z,
            -5e-4 * mean.z,
            8e-4 * mean.z,
        );
        let covariance = factor * factor.transpose();
        let PointEstimate {
            position: world,
            covariance: stated,
        } = inverse_depth(mean, covariance)
            .to_point(Some(&anchor))
            .unwrap();
        assert!((world - ahead(&anchor, mean.x, mean.y, 1.0 / mean.z)).norm() < 1e-12);
        let moments = unscented_transform(
            &mean,
            &covariance,
            &SigmaPoints::default(),
            |m: &Vector3<f64>| ahead(&anchor, m.x, m.y, 1.0 / m.z),
        )
        .unwrap();
        let error = (stated - moments.covariance).norm();
        assert!(
            error < 1e-5 * stated.norm(),
            "{error:e} of {:e}",
            stated.norm()
        );
    }
    let camera = place(&pose(0.0, 0.0, 0.0));
    for rho in [0.0, -0.1] {
        let landmark = inverse_depth(Vector3::new(0.0, 0.0, rho), Matrix3::identity());
        assert!(landmark.to_point(Some(&camera)).is_none(), "rho = {rho}");
    }
}

/// The inverse depth in [0, highest] that projects nearest to `pixel`, by trying all.
fn nearest_by_search(
    camera: &PlacedCamera,
    geometry: &LandmarkGeometry,
    mean: &Vector3<f64>,
    pixel: &Vector2<f64>,
    highest: f64,
) -> Option<f64> {
    const STEPS: usize = 4000;
    (0..=STEPS)
        .filter_map(|i| {
            let rho = highest * i as f64 / STEPS as f64;
            let ray = geometry.ray(&Vector3::new(mean.x, mean.y, rho));
            lens().project(camera, &ray).map(|p| (p - pixel).norm())
        })
        .min_by(f64::total_cmp)
}

#[test]
fn refocus_projects_nearest_to_the_pixel() {
    let mut rng = rng(4);
    let (mut inside, mut clamped) = (0, 0);
    for case in 0..600 {
        let from = random_pose(&mut rng);
        let anchor = place(&from);
        let camera = place(&near(&mut rng, &from));
        let geometry = LandmarkGeometry::new(Some(&anchor));
        let highest = uniform(&mut rng, 0.5, 4.0);
        let mean = Vector3::new(
            uniform(&mut rng, -0.3, 0.3),
            uniform(&mut rng, -0.3, 0.3),
            0.5 * highest,
        );
        if lens().project(&camera, &geometry.ray(&mean)).is_none() {
            continue;
        }
        // Some pixels near the line, some anywhere, beyond the epipole and both ends too.
        let on_line = Vector3::new(mean.x, mean.y, uniform(&mut rng, -0.5, 1.5) * highest);
        let pixel = match lens().project(&camera, &geometry.ray(&on_line)) {
            Some(p) if case % 3 > 0 => p + Vector2::new(normal(&mut rng), normal(&mut rng)),
            _ => Vector2::new(uniform(&mut rng, 0.0, 320.0), uniform(&mut rng, 0.0, 240.0)),
        };
        let refocused = lens().refocus(&camera, &geometry, &mean, &pixel, highest);
        assert_eq!(refocused.xy(), mean.xy());
        assert!(
            (0.0..=highest).contains(&refocused.z),
            "case {case}: {}",
            refocused.z
        );
        let at = project(&camera, &geometry, &refocused);
        let best = nearest_by_search(&camera, &geometry, &mean, &pixel, highest).unwrap();
        let distance = (at - pixel).norm();
        assert!(
            distance <= best + 1e-6,
            "case {case}: rho {} of {highest} lies {distance} px away, the best {best} px",
            refocused.z
        );
        if refocused.z > 0.0 && refocused.z < highest {
            inside += 1;
        } else {
            clamped += 1;
        }
    }
    assert!(
        inside > 100 && clamped > 100,
        "{inside} inside, {clamped} at an end"
    );
}

#[test]
fn refocus_leaves_what_has_no_line() {
    let at = place(&pose(0.0, 0.0, 0.0));
    let mean = Vector3::new(0.1, -0.1, 0.5);
    let pixel = Vector2::new(10.0, 20.0);
    // No baseline, and a point.
    let geometry = LandmarkGeometry::new(Some(&at));
    assert_eq!(lens().refocus(&at, &geometry, &mean, &pixel, 2.0), mean);
    let p = ahead(&at, 0.1, 0.1, 3.0);
    assert_eq!(
        lens().refocus(&at, &LandmarkGeometry::new(None), &p, &pixel, 2.0),
        p
    );
}

#[test]
fn unknown_depth_lies_beyond_what_was_driven() {
    let anchor = place(&pose(0.0, 0.0, 0.0));
    let geometry = LandmarkGeometry::new(Some(&anchor));
    let landmark =
        Landmark::from_first_sighting(&lens(), 0, &Vector2::new(100.0, 50.0), 0.5, OPEN_DEPTH);
    // The camera looks along world y: two metres towards the landmark.
    let driven = landmark.in_front_of(&geometry, &Vector3::new(0.3, 2.0, 0.0));
    assert!(
        (driven.mean.z * 2.0 - 0.3).abs() < 1e-12,
        "rho {}",
        driven.mean.z
    );
    assert!((driven.depth_openness() - landmark.depth_openness()).abs() < 1e-12);
    assert_eq!(driven.mean.xy(), landmark.mean.xy());
    assert_eq!(driven.covariance[(0, 0)], landmark.covariance[(0, 0)]);
    // Visible from there with all of its two-sigma range, which the prior is not.
    let far = |l: &Landmark| l.mean.z + 2.0 * l.covariance[(2, 2)].sqrt();
    assert!(far(&driven) * 2.0 < 1.0 && far(&landmark) * 2.0 > 1.0);
    for aside in [
        Vector3::new(3.0, 0.0, 0.0),
        Vector3::new(0.0, -2.0, 0.0),
        Vector3::new(0.0, 0.1, 0.0),
    ] {
        assert_eq!(landmark.in_front_of(&geometry, &aside), landmark);
    }
}
