//! Unknown association: each particle names its measurements, by maximum likelihood.
//!
//! Every measurement of a scan is compared with every landmark in reach, at the predicted pose,
//!
//! ```text
//! S = H P H^T + V + R,   d^2 = (z - z^)^T S^-1 (z - z^)
//! ```
//!
//! where P is the covariance of the motion and V that of the landmark, both by sigma points. Pairs with
//! d^2 within the gate are taken in the order of log N(z; z^, S), each measurement and each landmark
//! once. A measurement that is left over is of a new landmark if its d^2 is beyond `new_landmark` for
//! all landmarks; otherwise it is ignored, since it may be a poor measurement of a known one. Either way
//! the particle pays the density `log_new`, so that particles that name different things compare.
//!
//! The order is greedy, not jointly optimal: where landmarks stand closer than the gate is wide, two may
//! be exchanged in some particles. The cost per particle is O(landmarks in reach) times 2 D + 2 K + 1
//! predictions and the number of measurements.

use crate::covariance::definite;
use crate::error::RangeBearingError;
use crate::frame::{Frame, Scan, check_measurement};
use crate::innovation::{checked_noise, residual};
use crate::landmark_particle::LandmarkParticle;
use crate::models::{FieldOfView, MotionModel, ObservationModel};
use crate::proposal::prior::MotionPrior;
use crate::spread::Spread;
use estimation_base::symmetric;
use nalgebra::SVector;
use rand_chacha::ChaCha8Rng;
use rbpf_core::Proposal;
use std::collections::BTreeSet;

/// A particle that names its measurements. D, K and M are the dimensions of pose, landmark and
/// measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct NamingParticle<const D: usize, const K: usize, const M: usize> {
    /// Pose, path and map. The ids of the landmarks are this particle's own.
    pub particle: LandmarkParticle<D, K>,
    next_id: u32,
    /// The named measurements of the present scan.
    named: Vec<(u32, SVector<f64, M>)>,
}

impl<const D: usize, const K: usize, const M: usize> NamingParticle<D, K, M> {
    /// A particle that may already hold landmarks.
    #[must_use]
    pub fn new(particle: LandmarkParticle<D, K>) -> Self {
        let next_id = particle.map.ids().last().map_or(0, |id| id + 1);
        Self {
            particle,
            next_id,
            named: Vec::new(),
        }
    }

    /// Ids and measurements of the scan proposed last, until the map update uses them up.
    #[must_use]
    pub fn named(&self) -> &[(u32, SVector<f64, M>)] {
        &self.named
    }

    /// Takes the named measurements for the map update.
    pub(crate) fn take_named(&mut self) -> Vec<(u32, SVector<f64, M>)> {
        std::mem::take(&mut self.named)
    }
}

/// The rules by which a measurement is named.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssociationRules {
    /// The d^2 up to which a measurement may be of a landmark: a chi-square quantile of M degrees of
    /// freedom.
    pub gate: f64,
    /// The d^2 to every landmark beyond which a measurement is of a new one; at least `gate`.
    pub new_landmark: f64,
    /// Log density of a measurement of no landmark in the map: about minus the logarithm of the volume
    /// in which measurements fall, in the units of z.
    pub log_new: f64,
}

/// The proposal for unknown association: names the measurements, then lets `inner` propose with the
/// names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Associating<A, B, I> {
    /// The motion p(s | s_prev, u).
    pub motion: A,
    /// The measurement p(z | s, landmark), and the field of view.
    pub sensor: B,
    /// The proposal for named measurements.
    pub inner: I,
    /// The rules by which a measurement is named.
    pub rules: AssociationRules,
}

impl<A, B, I, const D: usize, const K: usize, const M: usize>
    Proposal<NamingParticle<D, K, M>, Scan<A::Control, M>> for Associating<A, B, I>
