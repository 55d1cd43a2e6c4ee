//! The double-sphere camera: both directions against each other, special cases that have names, derivatives, the rim.

use mono_geometry::{DoubleSphere, GeometryError};
use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};

/// A ray at an angle off the axis, turned about it.
fn ray(off_axis: f64, about: f64) -> Vector3<f64> {
    Vector3::new(
        off_axis.sin() * about.cos(),
        off_axis.sin() * about.sin(),
        off_axis.cos(),
    )
}

fn camera(xi: f64, alpha: f64) -> DoubleSphere {
    DoubleSphere::new(512, 512, [158.0, 157.0, 255.5, 256.5, xi, alpha]).expect("in range")
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// The pixel of a ray leads back to the ray: rounding grows where the projection flattens, near the rim.
    #[test]
    fn a_pixel_leads_back_to_its_ray(
        xi in -0.4..0.9_f64, alpha in 0.0..0.95_f64, share in 0.0..0.97_f64, about in 0.0..6.2_f64,
        distance in 0.01..100.0_f64,
    ) {
        let camera = camera(xi, alpha);
        let direction = ray(share * camera.field_angle(), about);
        let pixel = camera.project(&(direction * distance)).unwrap();
        let back = camera.unproject(&pixel).unwrap();
        prop_assert!((back.norm() - 1.0).abs() < 1e-14);
        let angle = back.cross(&direction).norm();
        prop_assert!(angle < 1e-10 && back.dot(&direction) > 0.0, "{}", angle);
    }

    /// Central differences of the projection itself, of step 1e-6: their error is below 1e-7 of the largest entry.
    #[test]
    fn derivatives_are_those_of_the_projection(
        xi in -0.4..0.9_f64, alpha in 0.05..0.9_f64, share in 0.05..0.9_f64, about in 0.0..6.2_f64,
    ) {
        let camera = camera(xi, alpha);
        let point = ray(share * camera.field_angle(), about) * 2.0;
        let (pixel, by_point, by_parameters) = camera.project_with_jacobians(&point).unwrap();
        prop_assert_eq!(Some(pixel), camera.project(&point));
        let step = 1e-6;
        for k in 0..3 {
            let mut delta = Vector3::zeros();
            delta[k] = step;
            let ahead = camera.project(&(point + delta)).unwrap();
            let behind = camera.project(&(point - delta)).unwrap();
            let difference = (ahead - behind) / (2.0 * step);
            let error = (difference - by_point.column(k)).norm();
            prop_assert!(error < 1e-6 * by_point.norm(), "{} {}", k, error);
        }
        for k in 0..6 {
            let with = |sign: f64| {
                let mut parameters = camera.parameters();
                parameters[k] += sign * step;
                let moved = DoubleSphere::new(512, 512, parameters).unwrap();
                moved.project(&point).unwrap()
            };
            let difference = (with(1.0) - with(-1.0)) / (2.0 * step);
            let error = (difference - by_parameters.column(k)).norm();
            prop_assert!(error < 1e-6 * by_parameters.norm(), "{} {}", k, error);
        }
    }
}

/// alpha = 0: no second sphere counts and, with xi = 0, no first one: the pinhole.
#[test]
fn without_spheres_it_is_a_pinhole() {
    let camera = camera(0.0, 0.0);
    let pixel = camera.project(&Vector3::new(0.4, -0.6, 2.0)).unwrap();
    let expected = Vector2::new(158.0 * 0.2 + 255.5, 157.0 * -0.3 + 256.5);
    assert!((pixel - expected).norm() < 1e-12);
    assert!((camera.field_angle() - FRAC_PI_2).abs() < 1e-12);
    assert_eq!(camera.project(&Vector3::new(1.0, 0.0, -1e-3)), None);
}

/// xi = 0, alpha = 1/2: the stereographic projection, r = 2 f tan(theta / 2), which sees everything but straight back.
#[test]
fn one_sphere_halfway_is_the_stereographic_projection() {
    let camera = camera(0.0, 0.5);
    for off_axis in [0.1, 1.0, FRAC_PI_2, 2.0, 3.0] {
        let pixel = camera.project(&ray(off_axis, 0.0)).unwrap();
        let expected = 255.5 + 158.0 * 2.0 * (0.5 * off_axis).tan();
        assert!((pixel.x - expected).abs() < 1e-9 * expected, "{off_axis}");
    }
    assert!((camera.field_angle() - PI).abs() < 1e-6);
}

/// The lens of the TUM visual-inertial data set sees 195 degrees; the point is 100 degrees off the axis.
#[test]
fn it_sees_behind_the_image_plane() {
    let camera = DoubleSphere::new(512, 512, [158.3, 158.3, 255.6, 256.9, -0.176, 0.593]).unwrap();
    assert!(camera.field_angle() > 100_f64.to_radians());
    let behind = ray(100_f64.to_radians(), 0.7);
    let pixel = camera.project(&behind).unwrap();
    assert!((camera.unproject(&pixel).unwrap() - behind).norm() < 1e-13);
    // further off the axis is further from the centre
    let nearer = camera.project(&ray(95_f64.to_radians(), 0.7)).unwrap();
    let centre = Vector2::new(255.6, 256.9);
    assert!((pixel - centre).norm() > (nearer - centre).norm());
}

#[test]
fn what_it_does_not_see_is_said() {
    let camera = camera(-0.2, 0.6);
    let beyond = ray(camera.field_angle() + 0.01, 1.0);
    assert_eq!(camera.project(&beyond), None);
    assert_eq!(camera.project(&Vector3::zeros()), None);
    assert_eq!(camera.project(&Vector3::new(f64::NAN, 0.0, 1.0)), None);
    let error = camera.unproject(&Vector2::new(1e4, 256.5)).unwrap_err();
    assert!(matches!(error, GeometryError::NoRay { .. }));
    assert!(
        error
            .to_string()
            .starts_with("normalised pixel (61.6741, 0)"),
        "{error}"
    );
    assert!(camera.unproject(&Vector2::new(f64::NAN, 0.0)).is_err());
    let wrong = DoubleSphere::new(512, 512, [158.0, 157.0, 255.5, 256.5, 0.0, 1.2]).unwrap_err();
    assert_eq!(wrong.to_string(), "alpha is 1.2, required: 0 to 1");
}
