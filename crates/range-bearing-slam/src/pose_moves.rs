//! Metropolis-Hastings moves of the present poses, which spread the copies that a resampling leaves.
//!
//! After resampling every particle stands for the posterior with weight 1/N, and its pose, given its own
//! past, for
//!
//! ```text
//! p(z | s, map) p(s | s_prev, u)
//! ```
//!
//! Steps that leave this invariant, slot by slot, change nothing of the distribution that the set
//! represents, so the weights stay. The moves are those of [`es_evolve::resample_move`]: random-walk
//! mutation, and differential crossover between the halves of the set.
//!
//! Steps:
//! 1. Each particle has the motion prior N(0, Q) in the tangent at its predicted pose s^, from its
//!    previous pose.
//! 2. The scale of its steps is the factor of (Q^-1 + sum H_k^T R_k^-1 H_k)^-1, with H_k and the
//!    landmark's share of R_k by central differences over one standard deviation at s^. It looks at no
//!    present pose, as the moves require. A poor linearisation costs acceptances, never correctness.
//! 3. The moves have the tangents at s^ as genomes, so the target is a density in plain coordinates
//!    whatever `retract` does.
//! 4. The poses of particles that moved are replaced; path, map and weights stay as they are.
//!
//! The moves run before the map update, as [`rbpf_core::ParticleFilter`] does, since the map must not yet
//! hold the measurement. The cost is N (1 + steps) likelihoods, and 2 (D + K) predictions a measurement
//! and particle.

use crate::covariance::definite;
use crate::error::{MoveError, RangeBearingError};
use crate::frame::Frame;
use crate::innovation::{checked_noise, residual};
use crate::landmark_particle::LandmarkParticle;
use crate::models::{MotionModel, ObservationModel};
use crate::proposal::likelihood::{Held, held_spreads, sampled};
use crate::proposal::prior::MotionPrior;
use crate::spread::Spread;
use es_evolve::{MoveParams, StepFactors, resample_move};
use estimation_base::symmetric;
use nalgebra::{SMatrix, SVector};
use rbpf_core::{Purpose, Rejuvenation, RejuvenationReport, Streams, map_particles};

/// Steps of one frame have streams of their own up to this many.
const STEPS_PER_FRAME: u64 = 1 << 20;

/// The rejuvenation by Metropolis-Hastings moves of the poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovePoses<A, B> {
    /// The motion p(s | s_prev, u).
    pub motion: A,
    /// The measurement p(z | s, landmark).
    pub sensor: B,
    /// Number of steps, share of crossover, scales.
    pub params: MoveParams,
}

/// The density that the moves of one particle leave invariant, and the scale of its steps.
struct Target<const D: usize, const K: usize, const M: usize> {
    prior: MotionPrior<D>,
    held: Held<Spread<K>, M>,
    noise: SMatrix<f64, M, M>,
    step_factor: SMatrix<f64, D, D>,
}

impl<A, B, const D: usize, const K: usize, const M: usize>
    Rejuvenation<LandmarkParticle<D, K>, Frame<A::Control, M>> for MovePoses<A, B>
