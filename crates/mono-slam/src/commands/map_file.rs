//! The map in which a run begins, and what must be known about it before its result is believed.

use std::path::Path;

use mono_slam::map_camera;
use slam_io::{Sequence, Warning, map_checksum, read_known_map};
use slam_pipeline::{KnownMap, MapUse};

use crate::failure::Failure;

/// A map with the use that is made of it.
#[derive(Debug)]
pub(crate) struct MapFile {
    /// The map.
    pub(crate) known: KnownMap,
    /// Whether the run changes it.
    pub(crate) usage: MapUse,
}

impl MapFile {
    /// The map at `path`.
    pub(crate) fn read(path: &Path, usage: MapUse) -> Result<Self, Failure> {
        Ok(Self {
            known: read_known_map(path)?,
            usage,
        })
    }

    /// Use and checksum, as the identity of a run has them.
    pub(crate) fn identity(&self) -> (&'static str, u32) {
        let usage = match self.usage {
            MapUse::Extend => "extended",
            MapUse::Localise => "localised in",
        };
        (usage, map_checksum(&self.known))
    }

    /// That which the map and the sequence do not have in common.
    pub(crate) fn warnings(&self, sequence: &Sequence) -> Vec<Warning> {
        let camera = sequence
            .camera
            .camera_and_mount()
            .ok()
            .and_then(|(camera, _)| map_camera::of_map(&self.known.camera, &camera));
        // The poses of a run in a map begin wherever in it the robot is.
        let reference = sequence.reference.is_some().then(|| {
            Warning::new(
                "reference-of-another-origin",
                "Poses are in the world of the map, the reference begins at the first frame of this sequence: the error \
                 without alignment means something only if both drives began at the same place; mono-slam eval --align \
                 se2 takes the difference out.",
            )
        });
        camera.into_iter().chain(reference).collect()
    }
}
