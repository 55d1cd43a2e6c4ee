//! Drawing a pose for a particle and weighing it.
//!
//! `Unscented` draws from the posterior of [`pose_posterior`]; `Motion` draws
//! from the odometry prior (the conventional RBPF). The log weight increment is
//! `exact`: log p(z | s, map) + log p(s | s_{t-1}, u) - log q(s), which in the
//! linear case equals log N(z; z^, S) for every draw, or `paper`: the likelihood
//! alone (Eq. 31).

use core::convert::Infallible;
use std::sync::Arc;

use estimation_base::Manifold;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rbpf_core::Proposal;

use super::first_order::first_order_posterior;
use super::likelihood::Likelihood;
use super::linearised::{PosePosterior, pose_posterior};
use super::motion::CarrierModel;
use super::observation::FrameObservation;
use super::particle::{Drawn, Particle};
use super::pose::PoseStep;
use crate::method::{ProposalKind, WeightForm};
use crate::rig::Rig;

/// Proposal and importance weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PoseProposal<'a> {
    /// Camera and mount.
    pub(crate) rig: &'a Rig,
    /// Odometry prior.
    pub(crate) carrier: &'a CarrierModel,
    /// Observation model.
    pub(crate) likelihood: &'a Likelihood,
    /// Distribution that poses are drawn from.
    pub(crate) kind: ProposalKind,
    /// Form of the importance weight.
    pub(crate) weight: WeightForm,
}

impl Proposal<Particle, FrameObservation> for PoseProposal<'_> {
    type Error = Infallible;

    fn propose(
        &self,
        particle: &mut Particle,
        observation: &FrameObservation,
        rng: &mut ChaCha8Rng,
    ) -> Result<f64, Infallible> {
        let prior = self.carrier.prior(
            &self.rig.lever_m(),
            &particle.departure(),
            &observation.control,
        );
        let matches = observation.prepare(particle);
        let posterior = match self.kind {
            ProposalKind::Motion => PosePosterior::prior(),
            ProposalKind::Unscented { iterations } => {
                pose_posterior(self.rig, &prior, &matches, iterations)
            }
            ProposalKind::FirstOrder => first_order_posterior(self.rig, &prior, &matches),
        };
        let normal = PoseStep::from_fn(|_, _| StandardNormal.sample(rng));
        let whitened = posterior.mean + posterior.factor * normal;
        let pose = prior.mean.retract(&(prior.factor * whitened));
        let log_likelihood = self.likelihood.log(self.rig, &pose, &matches);
        // N(xi; 0, I) / N(xi; mean, C C^T); the constants cancel.
        let log_ratio =
            0.5 * (normal.norm_squared() - whitened.norm_squared()) + posterior.log_det_factor;
        particle.pose = pose;
        particle.prior = Some(Arc::new(Drawn {
            step_factor: prior.factor * posterior.factor,
            prior,
        }));
        Ok(match self.weight {
            WeightForm::LikelihoodOnly => log_likelihood,
            WeightForm::Importance => log_likelihood + log_ratio,
        })
    }
}
