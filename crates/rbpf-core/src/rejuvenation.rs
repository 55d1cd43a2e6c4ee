//! Spreads the copies a resampling leaves, by Metropolis-Hastings moves of the present poses.
//!
//! After resampling every particle stands for the posterior with weight 1/N, and its pose, given its own past, for
//!
//! ```text
//! p(z | s, map) p(s | s_prev, u)
//! ```
//!
//! Steps that leave this invariant, slot by slot, change nothing of what the set stands for, so weights stay. The moves are
//! those of [`es_evolve::resample_move`]: random-walk mutation and differential crossover between the halves of the set.
//!
//! Steps:
//! 1. for each particle the motion prior N(0, Q) in the tangent at its predicted pose s^, from its previous pose;
//! 2. the scale of its steps: the factor of (Q^-1 + sum H_k^T R_k^-1 H_k)^-1, H_k and the landmark's share of R_k by central
//!    differences over one standard deviation at s^. It looks at no present pose, which the moves ask for. A poor
//!    linearisation costs acceptances, never correctness;
//! 3. the moves, with tangents at s^ as genomes, so the target is a density in plain coordinates whatever `retract` does;
//! 4. poses of particles that moved are replaced; path, map and weights stay as they are.
//!
//! Run it before the map update, as [`crate::ParticleFilter`] does: the map must not yet hold the measurement. Cost:
//! N (1 + steps) likelihoods and 2 (D + K) predictions a measurement and particle.

use crate::error::RbpfError;
use crate::factor::{Factor, symmetric};
use crate::filter::{Rejuvenation, RejuvenationReport, first_error, map_particles};
use crate::models::{Frame, Gaussian, MotionModel, ObservationModel, PoseAndMap};
use crate::proposal::log_likelihood;
use crate::streams::{Purpose, Streams};
use es_evolve::{Euclidean, EvolveError, MoveParams, StepFactors, resample_move};
use nalgebra::{SMatrix, SVector};

/// Steps of one frame have streams of their own up to this many.
const STEPS_PER_FRAME: u64 = 1 << 20;

/// A motion model whose density can be evaluated at any pose.
pub trait InverseMotion<const D: usize>: MotionModel<D> {
    /// The tangent with `retract(from, tangent) == to`, the shortest where there are several; wrap headings here.
    fn local(&self, from: &SVector<f64, D>, to: &SVector<f64, D>) -> SVector<f64, D>;
}

/// A particle whose present pose can be taken back.
pub trait MovablePose<const D: usize, const K: usize>: PoseAndMap<D, K> {
    /// The pose before the present one, from which the motion of this frame set out.
    fn previous_pose(&self) -> SVector<f64, D>;

    /// Puts another pose in the place of the present one; the path does not grow.
    fn replace_pose(&mut self, pose: SVector<f64, D>);
}

/// Metropolis-Hastings moves of the poses. D, K: dimensions of pose and landmark.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovePoses<A, B, const D: usize, const K: usize> {
    /// p(s | s_prev, u).
    pub motion: A,
    /// p(z | s, landmark).
    pub sensor: B,
    /// Steps, share of crossover, scales.
    pub params: MoveParams,
}

/// Why poses could not be moved; they are then what they were.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MoveError {
    /// The models or a measurement give no target for a particle.
    #[error("target of particle {particle}")]
    Target {
        /// Its slot.
        particle: usize,
        /// What is wrong.
        source: RbpfError,
    },
    /// A parameter out of range, or a target that is not a number.
    #[error(transparent)]
    Evolve(#[from] EvolveError),
}

/// What does not move: the prior of a particle, and the scale of its steps.
struct Target<const D: usize> {
    predicted: Gaussian<D>,
    prior: Factor<D>,
    step_factor: [[f64; D]; D],
}

impl<P, A, B, const D: usize, const K: usize, const M: usize> Rejuvenation<P, Frame<A::Control, M>>
    for MovePoses<A, B, D, K>
