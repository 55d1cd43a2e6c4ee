//! The particle of a landmark map, and the map update of a frame.

use crate::error::RbpfError;
use crate::filter::MapUpdate;
use crate::history::PersistentPath;
use crate::landmark_filter::LandmarkFilter;
use crate::landmark_map::CowMap;
use crate::models::{Frame, Gaussian, PoseAndMap};
#[cfg(feature = "es-evolve")]
use crate::rejuvenation::MovablePose;
use nalgebra::SVector;

/// A landmark of one particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmark<const K: usize> {
    /// Where it is, given the particle's path.
    pub position: Gaussian<K>,
    /// Log-odds that it exists; 0 when started.
    pub existence: f64,
}

/// Pose, path and map; a clone is O(1) and shares path and map.
/// D, K: dimensions of pose and landmark.
#[derive(Clone, Debug, PartialEq)]
pub struct LandmarkParticle<const D: usize, const K: usize> {
    /// The present pose.
    pub pose: SVector<f64, D>,
    /// The one before it, from which the last motion set out.
    pub previous_pose: SVector<f64, D>,
    /// The final poses of the frames so far.
    pub path: PersistentPath<SVector<f64, D>>,
    /// Landmarks by id.
    pub map: CowMap<Landmark<K>>,
}

impl<const D: usize, const K: usize> LandmarkParticle<D, K> {
    /// At `pose`, with an empty map.
    #[must_use]
    pub const fn new(pose: SVector<f64, D>) -> Self {
        Self {
            pose,
            previous_pose: pose,
            path: PersistentPath::new(),
            map: CowMap::new(),
        }
    }
}

impl<const D: usize, const K: usize> PoseAndMap<D, K> for LandmarkParticle<D, K> {
    fn pose(&self) -> SVector<f64, D> {
        self.pose
    }

    fn set_pose(&mut self, pose: SVector<f64, D>) {
        self.previous_pose = self.pose;
        self.pose = pose;
    }

    fn landmark(&self, id: u32) -> Option<Gaussian<K>> {
        self.map.get(id).map(|landmark| landmark.position)
    }
}

#[cfg(feature = "es-evolve")]
impl<const D: usize, const K: usize> MovablePose<D, K> for LandmarkParticle<D, K> {
    fn previous_pose(&self) -> SVector<f64, D> {
        self.previous_pose
    }

    fn replace_pose(&mut self, pose: SVector<f64, D>) {
        self.pose = pose;
    }
}

/// Appends the final pose to the path, updates the measured landmarks the particle holds and starts the
/// others. O(matches log16 M).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LandmarkMapping<S, F> {
    /// The sensor.
    pub sensor: S,
    /// How a landmark is started and updated.
    pub filter: F,
}

impl<S, F, C, const D: usize, const K: usize, const M: usize>
    MapUpdate<LandmarkParticle<D, K>, Frame<C, M>> for LandmarkMapping<S, F>
where
    S: Sync,
    F: LandmarkFilter<S, D, K, M>,
{
    type Error = RbpfError;

    fn update_map(
        &self,
        particle: &mut LandmarkParticle<D, K>,
        frame: &Frame<C, M>,
    ) -> Result<(), RbpfError> {
        frame.check()?;
        let pose = particle.pose;
        for (id, measured) in &frame.measurements {
            if let Some(landmark) = particle.map.get_mut(*id) {
                let prior = &landmark.position;
                if let Some(update) = self.filter.update(&self.sensor, &pose, measured, prior)? {
                    landmark.position = update.posterior;
                }
            } else if let Some(position) = self.filter.start(&self.sensor, &pose, measured)? {
                let existence = 0.0;
                let landmark = Landmark {
                    position,
                    existence,
                };
                particle.map.insert(*id, landmark);
            }
        }
        particle.path.push(pose);
        Ok(())
    }
}
