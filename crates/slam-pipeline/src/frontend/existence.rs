//! The belief that a landmark exists, as log odds.
//!
//! Finding a landmark again raises the belief; not finding one that is predicted in view lowers it. A landmark whose
//! belief falls below a floor leaves the map.

use serde::{Deserialize, Serialize};

/// Log odds ratio of a match: 60 % of the landmarks in view are found again, 5 % of wrong ones find some match.
const SEEN: f64 = 2.48;
/// The same for a landmark in view that was not found: ln(0.4 / 0.95).
const MISSED: f64 = -0.865;
/// The belief saturates here, so that a landmark can still be forgotten.
const CEILING: f64 = 5.0;
/// A landmark below this is believed gone: odds of 1 to 20 against it.
const FLOOR: f64 = -3.0;
/// Log odds that a landmark exists; even odds at the start.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct Existence {
    log_odds: f64,
}

impl Existence {
    /// The belief with these log odds, at most the highest there is.
    #[must_use]
    pub(crate) fn from_log_odds(log_odds: f64) -> Self {
        Self {
            log_odds: log_odds.min(CEILING),
        }
    }

    /// Log odds that the landmark exists.
    #[must_use]
    pub(crate) fn log_odds(self) -> f64 {
        self.log_odds
    }

    /// The belief after the landmark was found.
    #[must_use]
    pub(crate) fn seen(self) -> Self {
        Self {
            log_odds: (self.log_odds + SEEN).min(CEILING),
        }
    }

    /// The belief after the landmark was in view and not found.
    #[must_use]
    pub(crate) fn missed(self) -> Self {
        Self {
            log_odds: self.log_odds + MISSED,
        }
    }

    /// Whether the landmark is as likely there as gone, or more.
    #[must_use]
    pub(crate) fn is_likely(self) -> bool {
        self.log_odds >= 0.0
    }

    /// Whether the landmark is believed gone.
    #[must_use]
    pub(crate) fn is_gone(self) -> bool {
        self.log_odds < FLOOR
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_sightings_outlive_nine_misses_and_not_ten() {
        let mut belief = Existence::default();
        for _ in 0..3 {
            belief = belief.seen();
        }
        // Saturated at 5: (5 + 3) / 0.865 = 9.2 misses.
        let mut misses = 0;
        while !belief.is_gone() {
            belief = belief.missed();
            misses += 1;
        }
        assert_eq!(misses, 10);
    }

    #[test]
    fn a_new_landmark_goes_after_four_misses() {
        let mut belief = Existence::default();
        for _ in 0..3 {
            belief = belief.missed();
        }
        assert!(!belief.is_gone());
        assert!(belief.missed().is_gone());
    }
}
