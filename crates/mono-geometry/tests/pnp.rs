//! Perspective-n-point: exact poses of three points, nasty configurations, refinement and its covariance.

mod common;

use common::{config, gauss, look_at, pinhole};
use mono_geometry::linalg::{cholesky, svd};
use mono_geometry::pnp::{
    Correspondence, NoPose, RefineOptions, Termination, estimate_pose, p3p, refine_pose,
};
use mono_geometry::{RobustLoss, Se3, so3};
use nalgebra::{DMatrix, Matrix3, Rotation3, Vector2, Vector3, Vector6};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

fn random_rotation(rng: &mut ChaCha8Rng) -> Rotation3<f64> {
    let q = nalgebra::Quaternion::new(gauss(rng), gauss(rng), gauss(rng), gauss(rng));
    nalgebra::UnitQuaternion::from_quaternion(q).to_rotation_matrix()
}

/// Distance of the nearest solution: rotation angle plus position over `scale`.
fn nearest(truth: &Se3, found: &[Se3], scale: f64) -> f64 {
    found
        .iter()
        .map(|pose| {
            so3::log(&(truth.rotation.inverse() * pose.rotation)).norm()
                + (truth.translation - pose.translation).norm() / scale
        })
        .fold(f64::INFINITY, f64::min)
}

/// Bearings of camera points, and the points in the world.
fn problem(
    world_from_camera: &Se3,
    in_camera: &[Vector3<f64>; 3],
) -> ([Vector3<f64>; 3], [Vector3<f64>; 3]) {
    (
        in_camera.map(|p| p.normalize()),
        in_camera.map(|p| world_from_camera.transform_point(&p)),
    )
}

#[test]
fn a_hundred_thousand_random_triples() {
    let mut rng = ChaCha8Rng::seed_from_u64(2018);
    let trials = 100_000;
    let mut hist = [0usize; 16];
    let mut counts = [0usize; 5];
    for _ in 0..trials {
        let truth = Se3::new(
            random_rotation(&mut rng),
            Vector3::new(gauss(&mut rng), gauss(&mut rng), gauss(&mut rng)),
        );
        let in_camera = [(); 3].map(|()| {
            let depth = uniform(&mut rng, 0.1, 10.0);
            Vector3::new(
                uniform(&mut rng, -1.0, 1.0),
                uniform(&mut rng, -1.0, 1.0),
                1.0,
            ) * depth
        });
        let (rays, points) = problem(&truth, &in_camera);
        let solutions = p3p(&rays, &points);
        counts[solutions.as_slice().len()] += 1;
        let error = nearest(&truth, solutions.as_slice(), 1.0);
        let bin = (-error.log10()).clamp(0.0, 15.0) as usize;
        hist[bin] += 1;
    }
    println!("{hist:?} {counts:?}");
    for fov in [1e-1, 1e-2, 1e-3, 1e-4] {
        let mut hist = [0usize; 16];
        for _ in 0..10000 {
            let truth = Se3::new(
                random_rotation(&mut rng),
                Vector3::new(gauss(&mut rng), gauss(&mut rng), gauss(&mut rng)),
            );
            let depth = 1.0 / fov;
            let in_camera = [(); 3].map(|()| {
                Vector3::new(
                    uniform(&mut rng, -1.0, 1.0),
                    uniform(&mut rng, -1.0, 1.0),
                    depth + uniform(&mut rng, -1.0, 1.0),
                )
            });
            let (rays, points) = problem(&truth, &in_camera);
            let solutions = p3p(&rays, &points);
            let error = nearest(&truth, solutions.as_slice(), depth);
            let bin = (-error.log10()).clamp(0.0, 15.0) as usize;
            hist[bin] += 1;
        }
        println!("{fov} {hist:?}");
    }
}
