//! The unscented proposal (Eq. 7-12 in their right form), with exact weights.
//!
//! By statistical linearisation about the present estimate (s_bar, P),
//!
//! ```text
//! z_k ~ H_k (s - s_bar) + z_bar_k + e_k,   H_k = P_zs P^-1
//! R_k = R + V_k + (P_zz - H_k P H_k^T)
//! Lambda = Q^-1 + sum H_k^T R_k^-1 H_k
//! ```
//!
//! The iteration starts at the motion prior (s^, Q) and goes on about the posterior just found, always
//! with the prior (s^, Q). The covariance of the pose is factorised once an iteration, that of a landmark
//! once a frame. The cost per particle and iteration is 2 D + 2 K + 1 predictions and one M x M factor a
//! match.

use super::likelihood::{held_spreads, sampled};
use super::prior::MotionPrior;
use crate::covariance::definite;
use crate::error::RangeBearingError;
use crate::frame::Frame;
use crate::innovation::{checked_noise, residual};
use crate::landmark_particle::LandmarkParticle;
use crate::models::{MotionModel, ObservationModel};
use crate::spread::Spread;
use estimation_base::symmetric;
use nalgebra::{SMatrix, SVector};
use rand_chacha::ChaCha8Rng;
use rbpf_core::Proposal;

/// Draws from the unscented posterior of the pose, given all measured landmarks that the particle holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnscentedProposal<A, B> {
    /// The motion p(s | s_prev, u).
    pub motion: A,
    /// The measurement p(z | s, landmark).
    pub sensor: B,
    /// Number of linearisations; 2 or 3 are enough, 0 proposes from the motion model.
    pub iterations: u32,
}

impl<A, B, const D: usize, const K: usize, const M: usize>
    Proposal<LandmarkParticle<D, K>, Frame<A::Control, M>> for UnscentedProposal<A, B>
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
        let sensor = &self.sensor;
        let prior = MotionPrior::of(&self.motion, &particle.pose, &frame.control)?;
        let pose_at = |tangent: &SVector<f64, D>| self.motion.retract(&prior.pose, tangent);
        let (prior_information, mut information) = prior.information()?;
        let noise = checked_noise(sensor)?;
        let held = held_spreads(particle, &frame.measurements)?;

        // q = N(mean, information^-1) in the tangent at the predicted pose
        let mut mean = SVector::<f64, D>::zeros();
        let mut root = prior.factor;
        for iteration in 0..self.iterations {
            if iteration > 0 {
                let covariance = symmetric(&information.solve(&SMatrix::identity()));
                root = definite(&covariance, "pose proposal")?;
            }
            let about = Spread { mean, root };
            let pose = pose_at(&mean);
            // in u with t = mean + L u the prior about the present estimate is linear in u
            let mut sum = root.lower().transpose() * prior_information * root.lower();
            let mut vector = -(root.lower().transpose() * (prior_information * mean));
            for (landmark, measured) in &held {
                let position = &landmark.mean;
                let (Some(of_pose), Some(of_landmark)) = (
                    about.through(|t| residual(sensor, &pose_at(t), position, measured))?,
                    landmark.through(|at| residual(sensor, &pose, at, measured))?,
                ) else {
                    continue;
                };
                // residual ~ mean + slope u
                let slope = of_pose.cross_covariance.transpose();
                let curvature = of_pose.covariance - slope * slope.transpose();
                let noise = symmetric(&(noise + of_landmark.covariance + curvature));
                let weighted = definite(&noise, "innovation")?.solve(&slope).transpose();
                sum += weighted * slope;
                vector -= weighted * of_pose.mean;
            }
            // u ~ N(sum^-1 vector, sum^-1), back to t
            let step = definite(&symmetric(&sum), "pose proposal")?.solve(&vector);
            mean += root.lower() * step;
            let half = root.solve_transposed(&symmetric(&sum));
            let full = root.solve_transposed(&half.transpose());
            information = definite(&symmetric(&full), "pose proposal")?;
        }

        let (tangent, log_ratio) = prior.draw_posterior(&mean, &information, rng);
        let pose = pose_at(&tangent);
        let log_likelihood = sampled(sensor, &noise, &pose, &held)?;
        particle.set_pose(pose);
        Ok(log_likelihood + log_ratio)
    }
}
