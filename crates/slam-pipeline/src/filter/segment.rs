//! The recent path of a particle, with all that is needed to drive it again.
//!
//! A particle remembers its own state at two earlier keyframes, *older* and *newer*. From the older state and the
//! observations since ([`WindowStep`]) any other path can be taken: [`SegmentDriver::drive`] gives the particle that would be
//! here, map and metric state included. Snapshots share their maps with the particle.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use super::landmark::InverseDepthPrior;
use super::mapping::Mapping;
use super::motion::{CarrierModel, MotionPrior};
use super::observation::FrameObservation;
use super::particle::Particle;
use super::pose::CameraPose;
use crate::rig::Rig;

/// A keyframe of the window.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct WindowStep {
    /// Its measurements.
    pub(crate) observation: FrameObservation,
    /// The carrier with the process noise that was in force.
    pub(crate) carrier: CarrierModel,
}

/// Drives particles along given paths.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SegmentDriver<'a> {
    /// Camera and mount.
    pub(crate) rig: &'a Rig,
    /// Map update.
    pub(crate) mapping: &'a Mapping<'a>,
    /// Prior of the depth of new landmarks.
    pub(crate) depth: InverseDepthPrior,
}

impl SegmentDriver<'_> {
    /// One keyframe: the particle takes the pose that `choose` gives for its motion prior, and maps from there.
    pub(crate) fn step(
        &self,
        particle: &mut Particle,
        step: &WindowStep,
        choose: impl FnOnce(&Particle, &MotionPrior) -> CameraPose,
    ) {
        let prior = step.carrier.prior(
            &self.rig.lever_m(),
            &particle.departure(),
            &step.observation.control,
        );
        particle.pose = choose(particle, &prior);
        self.mapping.arrive(particle, &prior, &step.observation);
    }

    /// The particle that leaves `start` along `poses`, one for each of `steps`, and its state after `middle` steps (`None`
    /// when that is zero).
    #[must_use]
    pub(crate) fn drive(
        &self,
        start: &Particle,
        steps: &[Arc<WindowStep>],
        poses: &[CameraPose],
        middle: usize,
    ) -> (Particle, Option<Arc<Particle>>) {
        let mut particle = start.clone();
        let mut kept = None;
        for (k, (step, pose)) in steps.iter().zip(poses).enumerate() {
            self.step(&mut particle, step, |_, _| *pose);
            if k + 1 == middle {
                kept = Some(particle.snapshot());
            }
        }
        (particle, kept)
    }
}