where
    A: MotionModel<D>,
    A::Control: Sync,
    B: ObservationModel<D, K, M>,
{
    type Error = MoveError;

    fn rejuvenate(
        &self,
        particles: &mut [LandmarkParticle<D, K>],
        frame: &Frame<A::Control, M>,
        streams: &Streams,
        number: u64,
    ) -> Result<RejuvenationReport, MoveError> {
        let targets = map_particles(particles, |particle, state| {
            self.target(state, frame)
                .map_err(|source| MoveError::Target { particle, source })
        });
        let targets = targets.into_iter().collect::<Result<Vec<_>, _>>()?;
        let factors: Vec<_> = targets.iter().map(|target| target.step_factor).collect();
        let start: Vec<SVector<f64, D>> = particles
            .iter()
            .zip(&targets)
            .map(|(particle, target)| self.motion.local(&target.prior.pose, &particle.pose))
            .collect();
        let mut moved = start.clone();
        let log_target = |slot: usize, tangent: &SVector<f64, D>| {
            let target = &targets[slot];
            let pose = self.motion.retract(&target.prior.pose, tangent);
            // The inputs were checked above; a failure that is left gives no number, and the moves
            // name its slot.
            sampled(&self.sensor, &target.noise, &pose, &target.held).map_or(f64::NAN, |log| {
                log + target.prior.factor.log_density(tangent)
            })
        };
        let report = resample_move(
            &mut moved,
            &log_target,
            StepFactors::PerSlot(&factors),
            &self.params,
            &|step, slot| {
                let counter = number * STEPS_PER_FRAME + step as u64;
                streams.stream(counter, slot as u64, Purpose::Evolution)
            },
        )?;
        for (slot, particle) in particles.iter_mut().enumerate() {
            if moved[slot] != start[slot] {
                let predicted = &targets[slot].prior.pose;
                let tangent = moved[slot];
                particle.pose = self.motion.retract(predicted, &tangent);
            }
        }
        Ok(RejuvenationReport {
            proposed: report.proposed_crossovers + report.proposed_mutations,
            accepted: report.accepted_crossovers + report.accepted_mutations,
        })
    }
}

impl<A, B> MovePoses<A, B> {
    fn target<const D: usize, const K: usize, const M: usize>(
        &self,
        particle: &LandmarkParticle<D, K>,
        frame: &Frame<A::Control, M>,
    ) -> Result<Target<D, K, M>, RangeBearingError>
    where
        A: MotionModel<D>,
        B: ObservationModel<D, K, M>,
    {
        frame.check()?;
        let prior = MotionPrior::of(&self.motion, &particle.previous_pose, &frame.control)?;
        let noise = checked_noise(&self.sensor)?;
        let held = held_spreads(particle, &frame.measurements)?;
        let mut information = prior.factor.solve(&SMatrix::identity());
        for (id, measured) in &frame.measurements {
            let Some(landmark) = particle.map.get(*id) else {
                continue;
            };
            let position = &landmark.position;
            let still = SVector::zeros();
            let residual = |tangent: &SVector<f64, D>, at: &SVector<f64, K>| {
                let pose = self.motion.retract(&prior.pose, tangent);
                residual(&self.sensor, &pose, at, measured)
            };
            let of_pose = secants(&prior.covariance, |step| residual(step, &position.mean));
            let of_landmark = secants(&position.covariance, |step| {
                residual(&still, &(position.mean + step))
            });
            let (Some(of_pose), Some(of_landmark)) = (of_pose, of_landmark) else {
                continue;
            };
            let noise = noise + of_landmark * position.covariance * of_landmark.transpose();
            let noise = definite(&symmetric(&noise), "innovation")?;
            information += of_pose.transpose() * noise.solve(&of_pose);
        }
        let covariance =
            definite(&symmetric(&information), "pose information")?.solve(&SMatrix::identity());
        let factor = definite(&symmetric(&covariance), "pose steps")?;
        Ok(Target {
            prior,
            held,
            noise,
            step_factor: *factor.lower(),
        })
    }
}

/// Slopes of `function` at zero along each coordinate, by central differences over one standard
/// deviation; zero along a coordinate without spread. `None` where the function has no value.
fn secants<const N: usize, const M: usize>(
    covariance: &SMatrix<f64, N, N>,
    function: impl Fn(&SVector<f64, N>) -> Option<SVector<f64, M>>,
) -> Option<SMatrix<f64, M, N>> {
    let mut slopes = SMatrix::<f64, M, N>::zeros();
    for i in 0..N {
        let deviation = covariance[(i, i)].sqrt();
        if deviation > 0.0 {
            let mut step = SVector::<f64, N>::zeros();
            step[i] = deviation;
            let slope = (function(&step)? - function(&-step)?) / (2.0 * deviation);
            slopes.set_column(i, &slope);
        }
    }
    Some(slopes)
}
