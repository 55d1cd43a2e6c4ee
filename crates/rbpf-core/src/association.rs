//! Which landmark is it? For every particle on its own, by maximum likelihood.
//!
//! Every measurement of a scan is compared with every landmark in reach, at the predicted pose,
//!
//! ```text
//! S = H P H^T + V + R,   d^2 = (z - z^)^T S^-1 (z - z^)
//! ```
//!
//! P the motion covariance, V the landmark's, by sigma points. Pairs with d^2 within the gate are taken in order
//! of log N(z; z^, S), each measurement and each landmark once. What is left is a new landmark
//! if d^2 is beyond `new_landmark` for all, and ignored if not: it may be a landmark measured badly. Either way the particle
//! pays the density `log_new`, so that particles that name different things compare.
//!
//! Greedy, not jointly optimal: where landmarks stand closer than the gate is wide, two may be exchanged, in some
//! particles. Cost per particle: O(landmarks in reach) times (2 D + 2 K + 1) predictions and the measurements.

use crate::error::RbpfError;
use crate::factor::{Factor, symmetric};
use crate::filter::{MapUpdate, Proposal};
use crate::landmark_filter::LandmarkFilter;
use crate::landmark_particle::{LandmarkMapping, LandmarkParticle};
use crate::models::{
    FieldOfView, Frame, Gaussian, MotionModel, ObservationModel, PoseAndMap, check_measurement,
};
use crate::proposal::{checked_noise, residual};
use crate::unscented::Spread;
use nalgebra::SVector;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeSet;

/// What a frame brings when nobody knows the landmarks by name.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan<C, const M: usize> {
    /// u.
    pub control: C,
    /// What was measured.
    pub measurements: Vec<SVector<f64, M>>,
}

/// A particle that names what it sees. D, K, M: sizes of pose, landmark, measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct NamingParticle<const D: usize, const K: usize, const M: usize> {
    /// Pose, path and map; ids are this particle's own.
    pub particle: LandmarkParticle<D, K>,
    next_id: u32,
    /// What the present scan was taken for.
    named: Vec<(u32, SVector<f64, M>)>,
}

impl<const D: usize, const K: usize, const M: usize> NamingParticle<D, K, M> {
    /// From a particle that may already hold landmarks.
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
}

impl<const D: usize, const K: usize, const M: usize> PoseAndMap<D, K> for NamingParticle<D, K, M> {
    fn pose(&self) -> SVector<f64, D> {
        self.particle.pose
    }

    fn set_pose(&mut self, pose: SVector<f64, D>) {
        self.particle.set_pose(pose);
    }

    fn landmark(&self, id: u32) -> Option<Gaussian<K>> {
        self.particle.landmark(id)
    }
}

/// When a measurement is of a landmark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssociationRules {
    /// d^2 up to which a measurement may be of a landmark: a chi-square quantile of M degrees of freedom.
    pub gate: f64,
    /// d^2 to every landmark beyond which it is of a new one; at least `gate`.
    pub new_landmark: f64,
    /// Log density of a measurement of no landmark in the map: about minus the logarithm of the volume in which
    /// measurements fall, in the units of z.
    pub log_new: f64,
}

/// Names the measurements, then lets `inner` propose with the names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Associating<A, B, I> {
    /// p(s | s_prev, u).
    pub motion: A,
    /// p(z | s, landmark), and what it can see.
    pub sensor: B,
    /// The proposal for named measurements.
    pub inner: I,
    /// When a measurement is of a landmark.
    pub rules: AssociationRules,
}

impl<A, B, I, const D: usize, const K: usize, const M: usize>
    Proposal<NamingParticle<D, K, M>, Scan<A::Control, M>> for Associating<A, B, I>
where
    A: MotionModel<D, Control: Clone>,
    B: ObservationModel<D, K, M> + FieldOfView<D, K>,
    I: Proposal<LandmarkParticle<D, K>, Frame<A::Control, M>, Error = RbpfError>,
{
    type Error = RbpfError;

    fn propose(
        &self,
        naming: &mut NamingParticle<D, K, M>,
        scan: &Scan<A::Control, M>,
        rng: &mut ChaCha8Rng,
    ) -> Result<f64, RbpfError> {
        for (place, measured) in (0..).zip(&scan.measurements) {
            check_measurement(place, measured)?;
        }
        let predicted = self.motion.predict(&naming.particle.pose, &scan.control);
        let names = self.name(&naming.particle, &predicted, &scan.measurements)?;
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
        predicted: &Gaussian<D>,
        measurements: &[SVector<f64, M>],
    ) -> Result<Vec<Name>, RbpfError>
    where
        A: MotionModel<D>,
        B: ObservationModel<D, K, M> + FieldOfView<D, K>,
    {
        let sensor = &self.sensor;
        let noise = checked_noise(sensor)?;
        let root = Factor::definite(&predicted.covariance, "motion model")?;
        let pose = &predicted.mean;
        let mean = SVector::zeros();
        let about = Spread { mean, root };
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
            let factor = Factor::definite(&covariance, "innovation")?;
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

/// Log-odds of existence, and when a landmark is dropped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExistenceRules {
    /// Added for being seen.
    pub seen: f64,
    /// Added, so below zero, for being expected and not seen.
    pub missed: f64,
    /// Log-odds never rise above.
    pub highest: f64,
    /// A landmark is removed below.
    pub lowest: f64,
}

/// Updates what was named, and doubts what should have been seen and was not. O(M) a particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DoubtingMapping<S, F> {
    /// Sensor and landmark filter.
    pub mapping: LandmarkMapping<S, F>,
    /// Log-odds.
    pub existence: ExistenceRules,
}

impl<S, F, C, const D: usize, const K: usize, const M: usize>
    MapUpdate<NamingParticle<D, K, M>, Scan<C, M>> for DoubtingMapping<S, F>
where
    S: FieldOfView<D, K>,
    F: LandmarkFilter<S, D, K, M>,
{
    type Error = RbpfError;

    fn update_map(
        &self,
        naming: &mut NamingParticle<D, K, M>,
        _: &Scan<C, M>,
    ) -> Result<(), RbpfError> {
        let frame = Frame {
            control: (),
            measurements: std::mem::take(&mut naming.named),
        };
        let particle = &mut naming.particle;
        self.mapping.update_map(particle, &frame)?;
        let rules = &self.existence;
        let seen: BTreeSet<u32> = frame.measurements.iter().map(|(id, _)| *id).collect();
        for id in &seen {
            if let Some(landmark) = particle.map.get_mut(*id) {
                landmark.existence = (landmark.existence + rules.seen).min(rules.highest);
            }
        }
        let missed: Vec<u32> = particle
            .map
            .iter()
            .filter(|(id, landmark)| {
                !seen.contains(id)
                    && self
                        .mapping
                        .sensor
                        .expects(&particle.pose, &landmark.position.mean)
            })
            .map(|(id, _)| id)
            .collect();
        for id in missed {
            let Some(landmark) = particle.map.get_mut(id) else {
                continue;
            };
            landmark.existence += rules.missed;
            if landmark.existence < rules.lowest {
                particle.map.remove(id);
            }
        }
        Ok(())
    }
}
