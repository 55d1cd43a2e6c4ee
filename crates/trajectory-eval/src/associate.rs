//! Pairs of poses of two trajectories that belong to the same moment.
//!
//! As `evo` does it: every pose of the shorter trajectory (the estimate when both are
//! equally long) takes the pose of the other one that is nearest in time, the earlier of
//! two equally near ones, the first of several with one stamp, and is dropped when that is more than the allowed
//! difference away.

use crate::error::EvaluationError;
use crate::pose::StampedPose;

/// How poses are paired by their times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matching {
    /// Largest difference in time of two matched poses, seconds.
    pub max_difference_s: f64,
    /// Added to the times of the estimate before they are compared, seconds.
    pub offset_s: f64,
}

impl Default for Matching {
    /// 0.01 s and no offset, as `evo`.
    fn default() -> Self {
        Matching {
            max_difference_s: 0.01,
            offset_s: 0.0,
        }
    }
}

impl Matching {
    /// Matched (estimate, reference) pairs in order of time; both inputs are ordered by time, stamps may repeat.
    ///
    /// Time O(short log long).
    ///
    /// # Errors
    /// [`EvaluationError::NoMatches`] when there is no pair.
    pub fn pairs(
        &self,
        estimate: &[StampedPose],
        reference: &[StampedPose],
    ) -> Result<Vec<(StampedPose, StampedPose)>, EvaluationError> {
        let estimate_is_shorter = estimate.len() <= reference.len();
        // Times of the longer list plus `offset_s` are compared with those of the shorter one.
        let (short, long, offset_s) = if estimate_is_shorter {
            (estimate, reference, -self.offset_s)
        } else {
            (reference, estimate, self.offset_s)
        };
        let mut least_s = f64::INFINITY;
        let mut pairs = Vec::new();
        for &pose in short {
            let Some(nearest) = nearest_in_time(long, pose.t_s, offset_s) else {
                continue;
            };
            let difference = (nearest.t_s + offset_s - pose.t_s).abs();
            least_s = least_s.min(difference);
            if difference <= self.max_difference_s {
                pairs.push(if estimate_is_shorter {
                    (pose, nearest)
                } else {
                    (nearest, pose)
                });
            }
        }
        if pairs.is_empty() {
            return Err(EvaluationError::NoMatches {
                estimate: estimate.len(),
                reference: reference.len(),
                estimate_s: span(estimate),
                reference_s: span(reference),
                max_difference_s: self.max_difference_s,
                least_difference_s: least_s,
            });
        }
        Ok(pairs)
    }
}

/// [`Matching::pairs`] with the default matching: at most 0.01 s apart.
///
/// # Errors
/// [`EvaluationError::NoMatches`] when there is no pair.
pub fn associate(
    estimate: &[StampedPose],
    reference: &[StampedPose],
) -> Result<Vec<(StampedPose, StampedPose)>, EvaluationError> {
    Matching::default().pairs(estimate, reference)
}

/// First and last time, seconds; NaN for no pose.
fn span(poses: &[StampedPose]) -> [f64; 2] {
    let time = |pose: Option<&StampedPose>| pose.map_or(f64::NAN, |pose| pose.t_s);
    [time(poses.first()), time(poses.last())]
}

fn nearest_in_time(poses: &[StampedPose], t_s: f64, offset_s: f64) -> Option<StampedPose> {
    let time = |pose: &StampedPose| pose.t_s + offset_s;
    let after = poses.partition_point(|pose| time(pose) < t_s);
    let before = after.checked_sub(1).and_then(|index| poses.get(index));
    match (before, poses.get(after)) {
        (Some(before), Some(after)) if t_s - time(before) <= time(after) - t_s => {
            first_of_stamp(poses, before.t_s)
        }
        (_, Some(after)) => Some(*after),
        (Some(before), None) => first_of_stamp(poses, before.t_s),
        (None, None) => None,
    }
}

/// The first of the poses with one stamp.
fn first_of_stamp(poses: &[StampedPose], t_s: f64) -> Option<StampedPose> {
    poses
        .get(poses.partition_point(|pose| pose.t_s < t_s))
        .copied()
}
