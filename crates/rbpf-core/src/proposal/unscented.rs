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
//! starting at the motion prior (s^, Q) and iterated about the posterior just found, always with
//! the prior (s^, Q). The covariance of the pose is factorised once an iteration and that of a landmark once
//! a frame. Cost per particle and iteration: 2 D + 2 K + 1 predictions and one M x M factor a match.

use super::likelihood::{held_spreads, sampled_log_likelihood};
use super::{checked_noise, draw_tangent, residual};
use crate::error::RbpfError;
use crate::factor::{Factor, symmetric};
use crate::filter::Proposal;
use crate::models::{Frame, MotionModel, ObservationModel, PoseAndMap};
use crate::unscented::Spread;
use nalgebra::{SMatrix, SVector};
use rand_chacha::ChaCha8Rng;

/// Draws from the unscented posterior of the pose, given all measured landmarks that the particle
/// holds. D, K: dimensions of pose and landmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnscentedProposal<A, B, const D: usize, const K: usize> {
    /// p(s | s_prev, u).
    pub motion: A,
    /// p(z | s, landmark).
    pub sensor: B,
    /// Linearisations; 2 or 3 are enough, 0 proposes from the motion model.
    pub iterations: u32,
}

impl<P, A, B, const D: usize, const K: usize, const M: usize> Proposal<P, Frame<A::Control, M>>
    for UnscentedProposal<A, B, D, K>
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
        let sensor = &self.sensor;
        let predicted = self.motion.predict(&particle.pose(), &frame.control);
        let pose_at = |tangent: &SVector<f64, D>| self.motion.retract(&predicted.mean, tangent);
        let prior = Factor::definite(&predicted.covariance, "motion model")?;
        let prior_information = symmetric(&prior.solve(&SMatrix::identity()));
        let noise = checked_noise(sensor)?;
        let held = held_spreads(particle, &frame.measurements)?;

        // q = N(mean, information^-1) in the tangent at the predicted pose
        let mut mean = SVector::<f64, D>::zeros();
        let mut root = prior;
        let mut information = Factor::definite(&prior_information, "motion model")?;
        for iteration in 0..self.iterations {
            if iteration > 0 {
                let covariance = symmetric(&information.solve(&SMatrix::identity()));
                root = Factor::definite(&covariance, "pose proposal")?;
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
                let weighted = Factor::definite(&noise, "innovation")?
                    .solve(&slope)
                    .transpose();
                sum += weighted * slope;
                vector -= weighted * of_pose.mean;
            }
            // u ~ N(sum^-1 vector, sum^-1), back to t
            let step = Factor::definite(&symmetric(&sum), "pose proposal")?.solve(&vector);
            mean += root.lower() * step;
            let half = root.solve_transposed(&symmetric(&sum));
            let full = root.solve_transposed(&half.transpose());
            information = Factor::definite(&symmetric(&full), "pose proposal")?;
        }

        let (tangent, log_ratio) = draw_tangent(&mean, &information, &prior, rng);
        let pose = pose_at(&tangent);
        let log_likelihood = sampled_log_likelihood(sensor, &noise, &pose, &held)?;
        particle.set_pose(pose);
        Ok(log_likelihood + log_ratio)
    }
}
