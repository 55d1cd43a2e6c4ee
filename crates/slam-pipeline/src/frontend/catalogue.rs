//! What all particles share of a landmark: identity, descriptor, first
//! sighting, and the belief that it exists.
//!
//! A feature seen once is *tentative*: its Gaussian in the anchor camera is the
//! same in every particle, so no particle stores it. The second sighting makes
//! it a landmark of every map.

use std::collections::BTreeMap;

use feature_kdtree::{AutoIndex, Descriptor, DescriptorIndex, IndexError, distance_squared};
use nalgebra::{Vector2, Vector3};

use crate::filter::landmark::Landmark;

/// log odds ratio of a match: 60 % of the landmarks in view are found again,
/// 5 % of wrong ones find some match.
const LOG_ODDS_SEEN: f64 = 2.48;
/// The same for a landmark in view that was not found: ln(0.4 / 0.95).
const LOG_ODDS_MISSED: f64 = -0.865;
/// Belief saturates here, so that a landmark can still be forgotten.
const LOG_ODDS_CEILING: f64 = 5.0;
/// Removed below this: odds of 1 to 20 against.
const LOG_ODDS_FLOOR: f64 = -3.0;

/// Squared descriptor distance at which the index learns the new look: half of
/// what separates most true matches from false ones.
const REINDEX_DISTANCE_SQUARED: u32 = 120 * 120;

/// Whether the particles hold the landmark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// Seen, not in the map.
    Tentative,
    /// In the map of every particle.
    Mapped,
}

/// A sighting at a keyframe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// Keyframe index.
    pub keyframe: u32,
    /// Ideal pixel.
    pub pixel: Vector2<f64>,
}

/// One landmark or candidate.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Whether the particles hold it.
    pub stage: Stage,
    /// Descriptor of the last sighting.
    pub descriptor: Box<Descriptor>,
    /// Descriptor the index holds: renewed when the look has changed, since
    /// every change of the index costs.
    indexed: Box<Descriptor>,
    /// Gaussian after the first sighting, in the anchor camera.
    pub prototype: Landmark,
    /// First sighting.
    pub first: Sighting,
    /// Last sighting.
    pub last: Sighting,
    /// Direction from the camera to it at the last sighting, world axes.
    pub last_direction: Vector3<f64>,
    /// Sightings at keyframes.
    pub observations: u32,
    /// Belief that it exists, log odds.
    pub log_odds: f64,
}

/// All landmarks and candidates, by id.
#[derive(Debug)]
pub struct Catalogue {
    entries: BTreeMap<u32, Entry>,
    index: AutoIndex,
    next_id: u32,
}

impl Catalogue {
    /// An empty catalogue.
    ///
    /// # Errors
    /// Those of the descriptor index.
    pub fn new() -> Result<Self, IndexError> {
        Ok(Self {
            entries: BTreeMap::new(),
            index: AutoIndex::new(),
            next_id: 0,
        })
    }

    /// Entries in id order.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &Entry)> {
        self.entries.iter().map(|(id, e)| (*id, e))
    }

    /// The entry `id`.
    #[must_use]
    pub fn get(&self, id: u32) -> Option<&Entry> {
        self.entries.get(&id)
    }

    /// Landmarks in the maps.
    #[must_use]
    pub fn mapped(&self) -> usize {
        self.entries
            .values()
            .filter(|e| e.stage == Stage::Mapped)
            .count()
    }

    /// The descriptor index over all entries.
    #[must_use]
    pub fn index(&self) -> &AutoIndex {
        &self.index
    }

    /// Adds a tentative feature and returns its id.
    ///
    /// # Errors
    /// Those of the descriptor index.
    pub fn add(
        &mut self,
        descriptor: &Descriptor,
        prototype: Landmark,
        sighting: Sighting,
    ) -> Result<u32, IndexError> {
        let id = self.next_id;
        self.index.insert(id, descriptor)?;
        self.next_id += 1;
        self.entries.insert(
            id,
            Entry {
                stage: Stage::Tentative,
                descriptor: Box::new(*descriptor),
                indexed: Box::new(*descriptor),
                prototype,
                first: sighting,
                last: sighting,
                last_direction: Vector3::zeros(),
                observations: 1,
                log_odds: 0.0,
            },
        );
        Ok(id)
    }

    /// Records a sighting: newest descriptor, more belief.
    ///
    /// # Errors
    /// Those of the descriptor index.
    pub fn record_sighting(
        &mut self,
        id: u32,
        descriptor: &Descriptor,
        sighting: Sighting,
        direction: Vector3<f64>,
    ) -> Result<(), IndexError> {
        if let Some(entry) = self.entries.get_mut(&id) {
            if distance_squared(&entry.indexed, descriptor) > REINDEX_DISTANCE_SQUARED {
                self.index.remove(id);
                self.index.insert(id, descriptor)?;
                *entry.indexed = *descriptor;
            }
            *entry.descriptor = *descriptor;
            entry.last = sighting;
            entry.last_direction = direction;
            entry.observations += 1;
            entry.log_odds = (entry.log_odds + LOG_ODDS_SEEN).min(LOG_ODDS_CEILING);
        }
        Ok(())
    }

    /// Marks `id` as held by the particles.
    pub fn promote(&mut self, id: u32) {
        if let Some(entry) = self.entries.get_mut(&id) {
            entry.stage = Stage::Mapped;
        }
    }

    /// Records that `id` was in view and not found; true when it is now believed gone.
    pub fn record_miss(&mut self, id: u32) -> bool {
        self.entries.get_mut(&id).is_some_and(|entry| {
            entry.log_odds += LOG_ODDS_MISSED;
            entry.log_odds < LOG_ODDS_FLOOR
        })
    }

    /// Removes an entry.
    pub fn remove(&mut self, id: u32) {
        if self.entries.remove(&id).is_some() {
            self.index.remove(id);
        }
    }

    /// Removes tentative features not seen since keyframe `oldest`.
    pub fn forget_tentative_before(&mut self, oldest: u32) {
        let gone: Vec<u32> = self
            .entries
            .iter()
            .filter(|(_, e)| e.stage == Stage::Tentative && e.last.keyframe < oldest)
            .map(|(id, _)| *id)
            .collect();
        for id in gone {
            self.remove(id);
        }
    }
}
