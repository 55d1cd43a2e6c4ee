//! The proposal of the conventional filter: draw from the motion model, weigh by the likelihood.

use super::likelihood::{held_spreads, sampled};
use super::prior::{MotionPrior, standard_normal};
use crate::error::RangeBearingError;
use crate::frame::Frame;
use crate::innovation::checked_noise;
use crate::landmark_particle::LandmarkParticle;
use crate::models::{MotionModel, ObservationModel};
use rand_chacha::ChaCha8Rng;
use rbpf_core::Proposal;

/// Draws from p(s | s_prev, u) and weighs by the likelihood, with landmark covariances by sigma points
/// (`FastSLAM` 1.0).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotionProposal<A, B> {
    /// The motion p(s | s_prev, u).
    pub motion: A,
    /// The measurement p(z | s, landmark).
    pub sensor: B,
}

impl<A, B, const D: usize, const K: usize, const M: usize>
    Proposal<LandmarkParticle<D, K>, Frame<A::Control, M>> for MotionProposal<A, B>
where
    A: MotionModel<D>,
    B: ObservationModel<D, K, M>,
{
    type Error = RangeBearingError;

    fn propose(
        &self,
        particle: &mut LandmarkParticle<D, K>,
        frame: &Frame<A::Control, M>,
        rng: &mut ChaCha8Rng,
    ) -> Result<f64, RangeBearingError> {
        frame.check()?;
        let prior = MotionPrior::of(&self.motion, &particle.pose, &frame.control)?;
        let tangent = prior.factor.lower() * standard_normal(rng);
        let pose = self.motion.retract(&prior.pose, &tangent);
        let noise = checked_noise(&self.sensor)?;
        let held = held_spreads(particle, &frame.measurements)?;
        let log_likelihood = sampled(&self.sensor, &noise, &pose, &held)?;
        particle.set_pose(pose);
        Ok(log_likelihood)
    }
}
