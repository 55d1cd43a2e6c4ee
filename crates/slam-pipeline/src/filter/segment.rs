//! The recent path of a particle, with all that is needed to drive it again.
//!
//! A particle remembers its own state at two earlier keyframes, *older* and *newer*, and the log density of its path since
//! then, log p(z | x, map) + log p(x | x_{t-1}, u) summed over the keyframes. From the older state and the observations
//! since ([`WindowStep`]) any other path can be tried: [`SegmentDriver::drive`] gives the particle that would be here had it
//! taken that path, map and metric state included, and its log density. Snapshots share their maps with the particle.

use core::f64::consts::TAU;
use std::sync::Arc;

use rbpf_core::MapUpdate as _;

use super::landmark::InverseDepthPrior;
use super::likelihood::Likelihood;
use super::mapping::Mapping;
use super::motion::{CarrierModel, MotionPrior};
use super::observation::FrameObservation;
use super::particle::{Drawn, Particle};
use super::pose::{CameraPose, PoseMatrix};
use crate::rig::Rig;

/// The earlier states of a particle and the log densities of its path since.
#[derive(Debug, Clone, Default)]
pub(crate) struct Segment {
    /// The state at the beginning of the window.
    pub(crate) older: Option<Origin>,
    /// The state at its middle.
    pub(crate) newer: Option<Origin>,
}

/// An earlier state of a particle.
#[derive(Debug, Clone)]
pub(crate) struct Origin {
    /// The particle as it was, without earlier states of its own.
    pub(crate) particle: Arc<Particle>,
    /// Log density of the path since.
    pub(crate) log_density: f64,
}

impl Origin {
    /// The present state of `particle`, with no path since.
    #[must_use]
    pub(crate) fn of(particle: &Particle) -> Self {
        Self {
            particle: Arc::new(Particle {
                segment: Segment::default(),
                prior: None,
                ..particle.clone()
            }),
            log_density: 0.0,
        }
    }
}

impl Segment {
    /// Adds the log density of one more keyframe.
    pub(crate) fn add(&mut self, log_density: f64) {
        for origin in [&mut self.older, &mut self.newer].into_iter().flatten() {
            origin.log_density += log_density;
        }
    }
}

/// A keyframe of the window.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct WindowStep {
    /// Its measurements.
    pub(crate) observation: FrameObservation,
    /// The carrier with the process noise that was in force.
    pub(crate) carrier: CarrierModel,
}

/// Log density of a pose under its prior and a likelihood: what one keyframe adds to the density of a path.
#[must_use]
pub(crate) fn log_step_density(prior: &MotionPrior, pose: &CameraPose, log_likelihood: f64) -> f64 {
    let log_det: f64 = prior.factor.diagonal().iter().map(|d| d.ln()).sum();
    log_likelihood + prior.log_density(pose)
        - log_det
        - 0.5 * prior.factor.nrows() as f64 * TAU.ln()
}

/// Drives particles along given paths.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SegmentDriver<'a> {
    /// Camera and mount.
    pub(crate) rig: &'a Rig,
    /// Observation model.
    pub(crate) likelihood: &'a Likelihood,
    /// Map update.
    pub(crate) mapping: &'a Mapping<'a>,
    /// Prior of the depth of new landmarks.
    pub(crate) depth: InverseDepthPrior,
}

/// A particle at the end of a path, with its state at the middle.
#[derive(Debug, Clone)]
pub(crate) struct Driven {
    /// The particle at the end.
    pub(crate) particle: Particle,
    /// Log density of the path.
    pub(crate) log_density: f64,
    /// State after the first `middle` steps.
    pub(crate) middle: Option<Origin>,
}

impl SegmentDriver<'_> {
    /// One keyframe: the particle takes the pose that `choose` gives for its motion prior.
    pub(crate) fn step(
        &self,
        particle: &mut Particle,
        step: &WindowStep,
        choose: impl FnOnce(&Particle, &MotionPrior) -> CameraPose,
    ) -> f64 {
        let prior = step.carrier.prior(
            &self.rig.lever_m(),
            &particle.departure(),
            &step.observation.control,
        );
        let pose = choose(particle, &prior);
        let matches = step.observation.prepare(particle);
        let log_density = log_step_density(
            &prior,
            &pose,
            self.likelihood.log(self.rig, &pose, &matches),
        );
        particle.pose = pose;
        particle.prior = Some(Arc::new(Drawn {
            prior,
            step_factor: PoseMatrix::zeros(),
        }));
        let Ok(()) = self.mapping.update_map(particle, &step.observation);
        log_density
    }

    /// Drives `start` along `poses`, one pose for each of `steps`; the state after `middle` steps is kept.
    #[must_use]
    pub(crate) fn drive(
        &self,
        start: &Particle,
        steps: &[Arc<WindowStep>],
        poses: &[CameraPose],
        middle: usize,
    ) -> Driven {
        let mut particle = start.clone();
        let mut log_density = 0.0;
        let mut kept: Option<Origin> = None;
        for (k, (step, pose)) in steps.iter().zip(poses).enumerate() {
            let added = self.step(&mut particle, step, |_, _| *pose);
            log_density += added;
            if let Some(origin) = &mut kept {
                origin.log_density += added;
            }
            if k + 1 == middle {
                kept = Some(Origin::of(&particle));
            }
        }
        Driven {
            particle,
            log_density,
            middle: kept,
        }
    }
}
