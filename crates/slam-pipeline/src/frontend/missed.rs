//! The landmarks that a frame should have shown and did not.
//!
//! A frame that finds next to nothing (a lens cap, a black image, a jump of the robot) says something about the frame,
//! not about the landmarks: it misses none.

use std::collections::BTreeSet;

use super::association::Association;
use super::catalogue::{Catalogue, Stage};

/// Below this share of the landmarks in view found, a frame counts as blind.
const BLIND_SHARE: f64 = 0.2;
/// Beyond this change of direction SIFT is not expected to find a landmark again, degrees.
const COMPARABLE_DEGREES: f64 = 20.0;

/// Landmarks of the map that were in view under a comparable direction and not found, in order of id.
#[must_use]
pub(crate) fn missed_landmarks(catalogue: &Catalogue, association: &Association) -> Vec<u32> {
    let found: BTreeSet<u32> = association
        .inliers
        .iter()
        .chain(&association.outliers)
        .map(|p| p.feature.id)
        .collect();
    let is_mapped = |id: u32| catalogue.get(id).is_some_and(|e| e.stage == Stage::Mapped);
    let mapped = association
        .in_view
        .keys()
        .filter(|id| is_mapped(**id))
        .count();
    if (found.len() as f64) < BLIND_SHARE * mapped as f64 {
        return Vec::new();
    }
    association
        .in_view
        .iter()
        .filter(|(id, predicted)| {
            !found.contains(id)
                && catalogue.get(**id).is_some_and(|e| {
                    e.stage == Stage::Mapped
                        && e.last_direction.dot(&predicted.direction)
                            > COMPARABLE_DEGREES.to_radians().cos()
                })
        })
        .map(|(id, _)| *id)
        .collect()
}
