//! Two frames of one camera, the keypoints that were found in both, and the motion that odometry claims between them.

use mono_geometry::motion::{OdometrySample, held_between};
use nalgebra::Vector2;

/// Two frames and the keypoints found in both.
#[derive(Debug, Clone, PartialEq)]
pub struct FramePair {
    /// Time of the earlier frame, seconds.
    pub from_s: f64,
    /// Time of the later frame, seconds.
    pub to_s: f64,
    /// The same point in the earlier and in the later frame, ideal (undistorted) pixels.
    pub matches: Vec<[Vector2<f64>; 2]>,
}

impl FramePair {
    /// Median distance that the points moved in the image, pixels; `None` without matches.
    #[must_use]
    pub fn median_displacement_px(&self) -> Option<f64> {
        median(
            self.matches
                .iter()
                .map(|[from, to]| (to - from).norm())
                .collect(),
        )
    }
}

/// The motion that odometry claims for a span of time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Claim {
    /// Signed distance driven, metres.
    pub(crate) distance_m: f64,
    /// Turn, radians, left positive; not wrapped.
    pub(crate) turn_rad: f64,
}

impl Claim {
    /// The claim of `rows` for the span `[from_s, to_s]`. O(log rows + rows of the span).
    pub(crate) fn of(rows: &[OdometrySample], from_s: f64, to_s: f64) -> Self {
        held_between(rows, from_s, to_s).into_iter().fold(
            Self {
                distance_m: 0.0,
                turn_rad: 0.0,
            },
            |claim, (row, duration_s)| Self {
                distance_m: claim.distance_m + row.v_mps * duration_s,
                turn_rad: claim.turn_rad + row.omega_radps * duration_s,
            },
        )
    }
}

/// The middle value (the upper one of two); `None` without values.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    if values.is_empty() {
        return None;
    }
    values.sort_unstable_by(f64::total_cmp);
    Some(values[middle])
}
