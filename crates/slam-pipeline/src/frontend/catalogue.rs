//! The catalogue: the part of a landmark that all particles share.
//!
//! It holds the identity, the descriptor, the first and last sighting and the belief that the landmark exists. A
//! feature seen once is *tentative*: its Gaussian in the anchor camera is the same in every particle, so no particle
//! stores it. The second sighting makes it a landmark of every map.
//!
//! A keyframe collects its changes in a [`CatalogueUpdate`] and applies them at its end.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

use feature_kdtree::{
    Descriptor, DescriptorIndex as _, IndexError, KdForest, KdForestParams, distance_squared,
};
use nalgebra::{Vector2, Vector3};

use rbpf_core::CowMap;

use super::existence::Existence;
use super::frustum::Frustum;
use super::view_index::ViewIndex;
use crate::filter::landmark::{Landmark, Parametrisation};
use crate::filter::observation::Sighting;
use crate::filter::particle::Particle;
use crate::known_map::KnownLandmark;
use crate::method::DescriptorSearch;

/// Squared descriptor distance at which a landmark takes a new look: half of what separates most true matches from
/// false ones.
const NEW_LOOK_DISTANCE_SQUARED: u32 = 120 * 120;

/// Whether the particles hold the landmark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Stage {
    /// Seen once, not in the map.
    Tentative,
    /// In the map of every particle.
    Mapped,
}

/// One landmark or tentative feature.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Entry {
    /// Whether the particles hold it.
    pub(crate) stage: Stage,
    /// Descriptor of the last sighting.
    #[serde(with = "crate::stored::descriptor")]
    pub(crate) descriptor: Box<Descriptor>,
    /// Descriptor that the ratio test compares: it stays until a sighting looks clearly different, so that the nearest
    /// neighbours of a keypoint do not change with every frame.
    #[serde(with = "crate::stored::descriptor")]
    pub(crate) look: Box<Descriptor>,
    /// Gaussian after the first sighting, in the anchor camera.
    pub(crate) prototype: Landmark,
    /// First sighting.
    pub(crate) first: Sighting,
    /// Last sighting.
    pub(crate) last: Sighting,
    /// Direction from the camera to it at the last sighting, world axes.
    pub(crate) last_direction: Vector3<f64>,
    /// Sightings at keyframes.
    pub(crate) observations: u32,
    /// Belief that it exists.
    pub(crate) existence: Existence,
}

impl Entry {
    /// Whether `descriptor` is far enough from the look to replace it.
    pub(crate) fn looks_different(&self, descriptor: &Descriptor) -> bool {
        distance_squared(&self.look, descriptor) > NEW_LOOK_DISTANCE_SQUARED
    }
}

/// A landmark seen again.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SeenAgain {
    /// Landmark.
    pub(crate) id: u32,
    /// Its descriptor in this frame.
    pub(crate) descriptor: Descriptor,
    /// Where it was seen.
    pub(crate) sighting: Sighting,
    /// Direction from the camera to it, world axes.
    pub(crate) direction: Vector3<f64>,
}

/// A feature seen for the first time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NewFeature {
    /// Its descriptor.
    pub(crate) descriptor: Descriptor,
    /// Gaussian after this sighting.
    pub(crate) prototype: Landmark,
    /// Where it was seen.
    pub(crate) sighting: Sighting,
}

/// The changes that one keyframe makes, in the order in which they take effect.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct CatalogueUpdate {
    /// Landmarks in view that were not found.
    pub(crate) missed: Vec<u32>,
    /// Tentative features that the particles hold from now on.
    pub(crate) promoted: Vec<u32>,
    /// Landmarks that leave the map.
    pub(crate) removed: Vec<u32>,
    /// Landmarks and features seen again.
    pub(crate) seen: Vec<SeenAgain>,
    /// Features seen for the first time.
    pub(crate) new: Vec<NewFeature>,
    /// Tentative features whose last sighting is older than this keyframe are forgotten.
    pub(crate) forget_before: u32,
}

/// Everything that follows from the entries and the map of the reference particle.
#[derive(Debug, Clone, Default)]
struct Index {
    /// Ids of the tentative features.
    tentative: BTreeSet<u32>,
    /// Landmarks of the map by groups.
    view: ViewIndex,
}

