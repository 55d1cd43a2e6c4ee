//! The budget of the map: which landmarks leave when there are more than it may hold.
//!
//! A landmark is worth what it has been used for: the number of its sightings over the keyframes that have passed since the
//! last one. A landmark that is more likely gone than there is worth less than any other. Landmarks in view stay,
//! whatever they are worth: the pose hangs on them.
//!
//! A keyframe looks at a few landmarks only, from a place in the catalogue that is another one every time, and takes the
//! least worthy among them; its time does not depend on the size of the map. The map exceeds the budget by what one keyframe
//! adds, and where everything is in view, by more.

use super::Slam;
use crate::frontend::catalogue::Entry;
use crate::frontend::prediction::InView;

/// Landmarks that leave at one keyframe at most, because there are too many.
const MOST_LEAVING: usize = 400;
/// Landmarks looked at for each one that leaves.
const LOOKED_AT: usize = 6;

impl Slam {
    /// Landmarks that leave the map because it is over its budget, in order of id. None of them is in `view`.
    pub(super) fn over_budget(&self, view: &InView<'_>) -> Vec<u32> {
        let catalogue = &self.state.catalogue;
        let leaving = catalogue
            .mapped()
            .saturating_sub(self.allowed_landmarks())
            .min(MOST_LEAVING);
        if leaving == 0 {
            return Vec::new();
        }
        let now = self.state.keyframe;
        // Knuth's multiplicative hash: the places of consecutive keyframes are far apart.
        let start = now.wrapping_mul(2_654_435_761);
        let mut looked_at: Vec<(bool, f64, u32)> = catalogue
            .mapped_from(start)
            .take(LOOKED_AT * leaving)
            .filter(|(id, _)| view.position(*id).is_none())
            .map(|(id, entry)| (entry.existence.is_likely(), worth(entry, now), id))
            .collect();
        looked_at.sort_by(|a, b| {
            (a.0.cmp(&b.0))
                .then(a.1.total_cmp(&b.1))
                .then(a.2.cmp(&b.2))
        });
        let mut leaving: Vec<u32> = looked_at.iter().take(leaving).map(|l| l.2).collect();
        leaving.sort_unstable();
        leaving
    }
}

fn worth(entry: &Entry, now: u32) -> f64 {
    f64::from(entry.observations) / (1.0 + f64::from(now.saturating_sub(entry.last.keyframe)))
}
