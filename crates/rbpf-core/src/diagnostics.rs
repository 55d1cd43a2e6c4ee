//! Impoverishment of a particle set: unique ancestors, and the age of the common ancestor.
//!
//! Resampling merges paths backwards in time: the further one looks back, the fewer ancestors the
//! present particles have, until there is one. Map entries older than that are the same in all
//! particles, and no later weight can choose between them. [`Genealogy`] takes the ancestors of each
//! resampling and reports the age of the common one.
//!
//! Only resampling frames are stored, and everything before the common ancestor is dropped, so the
//! memory is N times the number of resamplings since coalescence.

use crate::error::RbpfError;
use std::collections::VecDeque;

/// Number of distinct entries of a vector of ancestors, sorted or not. O(n log n).
#[must_use]
pub fn unique_ancestors(ancestors: &[usize]) -> usize {
    let mut sorted = ancestors.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    sorted.len()
}

/// The resampling events from which the age of the common ancestor is read.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "StoredGenealogy")
)]
pub struct Genealogy {
    particles: usize,
    events: VecDeque<ResamplingEvent>,
}

/// One resampling: particle i of the set after it is a copy of particle `ancestors[i]` before.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct ResamplingEvent {
    /// The frame at which it happened.
    frame: u64,
    /// Ancestor of each slot.
    ancestors: Vec<usize>,
}

/// A genealogy as it was read, before it is believed.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
struct StoredGenealogy {
    particles: usize,
    events: VecDeque<ResamplingEvent>,
}

#[cfg(feature = "serde")]
impl TryFrom<StoredGenealogy> for Genealogy {
    type Error = RbpfError;

    fn try_from(stored: StoredGenealogy) -> Result<Self, RbpfError> {
        // Every event draws from the set that the one before it left; the first set is of any size.
        let mut before = usize::MAX;
        for event in &stored.events {
            check_ancestors(&event.ancestors, before)?;
            before = event.ancestors.len();
        }
        if !stored.events.is_empty() && before != stored.particles {
            return Err(RbpfError::Stored(
                "the last resampling leaves as many particles as there are",
            ));
        }
        Ok(Self {
            particles: stored.particles,
            events: stored.events,
        })
    }
}

/// The particle in which the paths of the present particles meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct CommonAncestor {
    /// The latest frame whose proposed pose all paths share (moves after resampling may differ).
    frame: u64,
    /// The slot that particle had in that frame, before its resampling.
    slot: usize,
}

impl Genealogy {
    /// The genealogy of a set of `particles` that was never resampled.
    #[must_use]
    pub const fn new(particles: usize) -> Self {
        Self {
            particles,
            events: VecDeque::new(),
        }
    }

    /// Notes one resampling, after which the set has as many particles as there are ancestors. Frames
    /// increase from call to call.
    ///
    /// # Errors
    /// [`RbpfError::NoParticles`] or [`RbpfError::UnknownAncestor`].
    pub fn record(&mut self, frame: u64, ancestors: &[usize]) -> Result<(), RbpfError> {
        check_ancestors(ancestors, self.particles)?;
        self.particles = ancestors.len();
        self.events.push_back(ResamplingEvent {
            frame,
            ancestors: ancestors.to_vec(),
        });
        if let Some((event, _)) = self.coalescence() {
            self.events.drain(..event);
        }
        Ok(())
    }

    /// The particle in which all lines meet; `None` while at least two reach back to the start.
    /// O(N) per resampling gone back.
    fn common_ancestor(&self) -> Option<CommonAncestor> {
        let (event, slot) = self.coalescence()?;
        Some(CommonAncestor {
            frame: self.events[event].frame,
            slot,
        })
    }

    /// Number of frames from the common ancestor to `frame`; `None` while at least two lines reach back
    /// to the start. O(N) per resampling gone back.
    #[must_use]
    pub fn common_ancestor_age(&self, frame: u64) -> Option<u64> {
        Some(frame.saturating_sub(self.common_ancestor()?.frame))
    }

    /// Number of particles after the last resampling.
    #[must_use]
    pub const fn particles(&self) -> usize {
        self.particles
    }

