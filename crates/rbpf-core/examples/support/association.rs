//! Which landmark is it? For every particle on its own, by maximum likelihood.

use super::planar::{Mapping, Particle, RangeBearing, jacobians, measure};
use nalgebra::{Vector2, Vector3};
use rand_chacha::ChaCha8Rng;
use rbpf_core::{
    CowMap, Frame, Gaussian, MapUpdate, MotionModel, ObservationModel, PoseAndMap, Proposal,
    RbpfError,
};

/// Range and bearing of things without names.
#[derive(Clone, Debug)]
pub(crate) struct Unnamed<C> {
    /// u.
    pub(crate) control: C,
    /// Range in metres, bearing in radians.
    pub(crate) measurements: Vec<Vector2<f64>>,
}

/// A particle that names what it sees.
#[derive(Clone, Debug)]
pub(crate) struct Namer {
    /// Pose and map.
    pub(crate) particle: Particle,
    /// Log-odds of the existence of each landmark.
    existence: CowMap<f64>,
    /// The next free id.
    next: u32,
    /// What the measurements of the present frame were taken for.
    named: Vec<(u32, Vector2<f64>)>,
}

impl Namer {
    /// Without landmarks.
    pub(crate) const fn new(particle: Particle) -> Self {
        Self {
            particle,
            existence: CowMap::new(),
            next: 0,
            named: Vec::new(),
        }
    }
}

impl PoseAndMap<3, 2> for Namer {
    fn pose(&self) -> Vector3<f64> {
        self.particle.pose
    }

    fn set_pose(&mut self, pose: Vector3<f64>) {
        self.particle.pose = pose;
    }

    fn landmark(&self, id: u32) -> Option<Gaussian<2>> {
        self.particle.map.get(id).copied()
    }
}

/// When a measurement is of a landmark, and what follows from not being measured.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rules {
    /// d^2 below which a measurement may be of a landmark.
    pub(crate) gate: f64,
    /// d^2 to every landmark above which it is of a new one; between the two it is ignored.
    pub(crate) new_landmark: f64,
    /// log density of a measurement that belongs to no landmark of the map: about one over the area of
    /// the field of view in metres and radians.
    pub(crate) log_clutter: f64,
    /// Landmarks farther than this are not looked for, metres.
    pub(crate) farthest: f64,
    /// Within this range (metres) and bearing (radians) a landmark should be seen.
    pub(crate) visible: [f64; 2],
    /// Log-odds added for being seen and for not being seen.
    pub(crate) existence: [f64; 2],
}

/// Log-odds stay below.
const SUREST: f64 = 8.0;
/// A landmark is dropped below these log-odds.
const DROPPED: f64 = -1.0;

/// Names the measurements, then lets `inner` propose with the names.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Associating<A, I> {
    pub(crate) motion: A,
    pub(crate) sensor: RangeBearing,
    pub(crate) inner: I,
    pub(crate) rules: Rules,
}

impl<A, I> Proposal<Namer, Unnamed<A::Control>> for Associating<A, I>
where
    A: MotionModel<3, Control: Clone + Sync>,
    I: Proposal<Particle, Frame<A::Control, 2>, Error = RbpfError>,
{
    type Error = RbpfError;

    fn propose(
        &self,
        namer: &mut Namer,
        scan: &Unnamed<A::Control>,
        rng: &mut ChaCha8Rng,
    ) -> Result<f64, RbpfError> {
        let predicted = self.motion.predict(&namer.particle.pose, &scan.control);
        let mut nearest = vec![f64::INFINITY; scan.measurements.len()];
        let mut candidates = Vec::new();
        for (id, landmark) in &namer.particle.map {
            let expected = measure(&predicted.mean, &landmark.mean);
            if expected.x > self.rules.farthest {
                continue;
            }
            let (of_pose, of_landmark) = jacobians(&predicted.mean, &landmark.mean);
            let s = of_pose * predicted.covariance * of_pose.transpose()
                + of_landmark * landmark.covariance * of_landmark.transpose()
                + self.sensor.noise();
            let factor = s
                .cholesky()
                .ok_or(RbpfError::NotFinite { what: "innovation" })?;
            let log_determinant = 2.0 * (factor.l()[(0, 0)] * factor.l()[(1, 1)]).ln();
            for (index, measured) in scan.measurements.iter().enumerate() {
                let difference = self.sensor.innovation(measured, &expected);
                let squared = difference.dot(&factor.solve(&difference));
                nearest[index] = nearest[index].min(squared);
                if squared < self.rules.gate {
                    candidates.push((squared + log_determinant, index, id));
                }
            }
        }
        // likeliest pairs first; each measurement and each landmark once
        candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut names = vec![None; scan.measurements.len()];
        for (_, index, id) in candidates {
            if names[index].is_none() && !names.contains(&Some(id)) {
                names[index] = Some(id);
            }
        }
        let mut log_clutter = 0.0;
        let mut named = Vec::with_capacity(names.len());
        for ((name, measured), nearest) in names.into_iter().zip(&scan.measurements).zip(nearest) {
            if let Some(id) = name {
                named.push((id, *measured));
                continue;
            }
            log_clutter += self.rules.log_clutter;
            if nearest > self.rules.new_landmark {
                named.push((namer.next, *measured));
                namer.next += 1;
            }
        }
        let frame = Frame {
            control: scan.control.clone(),
            measurements: named,
        };
        let log_weight = self.inner.propose(&mut namer.particle, &frame, rng)?;
        namer.named = frame.measurements;
        Ok(log_weight + log_clutter)
    }
}

/// Updates what was named, and doubts what should have been seen and was not.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DoubtingMapping {
    pub(crate) mapping: Mapping,
    pub(crate) rules: Rules,
}

impl<C: Sync> MapUpdate<Namer, Unnamed<C>> for DoubtingMapping {
    type Error = RbpfError;

    fn update_map(&self, namer: &mut Namer, _: &Unnamed<C>) -> Result<(), RbpfError> {
        let frame = Frame {
            control: (),
            measurements: std::mem::take(&mut namer.named),
        };
        self.mapping.update_map(&mut namer.particle, &frame)?;
        let [seen, missed] = self.rules.existence;
        for &(id, _) in &frame.measurements {
            let odds = namer.existence.get(id).copied().unwrap_or(0.0);
            namer.existence.insert(id, (odds + seen).min(SUREST));
        }
        let [range, bearing] = self.rules.visible;
        let missing: Vec<u32> = namer
            .particle
            .map
            .iter()
            .filter(|&(id, landmark)| {
                let expected = measure(&namer.particle.pose, &landmark.mean);
                expected.x < range
                    && expected.y.abs() < bearing
                    && frame.measurements.iter().all(|&(named, _)| named != id)
            })
            .map(|(id, _)| id)
            .collect();
        for id in missing {
            let odds = namer.existence.get(id).copied().unwrap_or(0.0) + missed;
            if odds < DROPPED {
                namer.existence.remove(id);
                namer.particle.map.remove(id);
            } else {
                namer.existence.insert(id, odds);
            }
        }
        Ok(())
    }
}
