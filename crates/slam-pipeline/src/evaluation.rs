//! Planar paths as the trajectories that `trajectory-eval` compares.

pub use trajectory_eval::{
    AbsoluteError, Alignment, EvaluationError, RelativeError, Statistics, absolute_error,
    associate, relative_error,
};

use crate::record::PlanarPose;
use trajectory_eval::StampedPose;

/// Planar poses as poses in space with height zero.
pub fn spatial(path: &[(f64, PlanarPose)]) -> Vec<StampedPose> {
    path.iter()
        .map(|&(t_s, pose)| StampedPose::planar(t_s, pose.x, pose.y, pose.phi))
        .collect()
}
