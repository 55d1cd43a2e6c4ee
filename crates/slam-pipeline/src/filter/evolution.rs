//! Evolution strategy after a resampling (II.D): spreads the copies.
//!
//! `exact` moves every pose by Metropolis-Hastings steps whose target is
//! p(z | s, map) p(s | s_{t-1}, u), so weights stay as they are. `paper` uses
//! Eq. 17-19 with the likelihood as fitness. In both, a slot keeps its own path
//! and map: only its pose at this frame moves.

use std::sync::Mutex;

use es_evolve::{
    EvolutionReport, EvolveError, MoveParams, PaperParams, Space, StepFactors, evolve_paper,
    resample_move,
};
use rayon::prelude::*;
use rbpf_core::{Purpose, Rejuvenation, RejuvenationReport, Streams};

use super::likelihood::Likelihood;
use super::observation::{FrameObservation, Prepared};
use super::particle::Particle;
use super::pose::{CameraPose, POSE_DIM, PoseStep};
use crate::stopwatch::{Clock, Lap};

/// Streams of one frame and slot are apart by this many steps.
const STEPS_PER_FRAME: u64 = 1 << 20;

/// Which operators run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Operators {
    /// Metropolis-Hastings moves.
    Exact,
    /// The printed operators.
    Paper,
    /// None.
    Off,
}

/// The evolution step of the filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evolution {
    /// Which operators run.
    pub operators: Operators,
    /// Steps.
    pub steps: usize,
    /// Fitness.
    pub likelihood: Likelihood,
}

/// [`Evolution`] that notes when it ran.
#[derive(Debug)]
pub struct Timed<'a> {
    evolution: &'a Evolution,
    clock: ClockRef<'a>,
    ran: Mutex<Option<(f64, f64)>>,
}

struct ClockRef<'a>(&'a Clock<'a>);

impl core::fmt::Debug for ClockRef<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("clock")
    }
}

impl Evolution {
    /// With a clock, so that the stages around it can be told apart.
    #[must_use]
    pub fn timed<'a>(&'a self, clock: &'a Clock<'a>) -> Timed<'a> {
        Timed {
            evolution: self,
            clock: ClockRef(clock),
            ran: Mutex::new(None),
        }
    }

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
        let factors: Vec<[[f64; POSE_DIM]; POSE_DIM]> = particles
            .iter()
            .map(|p| {
                let mut rows = [[0.0; POSE_DIM]; POSE_DIM];
                if let Some(drawn) = &p.prior {
                    for (i, row) in rows.iter_mut().enumerate() {
                        for (j, v) in row.iter_mut().enumerate().take(i + 1) {
                            *v = drawn.step_factor[(i, j)];
                        }
                    }
                }
                rows
            })
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
                self.likelihood.log(pose, &matches[slot])
                    + prior.map_or(0.0, |p| p.prior.log_density(pose))
            };
            let paper = |slot: usize, pose: &CameraPose| self.likelihood.log(pose, &matches[slot]);
            match self.operators {
                Operators::Exact => resample_move(
                    &PoseSpace,
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
                    &PoseSpace,
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

impl Rejuvenation<Particle, FrameObservation> for Timed<'_> {
    type Error = EvolveError;

    fn rejuvenate(
        &self,
        particles: &mut [Particle],
        observation: &FrameObservation,
        streams: &Streams,
        frame: u64,
    ) -> Result<RejuvenationReport, EvolveError> {
        if self.evolution.operators == Operators::Off || self.evolution.steps == 0 {
            return Ok(RejuvenationReport::default());
        }
        let start = (self.clock.0)();
        let report = self
            .evolution
            .evolve(particles, observation, streams, frame)?;
        if let Ok(mut ran) = self.ran.lock() {
            *ran = Some((start, (self.clock.0)()));
        }
        Ok(RejuvenationReport {
            proposed: report.proposed_crossovers + report.proposed_mutations,
            accepted: report.accepted_crossovers + report.accepted_mutations,
        })
    }
}

impl Timed<'_> {
    /// Milliseconds before, in and after the evolution since the last lap; all
    /// before when it did not run.
    pub fn split(&self, lap: &mut Lap<'_>) -> [f64; 3] {
        let start = lap.last_s();
        let total = lap.lap_ms();
        match self.ran.lock().ok().and_then(|r| *r) {
            Some((from, to)) => {
                let (before, within) = ((from - start) * 1e3, (to - from) * 1e3);
                [before, within, total - before - within]
            }
            None => [total, 0.0, 0.0],
        }
    }
}

/// Poses as genomes: addition with a wrapped heading.
struct PoseSpace;

impl Space<POSE_DIM> for PoseSpace {
    type Genome = CameraPose;

    fn retract(&self, at: &CameraPose, step: &[f64; POSE_DIM]) -> CameraPose {
        at.retract(&PoseStep::from(*step))
    }

    fn local(&self, from: &CameraPose, to: &CameraPose) -> [f64; POSE_DIM] {
        from.local(to).into()
    }
}