where
    A: MotionModel<D, Control: Clone>,
    B: ObservationModel<D, K, M> + FieldOfView<D, K>,
    I: Proposal<LandmarkParticle<D, K>, Frame<A::Control, M>, Error = RangeBearingError>,
{
    type Error = RangeBearingError;

    fn propose(
        &self,
        naming: &mut NamingParticle<D, K, M>,
        scan: &Scan<A::Control, M>,
        rng: &mut ChaCha8Rng,
    ) -> Result<f64, RangeBearingError> {
        for (place, measured) in (0..).zip(&scan.measurements) {
            check_measurement(place, measured)?;
        }
        let prior = MotionPrior::of(&self.motion, &naming.particle.pose, &scan.control)?;
        let names = self.name(&naming.particle, &prior, &scan.measurements)?;
        let mut next_id = naming.next_id;
        let mut log_new = 0.0;
        let mut named = Vec::with_capacity(names.len());
        for (name, measured) in names.into_iter().zip(&scan.measurements) {
            match name {
                Name::Landmark(id) => named.push((id, *measured)),
                Name::New => {
                    named.push((next_id, *measured));
                    next_id += 1;
                    log_new += self.rules.log_new;
                }
                Name::Unclear => log_new += self.rules.log_new,
            }
        }
        let frame = Frame {
            control: scan.control.clone(),
            measurements: named,
        };
        let log_weight = self.inner.propose(&mut naming.particle, &frame, rng)?;
        naming.named = frame.measurements;
        naming.next_id = next_id;
        Ok(log_weight + log_new)
    }
}

/// The outcome for one measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Name {
    Landmark(u32),
    New,
    Unclear,
}

impl<A, B, I> Associating<A, B, I> {
    fn name<const D: usize, const K: usize, const M: usize>(
        &self,
        particle: &LandmarkParticle<D, K>,
        prior: &MotionPrior<D>,
        measurements: &[SVector<f64, M>],
    ) -> Result<Vec<Name>, RangeBearingError>
    where
        A: MotionModel<D>,
        B: ObservationModel<D, K, M> + FieldOfView<D, K>,
    {
        let sensor = &self.sensor;
        let noise = checked_noise(sensor)?;
        let pose = &prior.pose;
        let about = Spread {
            mean: SVector::zeros(),
            root: prior.factor,
        };
        let pose_at = |tangent: &_| self.motion.retract(pose, tangent);
        let mut nearest = vec![f64::INFINITY; measurements.len()];
        let mut pairs = Vec::new();
        for (id, landmark) in &particle.map {
            let position = &landmark.position.mean;
            if !sensor.reaches(pose, position) {
                continue;
            }
            let Some(expected) = sensor.predict(pose, position) else {
                continue;
            };
            // residuals against the measurement expected at the mean: zero there
            let from = |pose: &_, at: &_| residual(sensor, pose, at, &expected);
            let spread = Spread::of(&landmark.position, "landmark")?;
            let (Some(of_pose), Some(of_landmark)) = (
                about.through(|tangent| from(&pose_at(tangent), position))?,
                spread.through(|at| from(pose, at))?,
            ) else {
                continue;
            };
            let covariance = symmetric(&(of_pose.covariance + of_landmark.covariance + noise));
            let factor = definite(&covariance, "innovation")?;
            for (place, measured) in measurements.iter().enumerate() {
                let innovation = sensor.innovation(measured, &expected);
                let squared = factor.mahalanobis_squared(&innovation);
                nearest[place] = f64::min(nearest[place], squared);
                if squared <= self.rules.gate {
                    pairs.push((factor.log_density(&innovation), place, id));
                }
            }
        }
        pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut names: Vec<Name> = nearest
            .iter()
            .map(|squared| {
                if *squared > self.rules.new_landmark {
                    Name::New
                } else {
                    Name::Unclear
                }
            })
            .collect();
        let mut taken = BTreeSet::new();
        for (_, place, id) in pairs {
            if !matches!(names[place], Name::Landmark(_)) && taken.insert(id) {
                names[place] = Name::Landmark(id);
            }
        }
        Ok(names)
    }
}
