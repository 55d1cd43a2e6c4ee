//! The landmarks that a frame should have shown and did not.
//!
//! A frame that finds next to nothing (a lens cap, a black image, a jump of the robot) says something about the frame,
//! not about the landmarks: it misses none.

use std::collections::BTreeSet;

use super::association::Association;
use super::catalogue::{Entry, Stage};
use super::prediction::Predicted;

/// Below this share of the landmarks in view found, a frame counts as blind.
const BLIND_SHARE: f64 = 0.2;
/// Beyond this change of direction SIFT is not expected to find a landmark again, degrees.
const COMPARABLE_DEGREES: f64 = 20.0;
/// The same for the distance, as a ratio to that of the first sighting: an octave. The map does not know that one wall hides
/// the next; what lies behind it is mostly farther away than it was ever seen from.
const COMPARABLE_RANGE: f64 = 2.0;

/// Landmarks of the map that a frame should show, because they are in view under a direction like that of their last
/// sighting, from a distance like that of the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Expected {
    /// Number of them.
    pub(crate) landmarks: usize,
    /// Number of those that are among the accepted matches.
    pub(crate) found: usize,
}

/// Counts the landmarks that `association` should show.
#[must_use]
pub(crate) fn expected(association: &Association<'_>) -> Expected {
    let found: BTreeSet<u32> = association.inliers.iter().map(|p| p.feature.id).collect();
    let mut expected = Expected {
        landmarks: 0,
        found: 0,
    };
    for (id, predicted) in association.in_view.landmarks() {
        if predicted.entry.stage == Stage::Mapped && is_comparable(predicted) {
            expected.landmarks += 1;
            expected.found += usize::from(found.contains(id));
        }
    }
    expected
}

/// Landmarks of the map that were in view under a comparable direction from a comparable distance and not found, in order of id. Those for which `apart`
/// holds are judged by themselves: where next to none of them is found, none is missed.
#[must_use]
pub(crate) fn missed_landmarks(
    association: &Association<'_>,
    apart: impl Fn(&Entry) -> bool,
) -> Vec<u32> {
    let found: BTreeSet<u32> = association
        .inliers
        .iter()
        .chain(&association.outliers)
        .map(|p| p.feature.id)
        .collect();
    let group = |of: bool| {
        let in_view = association.in_view.landmarks().iter();
        let mapped: Vec<_> = in_view
            .filter(|(_, p)| p.entry.stage == Stage::Mapped && apart(p.entry) == of)
            .collect();
        let seen = mapped.iter().filter(|(id, _)| found.contains(id)).count();
        let blind = (seen as f64) < BLIND_SHARE * mapped.len() as f64;
        mapped.into_iter().filter(move |_| !blind)
    };
    let mut missed: Vec<u32> = group(false)
        .chain(group(true))
        .filter(|(id, predicted)| !found.contains(id) && is_comparable(predicted))
        .map(|(id, _)| *id)
        .collect();
    missed.sort_unstable();
    missed
}

fn is_comparable(predicted: &Predicted<'_>) -> bool {
    let ratio = predicted.range_ratio;
    (1.0 / COMPARABLE_RANGE..COMPARABLE_RANGE).contains(&ratio)
        && predicted.entry.last_direction.dot(&predicted.direction)
            > COMPARABLE_DEGREES.to_radians().cos()
}
