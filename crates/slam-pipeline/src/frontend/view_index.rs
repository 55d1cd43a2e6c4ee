//! Which landmarks of a map may be in view, without a look at the others.
//!
//! Landmarks are grouped by the keyframe they are anchored in, whose camera saw them all at once; points, which have no
//! anchor, by their ids. A group keeps a box of the parameters of its landmarks in the map that the index follows, in the
//! anchor's own axes: nothing in it changes when the path behind the anchor is corrected. Near and far landmarks have a box
//! each, because one landmark at infinity would stretch the box of the others to the horizon.
//!
//! The index follows one map, that of the reference particle. It holds a copy of that map (which is a pointer) and learns
//! what has changed by comparing memory ([`CowMap::changes_since`]), so it need not be told of updates, removals, another
//! reference, a path driven again or a map that was loaded. For a map that it does not follow it knows nothing, and says so.
//!
//! Cost: following is linear in what has changed; a search is linear in the number of groups with some thirty operations each,
//! and in the landmarks of the groups that may be in view.

use std::collections::{BTreeMap, BTreeSet};

use mono_geometry::inverse_depth::LandmarkGeometry;
use rbpf_core::CowMap;

use super::frustum::{Extent, Frustum};
use crate::filter::landmark::Landmark;
use crate::filter::particle::Particle;

/// Points of so many consecutive ids are a group.
const POINTS_IN_A_GROUP: u32 = 32;
/// A landmark is far below this inverse depth, one over the particle's unit.
const FAR: f64 = 0.1;

/// The key of a group.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Key {
    /// Keyframe of the anchor.
    Anchor(u32),
    /// First of the ids.
    Points(u32),
}

impl Key {
    fn of(id: u32, landmark: &Landmark) -> Self {
        landmark
            .anchor()
            .map_or(Self::Points(id - id % POINTS_IN_A_GROUP), Self::Anchor)
    }
}

/// Landmarks that are tested together.
#[derive(Debug, Clone)]
struct Group {
    ids: BTreeSet<u32>,
    near: Extent,
    far: Extent,
}

/// The landmarks of one map by groups.
#[derive(Debug, Clone, Default)]
pub(crate) struct ViewIndex {
    followed: CowMap<Landmark>,
    groups: BTreeMap<Key, Group>,
}

impl ViewIndex {
    /// Whether the index knows `map`.
    #[must_use]
    pub(crate) fn follows(&self, map: &CowMap<Landmark>) -> bool {
        self.followed.is_same_memory(map)
    }

    /// Learns `map`. O(what differs from the map followed before).
    pub(crate) fn follow(&mut self, map: &CowMap<Landmark>) {
        if self.follows(map) {
            return;
        }
        let mut touched = BTreeSet::new();
        let groups = &mut self.groups;
        map.changes_since(&self.followed, &mut |id, old, new| {
            let [old, new] = [old, new].map(|landmark| Some(Key::of(id, landmark?)));
            if let Some(old) = old.filter(|old| Some(*old) != new) {
                if let Some(group) = groups.get_mut(&old) {
                    group.ids.remove(&id);
                }
                touched.insert(old);
            }
            if let Some(new) = new {
                let group = groups.entry(new).or_insert_with(|| Group {
                    ids: BTreeSet::new(),
                    near: Extent::EMPTY,
                    far: Extent::EMPTY,
                });
                group.ids.insert(id);
                touched.insert(new);
            }
        });
        for key in touched {
            let Some(group) = self.groups.get_mut(&key) else {
                continue;
            };
            if group.ids.is_empty() {
                self.groups.remove(&key);
                continue;
            }
            (group.near, group.far) = (Extent::EMPTY, Extent::EMPTY);
            for landmark in group.ids.iter().filter_map(|id| map.get(*id)) {
                let is_far = landmark.anchor().is_some() && landmark.mean.z < FAR;
                let extent = if is_far {
                    &mut group.far
                } else {
                    &mut group.near
                };
                extent.include(&landmark.mean);
            }
        }
        self.followed = map.clone();
    }

    /// The landmarks of `reference` that may be in view: all that are, and few that are not. Its map must be the one
    /// followed. In no particular order.
    pub(crate) fn candidates(&self, reference: &Particle, frustum: &Frustum, ids: &mut Vec<u32>) {
        for (key, group) in &self.groups {
            let geometry = match key {
                Key::Anchor(anchor) => match reference.path.get(*anchor as usize) {
                    Some(keyframe) => LandmarkGeometry::InverseDepth {
                        anchor: keyframe.camera,
                    },
                    None => continue,
                },
                Key::Points(_) => LandmarkGeometry::Point,
            };
            let seen = frustum.view(&geometry);
            if !frustum.may_see(&seen, &group.near) && !frustum.may_see(&seen, &group.far) {
                continue;
            }
            ids.extend(group.ids.iter().filter(|id| {
                reference
                    .map
                    .get(**id)
                    .is_some_and(|l| frustum.may_see(&seen, &Extent::of(&l.mean)))
            }));
        }
    }
}

#[cfg(test)]
mod tests;
