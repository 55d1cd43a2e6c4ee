//! Reasons why two trajectories cannot be compared.

use crate::alignment::Alignment;

/// Why two trajectories cannot be compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum EvaluationError {
    /// No two poses lie close enough in time.
    #[error(
        "no pose of the estimate ({estimate} poses) lies within {max_difference_s} s of one of the reference ({reference} poses)"
    )]
    NoMatches {
        /// Number of poses of the estimate.
        estimate: usize,
        /// Number of poses of the reference.
        reference: usize,
        /// Largest allowed difference in seconds.
        max_difference_s: f64,
    },
    /// The matched positions do not determine the alignment.
    #[error("the {alignment} alignment is not determined by {poses} matched positions: {reason}")]
    Degenerate {
        /// The alignment asked for.
        alignment: Alignment,
        /// Number of matched positions.
        poses: usize,
        /// Why they do not determine it.
        reason: &'static str,
    },
    /// The matched part is too short for the relative error asked for.
    #[error("a relative error over {delta} frames needs at least {} matched poses, found {poses}", delta.saturating_add(1))]
    TooShort {
        /// Frames between the two ends of a step.
        delta: usize,
        /// Number of matched poses.
        poses: usize,
    },
}
