//! Absolute trajectory error: pose by pose after alignment.

use crate::align::alignment_of;
use crate::alignment::{Alignment, Similarity};
use crate::associate::associate;
use crate::error::EvaluationError;
use crate::pose::StampedPose;
use crate::statistics::Statistics;

/// Error of one matched pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MatchedError {
    /// Time of the estimate, seconds.
    pub t_s: f64,
    /// Distance between the positions, metres.
    pub translation_m: f64,
    /// Angle between the rotations, radians in [0, pi].
    pub rotation_rad: f64,
}

/// Absolute trajectory error of an estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct AbsoluteError {
    /// Figures of the distances, metres.
    pub translation_m: Statistics,
    /// Figures of the angles, radians; for planar paths the heading.
    pub rotation_rad: Statistics,
    /// Errors of every matched pose in order of time; the last one is the final error.
    pub matched: Vec<MatchedError>,
    /// The alignment that was applied to the estimate.
    pub applied: Similarity,
}

impl AbsoluteError {
    /// Error at the last matched pose.
    pub fn last(&self) -> MatchedError {
        // There is at least one matched pose by construction.
        self.matched[self.matched.len() - 1]
    }
}

/// Compares `estimate` with `reference` after `alignment`.
///
/// # Errors
/// [`EvaluationError`] when no poses match in time or the alignment is not determined.
///
/// ```
/// use trajectory_eval::{Alignment, StampedPose, absolute_error};
///
/// let path = |y: f64| -> Vec<StampedPose> {
///     (0..10).map(|k| StampedPose::planar(0.1 * k as f64, k as f64, y, 0.0)).collect()
/// };
/// // The estimate runs 3 cm beside the reference.
/// let error = absolute_error(&path(0.03), &path(0.0), Alignment::None)?;
/// assert!((error.translation_m.rmse - 0.03).abs() < 1e-12);
/// // A planar alignment removes exactly that.
/// let error = absolute_error(&path(0.03), &path(0.0), Alignment::Se2)?;
/// assert!(error.translation_m.rmse < 1e-12);
/// # Ok::<(), trajectory_eval::EvaluationError>(())
/// ```
pub fn absolute_error(
    estimate: &[StampedPose],
    reference: &[StampedPose],
    alignment: Alignment,
) -> Result<AbsoluteError, EvaluationError> {
    absolute_error_of(&associate(estimate, reference)?, alignment)
}

/// As [`absolute_error`], of (estimate, reference) pairs that are matched already.
///
/// # Errors
/// [`EvaluationError`] when there is no pair or the alignment is not determined.
pub fn absolute_error_of(
    pairs: &[(StampedPose, StampedPose)],
    alignment: Alignment,
) -> Result<AbsoluteError, EvaluationError> {
    let applied = alignment_of(pairs, alignment)?;
    let matched: Vec<MatchedError> = pairs
        .iter()
        .map(|(estimate, reference)| {
            let aligned = applied.apply(&estimate.world_from_frame);
            let reference_pose = reference.world_from_frame;
            MatchedError {
                t_s: estimate.t_s,
                translation_m: (aligned.translation.vector - reference_pose.translation.vector)
                    .norm(),
                rotation_rad: reference_pose.rotation.angle_to(&aligned.rotation),
            }
        })
        .collect();
    let figures = |value: fn(&MatchedError) -> f64| {
        Statistics::of(&matched.iter().map(value).collect::<Vec<_>>())
    };
    let (Some(translation_m), Some(rotation_rad)) =
        (figures(|e| e.translation_m), figures(|e| e.rotation_rad))
    else {
        return Err(EvaluationError::TooShort { delta: 0, poses: 0 });
    };
    Ok(AbsoluteError {
        translation_m,
        rotation_rad,
        matched,
        applied,
    })
}
