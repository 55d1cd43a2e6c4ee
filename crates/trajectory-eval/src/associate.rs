//! Pairs of poses of two trajectories that belong to the same moment.
//!
//! As `evo` does it: every pose of the shorter trajectory (the estimate when both are
//! equally long) takes the pose of the other one that is nearest in time, the earlier of
//! two equally near ones, and is dropped when that is more than the allowed difference away.

use crate::error::EvaluationError;
use crate::pose::StampedPose;

/// Largest difference in time of two matched poses, seconds.
const MAX_TIME_DIFFERENCE_S: f64 = 0.01;

/// Matched (estimate, reference) pairs in order of time, at most 0.01 s apart; both inputs are ordered by time.
///
/// Time O(short log long).
///
/// # Errors
/// [`EvaluationError::NoMatches`] when there is no pair.
pub fn associate(
    estimate: &[StampedPose],
    reference: &[StampedPose],
) -> Result<Vec<(StampedPose, StampedPose)>, EvaluationError> {
    let estimate_is_shorter = estimate.len() <= reference.len();
    let (short, long) = if estimate_is_shorter {
        (estimate, reference)
    } else {
        (reference, estimate)
    };
    let pairs: Vec<_> = short
        .iter()
        .filter_map(|&pose| {
            let nearest = nearest_in_time(long, pose.t_s)?;
            let close = (nearest.t_s - pose.t_s).abs() <= MAX_TIME_DIFFERENCE_S;
            close.then_some(if estimate_is_shorter {
                (pose, nearest)
            } else {
                (nearest, pose)
            })
        })
        .collect();
    if pairs.is_empty() {
        return Err(no_matches(estimate, reference));
    }
    Ok(pairs)
}

/// The error for two trajectories without a common moment.
pub(crate) fn no_matches(estimate: &[StampedPose], reference: &[StampedPose]) -> EvaluationError {
    EvaluationError::NoMatches {
        estimate: estimate.len(),
        reference: reference.len(),
        max_difference_s: MAX_TIME_DIFFERENCE_S,
    }
}

fn nearest_in_time(poses: &[StampedPose], t_s: f64) -> Option<StampedPose> {
    let after = poses.partition_point(|pose| pose.t_s < t_s);
    let before = after.checked_sub(1).and_then(|index| poses.get(index));
    match (before, poses.get(after)) {
        (Some(before), Some(after)) if t_s - before.t_s <= after.t_s - t_s => Some(*before),
        (_, Some(after)) => Some(*after),
        (before, None) => before.copied(),
    }
}
