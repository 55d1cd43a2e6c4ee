//! Relative pose error: drift over a fixed number of frames.

use crate::align::alignment_of;
use crate::alignment::Alignment;
use crate::associate::associate;
use crate::error::EvaluationError;
use crate::pose::StampedPose;
use crate::statistics::Statistics;

/// Relative pose error of an estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct RelativeError {
    /// Frames between the two ends of a step.
    pub delta: usize,
    /// Number of steps.
    pub steps: usize,
    /// Figures of the translation errors, metres per step.
    pub translation_m: Statistics,
    /// Figures of the rotation errors, radians per step.
    pub rotation_rad: Statistics,
}

/// Compares steps of `delta` matched frames that follow each other without overlap (`evo`'s default).
///
/// Only the scale of `alignment` matters here: relative motions do not see the rest.
///
/// # Errors
/// [`EvaluationError`] when no poses match, the alignment is not determined, `delta` is
/// zero or the matched part is shorter than one step.
pub fn relative_error(
    estimate: &[StampedPose],
    reference: &[StampedPose],
    delta: usize,
    alignment: Alignment,
) -> Result<RelativeError, EvaluationError> {
    relative_error_of(&associate(estimate, reference)?, delta, alignment)
}

/// As [`relative_error`], of (estimate, reference) pairs that are matched already.
///
/// # Errors
/// [`EvaluationError`] when the alignment is not determined, `delta` is zero or the pairs are fewer than one step needs.
pub fn relative_error_of(
    pairs: &[(StampedPose, StampedPose)],
    delta: usize,
    alignment: Alignment,
) -> Result<RelativeError, EvaluationError> {
    let too_short = EvaluationError::TooShort {
        delta,
        poses: pairs.len(),
    };
    if delta == 0 || pairs.len() <= delta {
        return Err(too_short);
    }
    let applied = alignment_of(pairs, alignment)?;
    let ends: Vec<_> = pairs.iter().step_by(delta).collect();
    let (mut translations, mut rotations) = (Vec::new(), Vec::new());
    for step in ends.windows(2) {
        let (from, to) = (step[0], step[1]);
        let estimated = applied
            .apply(&from.0.world_from_frame)
            .inv_mul(&applied.apply(&to.0.world_from_frame));
        let referred = from.1.world_from_frame.inv_mul(&to.1.world_from_frame);
        let error = referred.inv_mul(&estimated);
        translations.push(error.translation.vector.norm());
        rotations.push(error.rotation.angle());
    }
    match (Statistics::of(&translations), Statistics::of(&rotations)) {
        (Some(translation_m), Some(rotation_rad)) => Ok(RelativeError {
            delta,
            steps: translations.len(),
            translation_m,
            rotation_rad,
        }),
        _ => Err(too_short),
    }
}
