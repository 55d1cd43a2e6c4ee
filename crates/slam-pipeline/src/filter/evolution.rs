//! The evolution strategy after a resampling (II.D), which spreads the copies of a particle.
//!
//! The exact operators move every pose by Metropolis-Hastings steps whose target is p(z | s, map) p(s | s_{t-1}, u), so
//! the weights stay as they are. The printed ones use Eq. 17-19 with the likelihood as fitness. In both, a slot keeps
//! its own path and map: only its pose at this frame moves.

use es_evolve::{
    EvolutionReport, EvolveError, MoveParams, PaperParams, StepFactors, evolve_paper, resample_move,
};
use rayon::prelude::*;
use rbpf_core::{Purpose, Rejuvenation, RejuvenationReport, Streams};

use super::likelihood::Likelihood;
use super::observation::{FrameObservation, Prepared};
use super::particle::Particle;
use super::pose::{CameraPose, PoseMatrix};
use crate::method::Evolution;
use crate::rig::Rig;

/// Streams of one frame and slot are apart by this many steps.
const STEPS_PER_FRAME: u64 = 1 << 20;

/// The evolution step of the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PoseEvolution<'a> {
    /// Camera and mount.
    pub(crate) rig: &'a Rig,
    /// Which operators run.
    pub(crate) operators: Evolution,
    /// Number of steps.
    pub(crate) steps: usize,
    /// Fitness.
    pub(crate) likelihood: &'a Likelihood,
}

impl PoseEvolution<'_> {
    fn evolve(
        &self,
        particles: &mut [Particle],
        observation: &FrameObservation,
        streams: &Streams,
        frame: u64,
    ) -> Result<EvolutionReport, EvolveError> {
        let matches: Vec<Vec<Option<Prepared>>> = particles
            .par_iter()
            .map(|p| observation.prepare(p))
            .collect();
        let factors: Vec<PoseMatrix> = particles
            .iter()
            .map(|p| p.prior.as_ref().map(|drawn| drawn.step_factor))
            .map(Option::unwrap_or_default)
            .collect();
        let mut poses: Vec<CameraPose> = particles.iter().map(|p| p.pose).collect();
        let random = |step: usize, slot: usize| {
            streams.stream(
                frame * STEPS_PER_FRAME + step as u64,
                slot as u64,
                Purpose::Evolution,
            )
        };
        let report = {
            let particles = &*particles;
            let exact = |slot: usize, pose: &CameraPose| {
                let prior = particles[slot].prior.as_ref();
                self.likelihood.log(self.rig, pose, &matches[slot])
                    + prior.map_or(0.0, |p| p.prior.log_density(pose))
            };
            let paper = |slot: usize, pose: &CameraPose| {
                self.likelihood.log(self.rig, pose, &matches[slot])
            };
            match self.operators {
                Evolution::MetropolisHastings => resample_move(
                    &mut poses,
                    &exact,
                    StepFactors::PerSlot(&factors),
                    &MoveParams {
                        steps: self.steps,
                        ..MoveParams::default()
                    },
                    &random,
                )?,
                _ => evolve_paper(
                    &mut poses,
                    &paper,
                    StepFactors::PerSlot(&factors),
                    &PaperParams {
                        steps: self.steps,
                        ..PaperParams::default()
                    },
                    &random,
                )?,
            }
        };
        for (particle, pose) in particles.iter_mut().zip(poses) {
            particle.pose = pose;
        }
        Ok(report)
    }
}

impl Rejuvenation<Particle, FrameObservation> for PoseEvolution<'_> {
    type Error = EvolveError;

    fn rejuvenate(
        &self,
        particles: &mut [Particle],
        observation: &FrameObservation,
        streams: &Streams,
        frame: u64,
    ) -> Result<RejuvenationReport, EvolveError> {
        if self.operators == Evolution::Off || self.steps == 0 {
            return Ok(RejuvenationReport::default());
        }
        let report = self.evolve(particles, observation, streams, frame)?;
        Ok(RejuvenationReport {
            proposed: report.proposed_crossovers + report.proposed_mutations,
            accepted: report.accepted_crossovers + report.accepted_mutations,
        })
    }
}