/// All landmarks and tentative features, by id.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Catalogue {
    entries: BTreeMap<u32, Entry>,
    next_id: u32,
    /// Answers that would otherwise need a look at every entry; `None` until [`Self::follow`] makes it.
    #[serde(skip)]
    index: Option<Index>,
    /// Looks of all entries, where the method searches the whole map; a state with it is not stored.
    #[serde(skip)]
    forest: Option<KdForest>,
}

impl Catalogue {
    /// An empty catalogue that can be searched as `search` asks.
    ///
    /// # Errors
    /// Those of the forest's parameters.
    pub(crate) fn new(search: DescriptorSearch) -> Result<Self, IndexError> {
        Ok(Self {
            entries: BTreeMap::new(),
            next_id: 0,
            index: Some(Index::default()),
            forest: match search {
                DescriptorSearch::InView => None,
                DescriptorSearch::WholeMapForest => Some(KdForest::new(KdForestParams::default())?),
            },
        })
    }

    /// Learns the map of the reference particle, so that [`Self::candidates`] is quick for it. O(what has changed).
    pub(crate) fn follow(&mut self, map: &CowMap<Landmark>) {
        let entries = &self.entries;
        let index = self.index.get_or_insert_with(|| Index {
            tentative: tentative_among(entries),
            view: ViewIndex::default(),
        });
        index.view.follow(map);
    }

    /// The landmarks and tentative features that may be in view of `frustum`, in order of id: all that are in view, and
    /// others. Quick for a `reference` whose map is followed; for another one these are all.
    #[must_use]
    pub(crate) fn candidates(&self, reference: &Particle, frustum: &Frustum) -> Vec<u32> {
        match &self.index {
            Some(index) if index.view.follows(&reference.map) => {
                let mut ids: Vec<u32> = index.tentative.iter().copied().collect();
                index.view.candidates(reference, frustum, &mut ids);
                ids.sort_unstable();
                ids.dedup();
                ids
            }
            _ => self.entries.keys().copied().collect(),
        }
    }

