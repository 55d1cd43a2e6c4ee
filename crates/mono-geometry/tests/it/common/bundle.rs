//! Shared by the tests of the bundle: a short wall run, a sighting, the solved problem, the gauge error.

use mono_geometry::bundle::{BundlePose, Options, PixelObservation, Problem, adjust, covariance};
use mono_geometry::{GeometryError, NoiseShape, RobustLoss};
use nalgebra::Vector2;

use super::wall_run::WallRun;

pub(crate) fn small(seed: u64) -> WallRun {
    WallRun {
        frames: 8,
        landmarks: 60,
        ..WallRun::full(seed)
    }
}

pub(crate) fn observe(
    pose: usize,
    landmark: usize,
    u: f64,
    v: f64,
    sigma_px: f64,
) -> PixelObservation {
    PixelObservation {
        pose,
        landmark,
        pixel_ideal: Vector2::new(u, v),
        sigma_px,
        shape: NoiseShape::ROUND,
    }
}

/// The problem with its solution as the start.
pub(crate) fn solved<P: BundlePose<D>, const D: usize>(
    problem: &Problem<P, D>,
    options: &Options,
) -> (Problem<P, D>, f64) {
    let adjusted = adjust(problem, options).expect("valid");
    assert!(
        adjusted.termination.converged(),
        "{:?}",
        adjusted.termination
    );
    let problem = Problem {
        poses: adjusted.poses,
        landmarks: adjusted.landmarks,
        ..problem.clone()
    };
    (problem, adjusted.cost)
}

pub(crate) fn require_gauge_error<P: BundlePose<D>, const D: usize>(problem: &Problem<P, D>) {
    match covariance(problem, &RobustLoss::None) {
        Err(GeometryError::GaugeFree {
            pose,
            coordinate,
            value,
            required,
        }) => {
            assert!(pose < problem.poses.len() && coordinate < D && value <= required);
        }
        other => panic!("{:?}", other.map(|c| c.joint().diagonal())),
    }
}
