//! The landmarks that a frame should have shown and did not.
//!
//! A frame that finds next to nothing (a lens cap, a black image, a jump of the robot) says something about the frame,
//! not about the landmarks: it misses none.

use std::collections::BTreeSet;

use super::association::Association;
use super::catalogue::Stage;

/// Below this share of the landmarks in view found, a frame counts as blind.
const BLIND_SHARE: f64 = 0.2;
/// Beyond this change of direction SIFT is not expected to find a landmark again, degrees.
const COMPARABLE_DEGREES: f64 = 20.0;

/// Landmarks of the map that were in view under a comparable direction and not found, in order of id.
#[must_use]
pub(crate) fn missed_landmarks(association: &Association<'_>) -> Vec<u32> {
    let found: BTreeSet<u32> = association
        .inliers
        .iter()
        .chain(&association.outliers)
        .map(|p| p.feature.id)
        .collect();
    let mapped = || {
        let in_view = association.in_view.landmarks().iter();
        in_view.filter(|(_, predicted)| predicted.entry.stage == Stage::Mapped)
    };
    if (found.len() as f64) < BLIND_SHARE * mapped().count() as f64 {
        return Vec::new();
    }
    let comparable = COMPARABLE_DEGREES.to_radians().cos();
    mapped()
        .filter(|(id, predicted)| {
            !found.contains(id)
                && predicted.entry.last_direction.dot(&predicted.direction) > comparable
        })
        .map(|(id, _)| *id)
        .collect()
}
