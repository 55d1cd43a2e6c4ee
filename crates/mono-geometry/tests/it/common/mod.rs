//! Shared by the tests of several views: the paper's camera, poses by their target, sightings, hard angles.

#[cfg(feature = "bundle")]
pub(crate) mod bundle;
#[cfg(feature = "bundle")]
pub(crate) mod long_chain;
#[cfg(feature = "bundle")]
pub(crate) mod wall_run;

use std::f64::consts::{FRAC_PI_2, PI};

use mono_geometry::triangulation::Observation;
use mono_geometry::{NoiseShape, Pinhole, Se3, so3};
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use proptest::test_runner::Config;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// The camera of the paper, Table I.
pub(crate) fn pinhole() -> Pinhole {
    Pinhole {
        width: 320,
        height: 240,
        fx: 368.826_20,
        fy: 369.902_39,
        cx: 159.670_29,
        cy: 121.541_36,
    }
}

pub(crate) fn config(cases: u32) -> Config {
    Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    }
}

pub(crate) fn gauss(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Camera at `position` looking at `target`, its y axis as far down (world -z) as possible.
pub(crate) fn look_at(position: Vector3<f64>, target: Vector3<f64>) -> Se3 {
    let z = (target - position).normalize();
    let x = z.cross(&Vector3::z()).normalize();
    let y = z.cross(&x);
    let rotation =
        so3::rotation_from_matrix(&Matrix3::from_columns(&[x, y, z])).expect("orthonormal");
    Se3::new(rotation, position)
}

pub(crate) fn see(world_from_camera: &Se3, point: &Vector3<f64>, sigma_px: f64) -> Observation {
    let camera_from_world = world_from_camera.inverse();
    let pixel_ideal = pinhole()
        .project(&camera_from_world.transform_point(point))
        .expect("in front");
    Observation {
        camera_from_world,
        pixel_ideal,
        sigma_px,
        shape: NoiseShape::ROUND,
    }
}

/// Angles that break naive formulas, and ordinary ones.
pub(crate) fn nasty_angle() -> impl Strategy<Value = f64> {
    prop_oneof![
        Just(0.0),
        Just(1e-300),
        Just(1e-12),
        Just(-1e-8),
        Just(1e-4),
        Just(0.5),
        Just(1.0),
        Just(2.0),
        Just(PI),
        Just(-PI),
        Just(PI - 1e-9),
        Just(-PI + 1e-9),
        Just(FRAC_PI_2),
        -PI..PI,
    ]
}

/// Rotation vectors about the axes and others, of such angles.
pub(crate) fn rotation_vector() -> impl Strategy<Value = Vector3<f64>> {
    let axis = prop_oneof![
        Just(Vector3::x()),
        Just(Vector3::new(0.0, -1.0, 0.0)),
        Just(Vector3::z()),
        (-1.0..1.0_f64, -1.0..1.0_f64, 0.1..1.0_f64)
            .prop_map(|(x, y, z)| Vector3::new(x, y, z).normalize()),
    ];
    (axis, nasty_angle()).prop_map(|(axis, angle)| axis * angle)
}
