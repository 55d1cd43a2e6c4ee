//! Cameras: pixel by point and by parameters. The naive formula is written out below in dual numbers.

use mono_geometry::{Camera, Distortion, Pinhole};
use nalgebra::{DVector, Vector2, Vector3};
use proptest::prelude::*;

use super::dual::Dual;
use crate::common::config;

fn pinhole() -> Pinhole {
    Pinhole {
        width: 640,
        height: 480,
        fx: 458.654,
        fy: 457.296,
        cx: 367.215,
        cy: 248.375,
    }
}

fn lenses() -> Vec<Distortion> {
    let fisheye = |k1, k2, k3, k4| Distortion::KannalaBrandt { k1, k2, k3, k4 };
    let radtan = |k1, k2, p1, p2, k3| Distortion::Radtan { k1, k2, p1, p2, k3 };
    vec![
        Distortion::None,
        radtan(-0.2834, 0.0739, 1.9e-4, 1.8e-5, 0.0),
        radtan(0.12, -0.25, -2e-3, 1e-3, 0.11),
        radtan(0.0, 0.0, 0.0, 0.0, 0.0),
        // A rational lens of a depth camera's order of magnitude, and one with a pole at r = 2.
        Distortion::Rational {
            k1: 0.45,
            k2: -2.4,
            p1: 9e-4,
            p2: -2e-4,
            k3: 1.4,
            k4: 0.33,
            k5: -2.2,
            k6: 1.35,
        },
        Distortion::Rational {
            k1: 0.1,
            k2: 0.02,
            p1: -1e-3,
            p2: 2e-3,
            k3: 0.0,
            k4: -0.25,
            k5: 0.0,
            k6: 0.0,
        },
        fisheye(0.0, 0.0, 0.0, 0.0),
        fisheye(-0.0137, 0.0207, -0.0127, 0.0025),
        fisheye(0.05, -0.03, 0.01, -0.002),
    ]
}

/// Pixel of a point, from the text of the models; `q` are the camera's parameters.
fn naive(lens: &Distortion, q: &[Dual], point: &[Dual]) -> [Dual; 2] {
    let one = Dual::constant(1.0);
    let (x, y) = (point[0] / point[2], point[1] / point[2]);
    let s = x * x + y * y;
    let k = &q[4..];
    let brown = |gain: Dual| {
        let (p1, p2) = (k[2], k[3]);
        [
            gain * x + p1 * x * y * 2.0 + p2 * (s + x * x * 2.0),
            gain * y + p1 * (s + y * y * 2.0) + p2 * x * y * 2.0,
        ]
    };
    let bent = match lens {
        Distortion::None => [x, y],
        Distortion::Radtan { .. } => brown(one + k[0] * s + k[1] * s * s + k[4] * s * s * s),
        Distortion::Rational { .. } => brown(
            (one + k[0] * s + k[1] * s * s + k[4] * s * s * s)
                / (one + k[5] * s + k[6] * s * s + k[7] * s * s * s),
        ),
        Distortion::KannalaBrandt { .. } if s.value == 0.0 => [x, y],
        Distortion::KannalaBrandt { .. } => {
            let r = s.sqrt();
            let theta = r.atan();
            let t = theta * theta;
            let bent =
                theta * (one + k[0] * t + k[1] * t * t + k[2] * t * t * t + k[3] * t * t * t * t);
            [bent / r * x, bent / r * y]
        }
    };
    [q[0] * bent[0] + q[2], q[1] * bent[1] + q[3]]
}

