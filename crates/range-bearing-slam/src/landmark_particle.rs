//! The particle of a landmark map, and the map update of a frame with known association.

use crate::error::RangeBearingError;
use crate::frame::Frame;
use crate::landmark_filter::LandmarkFilter;
use crate::models::Gaussian;
use nalgebra::SVector;
use rbpf_core::{CowMap, MapUpdate, PersistentPath};

/// A landmark of one particle. K is the dimension of its position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmark<const K: usize> {
    /// Its position, given the particle's path.
    pub position: Gaussian<K>,
    /// Log-odds that it exists, 0 when it is started.
    pub existence: f64,
}

/// A particle with pose, path and landmark map; a clone is O(1) and shares path and map. D and K are
/// the dimensions of pose and landmark.
#[derive(Clone, Debug, PartialEq)]
pub struct LandmarkParticle<const D: usize, const K: usize> {
    /// The present pose.
    pub pose: SVector<f64, D>,
    /// The pose before it, from which the last motion set out.
    pub previous_pose: SVector<f64, D>,
    /// The final poses of the frames so far.
    pub path: PersistentPath<SVector<f64, D>>,
    /// Landmarks by id.
    pub map: CowMap<Landmark<K>>,
}

impl<const D: usize, const K: usize> LandmarkParticle<D, K> {
    /// A particle at `pose`, with an empty path and an empty map.
    #[must_use]
    pub const fn new(pose: SVector<f64, D>) -> Self {
        Self {
            pose,
            previous_pose: pose,
            path: PersistentPath::new(),
            map: CowMap::new(),
        }
    }

    /// Takes the pose that is proposed for a frame; the present pose becomes the previous one. The path
    /// takes its pose in the map update.
    pub fn set_pose(&mut self, pose: SVector<f64, D>) {
        self.previous_pose = self.pose;
        self.pose = pose;
    }
}

/// The map update for known association: appends the final pose to the path, updates the measured
/// landmarks that the particle holds and starts the others. O(n log16 M) for n measurements and M
/// landmarks.
///
/// ```
/// use nalgebra::{Vector2, Vector3};
/// use range_bearing_slam::{
///     Deviation, ExtendedLandmarks, ExtendedProposal, Frame, LandmarkMapping, LandmarkParticle,
///     Linearisation, ObservationModel, Propagation, RangeBearing, Unicycle,
/// };
/// use rbpf_core::{FilterConfig, NoRejuvenation, ParticleFilter, ParticleSet, Streams};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let sensor = RangeBearing::new(0.1, 0.02); // standard deviations in metres and radians
/// let noise = Deviation { fixed: 0.01, share: 0.1 };
/// let motion = Unicycle {
///     speed: noise,
///     turn_rate: noise,
///     floor: [1e-3; 3],
///     propagation: Propagation::Jacobians,
/// };
/// let linearisation = Linearisation::Sequential;
/// let proposal = ExtendedProposal { motion, sensor, linearisation };
/// let mapping = LandmarkMapping { sensor, filter: ExtendedLandmarks };
///
/// let start = LandmarkParticle::<3, 2>::new(Vector3::zeros());
/// let set = ParticleSet::new(vec![start; 20])?;
/// let mut filter = ParticleFilter::new(set, Streams::new(1), FilterConfig::default())?;
/// let tree = Vector2::new(4.0, 3.0);
/// let measured = sensor.predict(&Vector3::zeros(), &tree).ok_or("not at the sensor")?;
/// for time in 0..10 {
///     let frame = Frame { control: vec![], measurements: vec![(7, measured)] };
///     filter.step(time, &frame, &proposal, &NoRejuvenation, &mapping)?;
/// }
/// let best = &filter.set().particles()[filter.set().best()];
/// let landmark = best.map.get(7).ok_or("in the map")?;
/// assert!((landmark.position.mean - tree).norm() < 0.1);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LandmarkMapping<S, F> {
    /// The sensor.
    pub sensor: S,
    /// The filter that starts and updates a landmark.
    pub filter: F,
}

impl<S, F, C, const D: usize, const K: usize, const M: usize>
    MapUpdate<LandmarkParticle<D, K>, Frame<C, M>> for LandmarkMapping<S, F>
where
    S: Sync,
    F: LandmarkFilter<S, D, K, M>,
{
    type Error = RangeBearingError;

    fn update_map(
        &self,
        particle: &mut LandmarkParticle<D, K>,
        frame: &Frame<C, M>,
    ) -> Result<(), RangeBearingError> {
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