    /// Ids of the tentative features, ascending.
    fn tentative(&self) -> Cow<'_, BTreeSet<u32>> {
        self.index.as_ref().map_or_else(
            || Cow::Owned(tentative_among(&self.entries)),
            |index| Cow::Borrowed(&index.tentative),
        )
    }

    /// Number of entries, tentative ones too.
    pub(crate) fn len(&self) -> usize {
        self.entries.len()
    }

    /// Entries in order of id.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (u32, &Entry)> {
        self.entries.iter().map(|(id, e)| (*id, e))
    }

    /// The landmarks of the maps in order of id, beginning at `start` (counted around the ids given out) and going round.
    pub(crate) fn mapped_from(&self, start: u32) -> impl Iterator<Item = (u32, &Entry)> {
        let start = start % self.next_id.max(1);
        self.entries
            .range(start..)
            .chain(self.entries.range(..start))
            .filter(|(_, e)| e.stage == Stage::Mapped)
            .map(|(id, e)| (*id, e))
    }

    /// The entry `id`.
    #[must_use]
    pub(crate) fn get(&self, id: u32) -> Option<&Entry> {
        self.entries.get(&id)
    }

    /// Identities that the new features of the next update get, in their order.
    pub(crate) fn next_identities(&self) -> impl Iterator<Item = u32> + use<> {
        self.next_id..
    }

    /// Number of landmarks in the maps. O(1) once a map is followed.
    #[must_use]
    pub(crate) fn mapped(&self) -> usize {
        self.entries.len() - self.tentative().len()
    }

    /// The forest over the descriptors of all entries; `None` where the method does not search the whole map.
    #[must_use]
    pub(crate) fn forest(&self) -> Option<&KdForest> {
        self.forest.as_ref()
    }

    /// The forest as it will be after `update`. O(n) for the copy; the catalogue itself does not change.
    ///
    /// # Errors
    /// Those of the index.
    pub(crate) fn forest_after(
        &self,
        update: &CatalogueUpdate,
    ) -> Result<Option<KdForest>, IndexError> {
        let Some(mut forest) = self.forest.clone() else {
            return Ok(None);
        };
        for id in &update.removed {
            forest.remove(*id);
        }
        for seen in &update.seen {
            let differs = self
                .get(seen.id)
                .is_some_and(|entry| entry.looks_different(&seen.descriptor));
            if differs {
                forest.remove(seen.id);
                forest.insert(seen.id, &seen.descriptor)?;
            }
        }
        for (id, new) in self.next_identities().zip(&update.new) {
            forest.insert(id, &new.descriptor)?;
        }
        for id in self.forgotten(update) {
            forest.remove(id);
        }
        Ok(Some(forest))
    }

    /// Applies the changes of a keyframe; `forest` is that of [`Catalogue::forest_after`].
    pub(crate) fn apply(&mut self, update: CatalogueUpdate, forest: Option<KdForest>) {
        let forgotten = self.forgotten(&update);
        if let Some(index) = &mut self.index {
            for id in update
                .promoted
                .iter()
                .chain(&update.removed)
                .chain(&forgotten)
            {
                index.tentative.remove(id);
            }
            let first = self.next_id;
            index
                .tentative
                .extend(first..first + update.new.len() as u32);
        }
        for id in update.missed {
            if let Some(entry) = self.entries.get_mut(&id) {
                entry.existence = entry.existence.missed();
            }
        }
        for id in update.promoted {
            if let Some(entry) = self.entries.get_mut(&id) {
                entry.stage = Stage::Mapped;
            }
        }
        for id in update.removed {
            self.entries.remove(&id);
        }
        for seen in update.seen {
            if let Some(entry) = self.entries.get_mut(&seen.id) {
                if entry.looks_different(&seen.descriptor) {
                    *entry.look = seen.descriptor;
                }
                *entry.descriptor = seen.descriptor;
                entry.last = seen.sighting;
                entry.last_direction = seen.direction;
                entry.observations += 1;
                entry.existence = entry.existence.seen();
            }
        }
        for new in update.new {
            self.entries.insert(
                self.next_id,
                Entry {
                    stage: Stage::Tentative,
                    descriptor: Box::new(new.descriptor),
                    look: Box::new(new.descriptor),
                    prototype: new.prototype,
                    first: new.sighting,
                    last: new.sighting,
                    last_direction: Vector3::zeros(),
                    observations: 1,
                    existence: Existence::default(),
                },
            );
            self.next_id += 1;
        }
        for id in forgotten {
            self.entries.remove(&id);
        }
        self.forest = forest;
    }

    /// Enters a landmark of a known map, first seen at `pixel` by its anchor. Ids must ascend.
    pub(crate) fn insert_known(&mut self, known: &KnownLandmark, pixel: &Vector2<f64>) {
        let sighting = Sighting {
            keyframe: known.anchor,
            pixel: *pixel,
        };
        self.entries.insert(
            known.id,
            Entry {
                stage: Stage::Mapped,
                descriptor: Box::new(known.descriptor),
                look: Box::new(known.descriptor),
                prototype: Landmark {
                    parametrisation: Parametrisation::InverseDepth {
                        anchor: known.anchor,
                    },
                    mean: known.parameters,
                    covariance: known.covariance,
                },
                first: sighting,
                last: sighting,
                last_direction: known.last_direction,
                observations: known.observations,
                existence: Existence::from_log_odds(known.existence),
            },
        );
        self.next_id = known.id + 1;
    }

    /// Tentative features that `update` neither sees nor promotes and whose time is over.
    fn forgotten(&self, update: &CatalogueUpdate) -> Vec<u32> {
        let kept: BTreeSet<u32> = update
            .seen
            .iter()
            .map(|seen| seen.id)
            .chain(update.promoted.iter().copied())
            .collect();
        let is_over = |id: &u32| {
            let entry = self.entries.get(id);
            entry.is_some_and(|e| e.last.keyframe < update.forget_before)
        };
        self.tentative()
            .iter()
            .copied()
            .filter(|id| is_over(id) && !kept.contains(id))
            .collect()
    }

    /// Gives out identities from zero again, so that a test can make the forest refuse them.
    #[cfg(test)]
    pub(crate) fn restart_identities(&mut self) {
        self.next_id = 0;
    }
}

fn tentative_among(entries: &BTreeMap<u32, Entry>) -> BTreeSet<u32> {
    entries
        .iter()
        .filter(|(_, e)| e.stage == Stage::Tentative)
        .map(|(id, _)| *id)
        .collect()
}