/// `before_edge` is the relative distance to the edge of the field, 1 far from it: next to a pole the denominator has
/// lost that share of its digits, whatever the formula, and differences are taken across the edge.
fn check(camera: &Camera, point: &Vector3<f64>, before_edge: f64) {
    let lens = camera.distortion();
    let depth = point.z;
    let (pixel, by_point, by_parameters) = camera.project_with_jacobians(point).expect("seen");
    let (again, alone) = camera.project_with_jacobian(point).expect("seen");
    assert_eq!((pixel, by_point), (again, alone));
    assert_eq!(Some(pixel), camera.project(point));

    let q = camera.parameters();
    let constants = Dual::seeded(q.as_slice(), usize::MAX);
    let context = format!("{lens:?} {point}");
    // Rounding: a few epsilon of the largest term.
    let size = 1.0 + by_point.amax() * depth + by_parameters.amax();
    let rounding = 1e-13 * size / before_edge;
    for j in 0..3 {
        let dual = naive(lens, &constants, &Dual::seeded(point.as_slice(), j));
        for i in 0..2 {
            assert!(
                (pixel[i] - dual[i].value).abs() < rounding + 1e-11,
                "{context}"
            );
            let error = (by_point[(i, j)] - dual[i].slope).abs() * depth;
            assert!(
                error < rounding,
                "{context}: point {i} {j} {error} of {size}"
            );
        }
        if before_edge < 1e-2 {
            continue;
        }
        let step = 1e-5 * depth;
        let shifted = |sign: f64| {
            let mut moved = *point;
            moved[j] += sign * step;
            camera.project(&moved)
        };
        if let (Some(plus), Some(minus)) = (shifted(1.0), shifted(-1.0)) {
            let error = ((plus - minus) / (2.0 * step) - by_point.column(j)).amax() * depth;
            assert!(
                error < 1e-6 * size,
                "{context}: difference {j} {error} of {size}"
            );
        }
    }
    let still = Dual::seeded(point.as_slice(), usize::MAX);
    for j in 0..12 {
        if j >= camera.parameter_count() {
            assert_eq!(by_parameters.column(j).amax(), 0.0);
            continue;
        }
        let dual = naive(lens, &Dual::seeded(q.as_slice(), j), &still);
        for i in 0..2 {
            let error = (by_parameters[(i, j)] - dual[i].slope).abs();
            assert!(
                error < rounding,
                "{context}: parameter {i} {j} {error} of {size}"
            );
        }
        if before_edge < 1e-2 {
            continue;
        }
        let step = 1e-6 * (1.0 + q[j].abs());
        let shifted = |sign: f64| {
            let mut moved: DVector<f64> = q.clone();
            moved[j] += sign * step;
            let other = camera.with_parameters(moved.as_slice()).expect("legal");
            other.project(point)
        };
        if let (Some(plus), Some(minus)) = (shifted(1.0), shifted(-1.0)) {
            let error = ((plus - minus) / (2.0 * step) - by_parameters.column(j)).amax();
            assert!(
                error < 1e-6 * size * (1.0 + size / 1e3),
                "{context}: {j} {error} of {size}"
            );
        }
    }
}

proptest! {
    #![proptest_config(config(200))]

    #[test]
    fn at_random(x in -0.8..0.8_f64, y in -0.6..0.6_f64, depth in prop_oneof![Just(0.01), Just(1e3), 0.1..50.0_f64]) {
        for lens in lenses() {
            let camera = Camera::new(pinhole(), lens).unwrap();
            let slope = Vector2::new(x, y);
            if slope.norm() < 0.95 * camera.field_radius() {
                check(&camera, &(slope.push(1.0) * depth), 1.0);
            }
        }
    }
}

#[test]
fn at_nasty_places() {
    for lens in lenses() {
        let camera = Camera::new(pinhole(), lens).unwrap();
        // The axis exactly, around the switches of the series, tiny offsets of either sign.
        for offset in [0.0, 1e-300, 1e-160, 1e-12, 1e-8, 0.999e-4, 1.001e-4, 1e-3] {
            for (a, b) in [(1.0, 0.0), (0.0, -1.0), (0.6, -0.8)] {
                check(&camera, &Vector3::new(a * offset, b * offset, 1.0), 1.0);
                check(
                    &camera,
                    &(Vector3::new(a * offset, b * offset, 1.0) * 1e-6),
                    1.0,
                );
            }
        }
        // The corners of the image, where they have a ray.
        for (u, v) in [(-0.5, -0.5), (639.5, -0.5), (-0.5, 479.5), (639.5, 479.5)] {
            if let Ok(ray) = camera.unproject(&Vector2::new(u, v)) {
                check(&camera, &(ray * 2.0), 1.0);
            }
        }
        // Close before the fold (or the pole), and far out where there is none.
        let edge = camera.field_radius().min(5.0);
        for before_edge in [0.1, 1e-3, 1e-6] {
            let slope = Vector2::new(0.6, -0.8) * (edge * (1.0 - before_edge));
            check(&camera, &slope.push(1.0), before_edge);
        }
    }
}

#[test]
fn parameters_go_round_and_are_named() {
    for lens in lenses() {
        let camera = Camera::new(pinhole(), lens).unwrap();
        let q = camera.parameters();
        assert_eq!(camera.with_parameters(q.as_slice()), Ok(camera));
        assert_eq!(camera.parameter_names().len(), q.len());
        assert_eq!(camera.parameter_count(), q.len());
        assert!(camera.with_parameters(&q.as_slice()[1..]).is_err());
        assert!(camera.with_parameters(&[]).is_err());
        let mut bad = q.clone();
        bad[0] = -1.0;
        assert!(camera.with_parameters(bad.as_slice()).is_err());
        let last = q.len() - 1;
        let mut bad = q;
        bad[last] = f64::NAN;
        assert!(camera.with_parameters(bad.as_slice()).is_err());
    }
    let rational = Camera::new(pinhole(), lenses()[4]).unwrap();
    let names = [
        "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6",
    ];
    assert_eq!(rational.parameter_names(), names);
    assert_eq!(rational.parameters()[7], -2e-4);
}
