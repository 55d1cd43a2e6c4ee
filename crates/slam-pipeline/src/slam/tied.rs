//! The keyframes whose unit is one: see [`crate::filter::metric_path`].

use super::Slam;
use crate::frontend::catalogue::Stage;

/// Keyframes between the first and the last sighting of a landmark from which it ties all between. On a street a landmark
/// is out of sight after fewer.
const LONG: u32 = 30;
/// Landmarks that tie two keyframes.
const LEAST_LANDMARKS: i32 = 15;

impl Slam {
    /// Whether keyframes k and k + 1 have one unit. O(keyframes + landmarks).
    pub(super) fn tied(&self) -> Vec<bool> {
        let sightings = self.state.catalogue.iter().filter_map(|(_, entry)| {
            (entry.stage == Stage::Mapped).then_some((entry.first.keyframe, entry.last.keyframe))
        });
        tied(self.state.keyframe as usize, sightings)
    }

    /// [`Self::tied`] where the present shows a place of `keyframe`.
    pub(super) fn tied_since(&self, keyframe: u32) -> Vec<bool> {
        let mut ties = self.tied();
        if let Some(between) = ties.get_mut(keyframe as usize..) {
            between.fill(true);
        }
        ties
    }
}

/// [`Slam::tied`] by the first and the last keyframe of every landmark.
fn tied(keyframes: usize, landmarks: impl Iterator<Item = (u32, u32)>) -> Vec<bool> {
    let mut change = vec![0_i32; keyframes + 1];
    for (first, last) in landmarks {
        if first + LONG <= last && (last as usize) < change.len() {
            change[first as usize] += 1;
            change[last as usize] -= 1;
        }
    }
    let ties = change.iter().scan(0, |sum, c| {
        *sum += c;
        Some(*sum >= LEAST_LANDMARKS)
    });
    ties.take(keyframes).collect()
}

#[cfg(test)]
mod tests {
    use super::tied;

    #[test]
    fn landmarks_that_are_seen_for_long_tie_the_keyframes_between() {
        let street = (0..100).flat_map(|k| (0..40).map(move |_| (k, k + 8)));
        let loop_closed = (0..15).map(|_| (20, 90));
        let ties = tied(120, street.clone().chain(loop_closed));
        for (k, tie) in ties.iter().enumerate() {
            assert_eq!(*tie, (20..90).contains(&k), "{k}");
        }
        // One landmark too few, and no keyframes at all.
        let too_few = (0..14).map(|_| (20, 90));
        assert!(!tied(120, street.chain(too_few)).contains(&true));
        assert!(tied(0, core::iter::empty()).is_empty());
    }
}
