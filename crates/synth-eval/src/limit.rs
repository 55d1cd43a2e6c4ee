//! The limit of a filter: the batch solution over the very associations of its run.

use crate::measures::{heading_freed_rmse_m, honesty, path_errors};
use crate::recording::Recording;
use estimation_base::Se2;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};
use slam_batch::{Model, solve};
use slam_pipeline::config::ValidConfig;

/// The batch is dense; beyond this many keyframes it takes minutes.
const MOST_KEYFRAMES: usize = 400;

/// Figures of a batch solution, as those of a [`Row`](crate::row::Row).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Limit {
    /// Root mean square position error without alignment, metres.
    pub(crate) position_rmse_m: f64,
    /// The same with the first heading of the truth freed.
    pub(crate) position_rmse_heading_freed_m: Option<f64>,
    /// Root mean square heading error, radians.
    pub(crate) heading_rmse_rad: f64,
    /// Mean NEES over the frames.
    pub(crate) nees: f64,
    /// Share of the frames in the NEES band.
    pub(crate) nees_inside: f64,
}

/// Solves the batch of a finished run and compares it with the truth; `None` where it is too large or has no solution.
pub(crate) fn limit(
    sightings: &slam_batch::Recording,
    config: &ValidConfig,
    path: &[Se2],
    recording: &Recording,
) -> Option<Limit> {
    if sightings.keyframes().len() > MOST_KEYFRAMES {
        return None;
    }
    let problem = sightings.problem(recording.rig, Model::of(config), path);
    let solution = solve(&problem).ok()?;
    let (mut poses, mut covariances, mut truth): (Vec<Se2>, Vec<Matrix3<f64>>, Vec<Se2>) =
        Default::default();
    for (estimate, known) in sightings.whole_path(&solution).iter().zip(&recording.truth) {
        if let Some(known) = known {
            poses.push(estimate.pose);
            covariances.push(estimate.covariance);
            truth.push(*known);
        }
    }
    let errors = path_errors(&poses, &truth)?;
    let honesty = honesty(&poses, &covariances, &truth);
    Some(Limit {
        position_rmse_m: errors.position_rmse_m,
        position_rmse_heading_freed_m: heading_freed_rmse_m(&poses, &truth),
        heading_rmse_rad: errors.heading_rmse_rad,
        nees: honesty.nees,
        nees_inside: honesty.inside,
    })
}