    /// Index of the latest event before which one particle is the ancestor of all, and its slot.
    fn coalescence(&self) -> Option<(usize, usize)> {
        let mut alive: Vec<usize> = (0..self.particles).collect();
        for (index, event) in self.events.iter().enumerate().rev() {
            for slot in &mut alive {
                *slot = event.ancestors[*slot];
            }
            alive.sort_unstable();
            alive.dedup();
            if let [slot] = alive[..] {
                return Some((index, slot));
            }
        }
        None
    }
}

/// At least one ancestor, each one of `particles`.
pub(crate) fn check_ancestors(ancestors: &[usize], particles: usize) -> Result<(), RbpfError> {
    if ancestors.is_empty() {
        return Err(RbpfError::NoParticles);
    }
    match ancestors
        .iter()
        .enumerate()
        .find(|(_, ancestor)| **ancestor >= particles)
    {
        Some((slot, &ancestor)) => Err(RbpfError::UnknownAncestor {
            slot,
            ancestor,
            particles,
        }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::resampling::Resampler;
    use crate::streams::{Purpose, Streams};
    use rand::RngExt;

    #[test]
    fn counts_distinct_ancestors() {
        assert_eq!(unique_ancestors(&[3, 0, 0, 3, 1]), 3);
        assert_eq!(unique_ancestors(&[]), 0);
    }

    #[test]
    fn lines_meet_where_the_paths_do() {
        let mut genealogy = Genealogy::new(4);
        assert_eq!(genealogy.common_ancestor(), None);
        genealogy.record(2, &[0, 0, 1, 2]).unwrap();
        assert_eq!(genealogy.common_ancestor_age(2), None);
        genealogy.record(5, &[0, 0, 1, 1]).unwrap();
        // slots 0 and 1 before frame 5 both come from slot 0 before frame 2
        assert_eq!(
            genealogy.common_ancestor(),
            Some(CommonAncestor { frame: 2, slot: 0 })
        );
        assert_eq!(genealogy.common_ancestor_age(9), Some(7));
        genealogy.record(6, &[3, 3, 3, 3]).unwrap();
        assert_eq!(
            genealogy.common_ancestor(),
            Some(CommonAncestor { frame: 6, slot: 3 })
        );
        assert_eq!(genealogy.events.len(), 1);
    }

    #[test]
    fn wrong_vectors_are_refused() {
        let mut genealogy = Genealogy::new(3);
        assert_eq!(genealogy.record(0, &[]), Err(RbpfError::NoParticles));
        assert_eq!(
            genealogy.record(0, &[0, 3, 1]),
            Err(RbpfError::UnknownAncestor {
                slot: 1,
                ancestor: 3,
                particles: 3
            })
        );
        assert_eq!(genealogy.events.len(), 0);
    }

    /// Against whole paths carried as vectors of (frame, slot), and with bounded memory, for a set of
    /// changing size too.
    #[test]
    fn agrees_with_whole_paths() {
        whole_paths(|_| 20);
        whole_paths(|frame| 5 + (7 * frame as usize) % 31);
    }

    fn whole_paths(size: impl Fn(u64) -> usize) {
        let mut genealogy = Genealogy::new(20);
        let mut paths = vec![Vec::new(); 20];
        let streams = Streams::new(3);
        for frame in 0..300_u64 {
            for (slot, path) in paths.iter_mut().enumerate() {
                path.push((frame, slot));
            }
            let mut rng = streams.shared(frame, Purpose::Resampling);
            let weights: Vec<f64> = paths.iter().map(|_| 2.0 * rng.random::<f64>()).collect();
            let ancestors = Resampler::Systematic
                .resample(&weights, size(frame), &mut rng)
                .expect("weights are finite");
            genealogy
                .record(frame, &ancestors)
                .expect("ancestors are in the set");
            assert_eq!(genealogy.particles(), size(frame));
            paths = ancestors.iter().map(|&a| paths[a].clone()).collect();
            let common = (0..=frame as usize)
                .rev()
                .find(|&f| paths.iter().all(|path| path[f] == paths[0][f]))
                .map(|f| CommonAncestor {
                    frame: f as u64,
                    slot: paths[0][f].1,
                });
            assert_eq!(genealogy.common_ancestor(), common, "frame {frame}");
        }
        assert!(genealogy.events.len() < 150);
    }
}
