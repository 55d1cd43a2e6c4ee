//! The proposal of `FastSLAM` 2.0 (Montemerlo, Thrun, Koller, Wegbreit 2003), with exact weights.
//!
//! ```text
//! H_k, G_k = d z / d pose, d z / d landmark,   R_k = R + G_k P_k G_k^T
//! Lambda = Q^-1 + sum H_k^T R_k^-1 H_k
//! ```
//!
//! The published filter takes in the landmarks of a frame one after the other, each linearised at the
//! mean that the ones before left, and weighs by the product of the N(z; z^, S) met on the way. For a
//! nonlinear sensor that product is not p(z | s) p(s | s_prev, u) / q(s) of the pose drawn; here the
//! weight is that ratio. All Jacobians are in the tangent of the motion model's `retract`, taken at the
//! pose of linearisation: exact where `retract` adds and wraps, first order elsewhere. The cost is
//! O(matches) (D^3 + M^3) per pass.

use super::likelihood::{held, linearised};
use super::prior::MotionPrior;
use crate::covariance::{definite, semidefinite};
use crate::error::RangeBearingError;
use crate::frame::Frame;
use crate::innovation::{checked_noise, linearise};
use crate::landmark_particle::LandmarkParticle;
use crate::models::{MotionModel, ObservationJacobians};
use estimation_base::symmetric;
use nalgebra::SVector;
use rand_chacha::ChaCha8Rng;
use rbpf_core::Proposal;

/// The pose at which the measurements of a frame are linearised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Linearisation {
    /// Each at the mean that the ones before left, in the order of the frame.
    #[default]
    Sequential,
    /// All at one pose, first the predicted one and then the posterior just found: Gauss-Newton, which
    /// does not depend on the order. The number is that of the passes; 0 proposes from the motion model.
    Together(u32),
}

/// Draws from the extended Kalman posterior of the pose, given all measured landmarks that the particle
/// holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExtendedProposal<A, B> {
    /// The motion p(s | s_prev, u).
    pub motion: A,
    /// The measurement p(z | s, landmark).
    pub sensor: B,
    /// The pose of linearisation.
    pub linearisation: Linearisation,
}

impl<A, B, const D: usize, const K: usize, const M: usize>
    Proposal<LandmarkParticle<D, K>, Frame<A::Control, M>> for ExtendedProposal<A, B>
where
    A: MotionModel<D>,
    B: ObservationJacobians<D, K, M>,
{
    type Error = RangeBearingError;

    fn propose(
        &self,
        particle: &mut LandmarkParticle<D, K>,
        frame: &Frame<A::Control, M>,
        rng: &mut ChaCha8Rng,
    ) -> Result<f64, RangeBearingError> {
        frame.check()?;
        let sensor = &self.sensor;
        let prior = MotionPrior::of(&self.motion, &particle.pose, &frame.control)?;
        let (prior_information, mut information) = prior.information()?;
        let noise = checked_noise(sensor)?;
        let held = held(particle, &frame.measurements, |position| {
            semidefinite(&position.covariance, "landmark").map(|_| *position)
        })?;

        // q = N(mean, information^-1) in the tangent at the predicted pose
        let mut mean = SVector::<f64, D>::zeros();
        let (passes, sequential) = match self.linearisation {
            Linearisation::Sequential => (1, true),
            Linearisation::Together(passes) => (passes, false),
        };
        for _ in 0..passes {
            let mut sum = prior_information;
            let mut vector = SVector::<f64, D>::zeros();
            let mut about = mean;
            for (landmark, measured) in &held {
                let pose = self.motion.retract(&prior.pose, &about);
                let Some(seen) = linearise(sensor, &noise, &pose, landmark, measured) else {
                    continue;
                };
                let slope = seen.of_pose;
                let weighted = definite(&seen.innovation.covariance, "innovation")?
                    .solve(&slope)
                    .transpose();
                sum += weighted * slope;
                vector += weighted * (seen.innovation.mean + slope * about);
                if sequential {
                    about = definite(&symmetric(&sum), "pose proposal")?.solve(&vector);
                }
            }
            information = definite(&symmetric(&sum), "pose proposal")?;
            mean = information.solve(&vector);
        }

        let (tangent, log_ratio) = prior.draw_posterior(&mean, &information, rng);
        let pose = self.motion.retract(&prior.pose, &tangent);
        let log_likelihood = linearised(sensor, &noise, &pose, &held)?;
        particle.set_pose(pose);
        Ok(log_likelihood + log_ratio)
    }
}
