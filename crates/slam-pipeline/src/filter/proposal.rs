//! Drawing a pose for a particle and weighing it.
//!
//! `Unscented` draws from the posterior of [`pose_posterior`]; `Motion` draws
//! from the odometry prior (the conventional RBPF). The log weight increment is
//! `exact`: log p(z | s, map) + log p(s | s_{t-1}, u) - log q(s), which in the
//! linear case equals log N(z; z^, S) for every draw, or `paper`: the likelihood
//! alone (Eq. 31).

use core::convert::Infallible;
use std::sync::Arc;

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rbpf_core::Proposal;

use super::likelihood::Likelihood;
use super::linearised::{PosePosterior, pose_posterior};
use super::motion::CarrierModel;
use super::observation::FrameObservation;
use super::particle::{Drawn, Particle};
use super::pose::PoseStep;

/// Where poses are drawn from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProposalKind {
    /// The odometry prior.
    Motion,
    /// The unscented posterior given all matches, linearised this often.
    Unscented {
        /// Linearisations.
        iterations: usize,
    },
}

/// Proposal and importance weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseProposal {
    /// Odometry prior.
    pub carrier: CarrierModel,
    /// Observation model.
    pub likelihood: Likelihood,
    /// Where poses are drawn from.
    pub kind: ProposalKind,
    /// Leave prior and proposal density out of the weight, as Eq. 31 does.
    pub likelihood_only: bool,
}

impl Proposal<Particle, FrameObservation> for PoseProposal {
    type Error = Infallible;

    fn propose(
        &self,
        particle: &mut Particle,
        observation: &FrameObservation,
        rng: &mut ChaCha8Rng,
    ) -> Result<f64, Infallible> {
        let prior = self.carrier.prior(particle, &observation.control);
        let matches = observation.prepare(particle);
        let posterior = match self.kind {
            ProposalKind::Motion => PosePosterior::prior(),
            ProposalKind::Unscented { iterations } => pose_posterior(
                &self.likelihood.lens,
                &self.likelihood.body_from_camera,
                &prior,
                &matches,
                iterations,
            ),
        };
        let normal = PoseStep::from_fn(|_, _| StandardNormal.sample(rng));
        let whitened = posterior.mean + posterior.factor * normal;
        let pose = prior.mean.retract(&(prior.factor * whitened));
        let log_likelihood = self.likelihood.log(&pose, &matches);
        // N(xi; 0, I) / N(xi; mean, C C^T); the constants cancel.
        let log_ratio =
            0.5 * (normal.norm_squared() - whitened.norm_squared()) + posterior.log_det_factor;
        particle.pose = pose;
        particle.prior = Some(Arc::new(Drawn {
            step_factor: prior.factor * posterior.factor,
            prior,
        }));
        Ok(if self.likelihood_only {
            log_likelihood
        } else {
            log_likelihood + log_ratio
        })
    }
}
