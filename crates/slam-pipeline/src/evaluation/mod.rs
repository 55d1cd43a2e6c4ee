//! Errors of an estimated trajectory against a reference, as `evo` computes them.
//!
//! Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems" (IROS 2012), define
//! both measures. Poses are paired by nearest time, the estimate is aligned to the
//! reference (or not), then
//!
//! - absolute trajectory error, pose by pose: `|t_ref - t_est|` and the angle of
//!   `R_ref^T R_est` (for a planar path: the heading difference);
//! - relative pose error over `delta` frames: translation and angle of
//!   `(Q_i^-1 Q_j)^-1 (P_i^-1 P_j)`.
//!
//! Choose the alignment by what the estimate owes: a filter that starts in the reference's
//! first pose is judged with [`Alignment::None`]; aligning hides a wrong first heading, and
//! [`Alignment::Sim3`] hides a wrong scale, the very thing a monocular method must prove.

mod absolute;
mod align;
mod associate;
mod relative;
mod statistics;

pub use absolute::{AbsoluteError, MatchedError, absolute_error};
pub use align::{Alignment, Similarity, align_positions};
pub use associate::{MAX_TIME_DIFFERENCE_S, associate};
pub use relative::{RelativeError, relative_error};
pub use statistics::Statistics;

use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use crate::record::PlanarPose;
use crate::sequence::StampedPose;

/// Why two trajectories cannot be compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EvaluationError {
    /// No two poses lie close enough in time.
    #[error(
        "no pose of the estimate ({estimate} poses) lies within {max_difference_s} s of one of the reference ({reference} poses)"
    )]
    NoMatches {
        /// Poses of the estimate.
        estimate: usize,
        /// Poses of the reference.
        reference: usize,
        /// Largest allowed difference in seconds.
        max_difference_s: f64,
    },
    /// The matched positions do not determine the alignment.
    #[error("the {alignment} alignment is not determined by {poses} matched positions: {reason}")]
    Degenerate {
        /// The alignment asked for.
        alignment: Alignment,
        /// Matched positions.
        poses: usize,
        /// What is wrong with them.
        reason: &'static str,
    },
    /// The matched part is too short for the relative error asked for.
    #[error("a relative error over {delta} frames needs at least {} matched poses, found {poses}", delta.saturating_add(1))]
    TooShort {
        /// Frames between the two ends of a step.
        delta: usize,
        /// Matched poses.
        poses: usize,
    },
}

/// Planar poses as poses in space with height zero.
pub fn spatial(path: &[(f64, PlanarPose)]) -> Vec<StampedPose> {
    path.iter()
        .map(|&(t_s, pose)| StampedPose {
            t_s,
            world_from_frame: Isometry3::from_parts(
                Translation3::new(pose.x, pose.y, 0.0),
                UnitQuaternion::from_euler_angles(0.0, 0.0, pose.phi),
            ),
        })
        .collect()
}
