//! The conventional filter: draw from the motion model, weigh by the likelihood.

use super::likelihood::log_likelihood;
use super::standard_normal;
use crate::error::RbpfError;
use crate::factor::Factor;
use crate::filter::Proposal;
use crate::models::{Frame, MotionModel, ObservationModel, PoseAndMap};
use rand_chacha::ChaCha8Rng;

/// Draws from p(s | s_prev, u) and weights by [`log_likelihood`] (`FastSLAM` 1.0).
/// D, K: dimensions of pose and landmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotionProposal<A, B, const D: usize, const K: usize> {
    /// p(s | s_prev, u).
    pub motion: A,
    /// p(z | s, landmark).
    pub sensor: B,
}

impl<P, A, B, const D: usize, const K: usize, const M: usize> Proposal<P, Frame<A::Control, M>>
    for MotionProposal<A, B, D, K>
where
    P: PoseAndMap<D, K>,
    A: MotionModel<D>,
    B: ObservationModel<D, K, M>,
{
    type Error = RbpfError;

    fn propose(
        &self,
        particle: &mut P,
        frame: &Frame<A::Control, M>,
        rng: &mut ChaCha8Rng,
    ) -> Result<f64, RbpfError> {
        frame.check()?;
        let predicted = self.motion.predict(&particle.pose(), &frame.control);
        let root = Factor::definite(&predicted.covariance, "motion model")?;
        let tangent = root.lower() * standard_normal(rng);
        let pose = self.motion.retract(&predicted.mean, &tangent);
        let log_likelihood = log_likelihood(&self.sensor, particle, &pose, &frame.measurements)?;
        particle.set_pose(pose);
        Ok(log_likelihood)
    }
}
