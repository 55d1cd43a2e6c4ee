//! Reasons why two trajectories cannot be compared.

use crate::alignment::Alignment;

/// Why two trajectories cannot be compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum EvaluationError {
    /// No two poses lie close enough in time.
    #[error(
        "no pose of the estimate ({estimate} poses{}) lies within {max_difference_s} s of one of the reference ({reference} \
         poses{}){}",
        span(.estimate_s),
        span(.reference_s),
        cause(.estimate_s, .reference_s, *.least_difference_s)
    )]
    NoMatches {
        /// Number of poses of the estimate.
        estimate: usize,
        /// Number of poses of the reference.
        reference: usize,
        /// First and last time of the estimate, seconds.
        estimate_s: [f64; 2],
        /// First and last time of the reference, seconds.
        reference_s: [f64; 2],
        /// Largest allowed difference in seconds.
        max_difference_s: f64,
        /// Smallest difference there is, seconds; infinite where one of them has no pose.
        least_difference_s: f64,
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

/// The range of times, for a message.
fn span([first, last]: &[f64; 2]) -> String {
    if first.is_nan() {
        String::new()
    } else if first == last {
        format!(" at {first} s")
    } else {
        format!(" from {first} to {last} s")
    }
}

/// The likely cause of times that do not meet.
fn cause(estimate_s: &[f64; 2], reference_s: &[f64; 2], least_s: f64) -> String {
    let magnitude = |span: &[f64; 2]| span[1].abs().max(span[0].abs());
    let (of_estimate, of_reference) = (magnitude(estimate_s), magnitude(reference_s));
    for (unit, factor) in [
        ("nanoseconds", 1e9),
        ("microseconds", 1e6),
        ("milliseconds", 1e3),
    ] {
        // Two recordings of one drive agree to a factor of three, whatever their clocks began with.
        let near = |a: f64, b: f64| a > 0.0 && b > 0.0 && (a / b / factor - 1.0).abs() < 0.67;
        if near(of_estimate, of_reference) {
            return format!("; the times of the estimate look like {unit}");
        }
        if near(of_reference, of_estimate) {
            return format!("; the times of the reference look like {unit}");
        }
    }
    if estimate_s[0] <= reference_s[1] && reference_s[0] <= estimate_s[1] {
        return format!("; the nearest two are {least_s:.3} s apart");
    }
    if least_s.is_finite() {
        return format!(
            "; the two do not overlap in time and have {least_s:.3} s between them: another clock?"
        );
    }
    String::new()
}
