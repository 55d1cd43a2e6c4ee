//! The memory of the map, and the number of landmarks that a budget of bytes leaves room for.
//!
//! A landmark is an entry of the catalogue with two descriptors, a row of the index of places, an id among its neighbours, and
//! a place in the map of every particle. The maps share their nodes: landmarks out of view are in one map that all particles
//! share, those in view since the last common ancestor in one of each particle, and the states from which the recent path is
//! driven again hold earlier versions. All distinct nodes are counted, so that the sum follows what the particles have in
//! common; divided by the landmarks it is the price of one, about 0.95 kB where most are out of view. The path, its recent
//! measurements and the joint covariance of its keyframes are counted apart, because fewer landmarks make neither shorter.

use rbpf_core::SharedBytes;

use super::Slam;
use crate::filter::particle::Particle;
use crate::frontend::catalogue::Entry;

/// Landmarks that stay whatever the budget of bytes is: the least that `mapping.max_landmarks` may be.
const LEAST_LANDMARKS: usize = 50;
/// Bytes before an allocation and rounded up behind it, in the usual allocators.
const ALLOCATION: usize = 16;
/// Entries of a node of a B-tree in the mean, of eleven that it has room for.
const FILLED: f64 = 7.0 / 11.0;

/// Bytes of the parts of a system.
struct Bytes {
    /// Grow with the landmarks.
    landmarks: usize,
    /// Grow with the keyframes.
    path: usize,
}

impl Slam {
    /// Bytes of the map with the path that carries it, of all particles together: an estimate within some tenths.
    /// O(landmarks + distinct nodes of the maps).
    #[must_use]
    pub fn map_bytes(&self) -> usize {
        let bytes = self.bytes();
        bytes.landmarks + bytes.path
    }

    /// The number of landmarks that the configuration allows now.
    pub(super) fn allowed_landmarks(&self) -> usize {
        let most = self.config.mapping.max_landmarks as usize;
        let limit = 1e6 * self.config.mapping.max_megabytes;
        let mapped = self.state.catalogue.mapped();
        if limit == 0.0 || mapped == 0 {
            return most;
        }
        let bytes = self.bytes();
        let each = bytes.landmarks as f64 / mapped as f64;
        let room = ((limit - bytes.path as f64) / each) as usize;
        most.min(room.max(LEAST_LANDMARKS))
    }

    fn bytes(&self) -> Bytes {
        let state = &self.state;
        let (mut maps, mut paths) = (SharedBytes::default(), SharedBytes::default());
        let mut count = |particle: &Particle| {
            maps.add(&particle.map);
            paths.add_path(&particle.path);
        };
        for particle in state.filter.set().particles() {
            count(particle);
            if let Some(earlier) = &particle.origin {
                count(earlier);
            }
        }
        // What the recent path is driven again with.
        let steps = state.window.steps.iter();
        let measured: usize = steps.map(|s| size_of_val(&*s.observation.matches)).sum();
        let descriptor = size_of::<[u8; 128]>() + ALLOCATION;
        let entry = (size_of::<(u32, Entry)>() as f64 / FILLED) as usize + 2 * descriptor;
        // The ids by groups of anchors.
        let grouped = (size_of::<u32>() as f64 / FILLED) as usize;
        Bytes {
            landmarks: maps.bytes()
                + state.catalogue.len() * (entry + grouped)
                + state.places.memory_usage(),
            path: paths.bytes() + state.drift.memory_usage() + size_of_val(&*state.path) + measured,
        }
    }
}