where
    P: MovablePose<D, K> + Send + Sync,
    A: InverseMotion<D>,
    A::Control: Sync,
    B: ObservationModel<D, K, M>,
{
    type Error = MoveError;

    fn rejuvenate(
        &self,
        particles: &mut [P],
        frame: &Frame<A::Control, M>,
        streams: &Streams,
        number: u64,
    ) -> Result<RejuvenationReport, MoveError> {
        let targets = map_particles(particles, |_, particle| self.target(particle, frame));
        let targets = first_error(targets)
            .map_err(|(particle, source)| MoveError::Target { particle, source })?;
        let factors: Vec<_> = targets.iter().map(|target| target.step_factor).collect();
        let start: Vec<[f64; D]> = particles
            .iter()
            .zip(&targets)
            .map(|(particle, target)| {
                let tangent = self.motion.local(&target.predicted.mean, &particle.pose());
                tangent.into()
            })
            .collect();
        let mut moved = start.clone();
        let report = {
            let particles = &*particles;
            let log_target = |slot: usize, tangent: &[f64; D]| {
                let tangent = SVector::from(*tangent);
                let target = &targets[slot];
                let pose = self.motion.retract(&target.predicted.mean, &tangent);
                let measured = &frame.measurements;
                // The inputs were checked above; what fails still is no number and named by its slot.
                log_likelihood(&self.sensor, &particles[slot], &pose, measured)
                    .map_or(f64::NAN, |log| log + target.prior.log_density(&tangent))
            };
            resample_move(
                &Euclidean,
                &mut moved,
                &log_target,
                StepFactors::PerSlot(&factors),
                &self.params,
                &|step, slot| {
                    let counter = number * STEPS_PER_FRAME + step as u64;
                    streams.stream(counter, slot as u64, Purpose::Evolution)
                },
            )?
        };
        for (slot, particle) in particles.iter_mut().enumerate() {
            if moved[slot] != start[slot] {
                let mean = &targets[slot].predicted.mean;
                particle.replace_pose(self.motion.retract(mean, &SVector::from(moved[slot])));
            }
        }
        Ok(RejuvenationReport {
            proposed: report.proposed_crossovers + report.proposed_mutations,
            accepted: report.accepted_crossovers + report.accepted_mutations,
        })
    }
}

impl<A, B, const D: usize, const K: usize> MovePoses<A, B, D, K> {
    fn target<P, const M: usize>(
        &self,
        particle: &P,
        frame: &Frame<A::Control, M>,
    ) -> Result<Target<D>, RbpfError>
    where
        P: MovablePose<D, K>,
        A: InverseMotion<D>,
        B: ObservationModel<D, K, M>,
    {
        frame.check()?;
        let predicted = self
            .motion
            .predict(&particle.previous_pose(), &frame.control);
        let prior = Factor::definite(&predicted.covariance, "motion model")?;
        let mut information = prior.solve(&SMatrix::identity());
        for (id, measured) in &frame.measurements {
            let Some(landmark) = particle.landmark(*id) else {
                continue;
            };
            let residual = |tangent: &SVector<f64, D>, position: &SVector<f64, K>| {
                let pose = self.motion.retract(&predicted.mean, tangent);
                let expected = self.sensor.predict(&pose, position)?;
                Some(self.sensor.innovation(measured, &expected))
            };
            let still = SVector::zeros();
            let of_pose = secants(&predicted.covariance, |step| residual(step, &landmark.mean));
            let of_landmark = secants(&landmark.covariance, |step| {
                residual(&still, &(landmark.mean + step))
            });
            let (Some(of_pose), Some(of_landmark)) = (of_pose, of_landmark) else {
                continue;
            };
            let noise =
                self.sensor.noise() + of_landmark * landmark.covariance * of_landmark.transpose();
            let noise = Factor::definite(&symmetric(&noise), "innovation")?;
            information += of_pose.transpose() * noise.solve(&of_pose);
        }
        let covariance = Factor::definite(&symmetric(&information), "pose information")?
            .solve(&SMatrix::identity());
        let factor = Factor::definite(&symmetric(&covariance), "pose steps")?;
        let lower = factor.lower();
        Ok(Target {
            predicted,
            prior,
            step_factor: std::array::from_fn(|row| std::array::from_fn(|k| lower[(row, k)])),
        })
    }
}

/// Slopes of `function` at zero along each coordinate, by central differences over one standard deviation; zero along a
/// coordinate without spread. `None` where the function has no value.
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
