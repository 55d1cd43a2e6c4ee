//! The proposal of `FastSLAM` 2.0 (Montemerlo, Thrun, Koller, Wegbreit 2003), with exact weights.
//!
//! ```text
//! H_k, G_k = d z / d pose, d z / d landmark,   R_k = R + G_k P_k G_k^T
//! Lambda = Q^-1 + sum H_k^T R_k^-1 H_k
//! ```
//!
//! The published filter takes in the landmarks of a frame one after the other, each linearised at the mean
//! the ones before left, and weighs by the product of N(z; z^, S) met on the way. For a nonlinear
//! sensor that product is not p(z | s) p(s | s_prev, u) / q(s) of the pose drawn; here the weight is
//! that ratio. All Jacobians are in the tangent of the motion model's retract, taken at the pose of
//! linearisation: exact where retract adds and wraps, first order elsewhere. Cost: O(matches) (D^3 + M^3) per pass.

use super::{checked_noise, draw_tangent, held, linearised_log_likelihood, residual};
use crate::error::RbpfError;
use crate::factor::{Factor, symmetric};
use crate::filter::Proposal;
use crate::models::{Frame, Gaussian, MotionModel, ObservationJacobians, PoseAndMap};
use nalgebra::{SMatrix, SVector};
use rand_chacha::ChaCha8Rng;

/// Where the measurements of a frame are linearised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Linearisation {
    /// Each at the mean left by the ones before, in the order of the frame.
    #[default]
    Sequential,
    /// All at one pose, first the predicted and then the posterior just found: Gauss-Newton, which
    /// does not depend on the order. The number of passes; 0 proposes from the motion model.
    Together(u32),
}

/// Draws from the extended Kalman posterior of the pose, given all measured landmarks that the particle
/// holds. D, K: dimensions of pose and landmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ExtendedProposal<A, B, const D: usize, const K: usize> {
    /// p(s | s_prev, u).
    pub motion: A,
    /// p(z | s, landmark).
    pub sensor: B,
    /// Where the measurements are linearised.
    pub linearisation: Linearisation,
}

/// One measurement about a pose: innovation, H, and H^T R_k^-1.
struct Linearised<const D: usize, const M: usize> {
    innovation: SVector<f64, M>,
    slope: SMatrix<f64, M, D>,
    weighted: SMatrix<f64, D, M>,
}

fn linearise<B, const D: usize, const K: usize, const M: usize>(
    sensor: &B,
    noise: &SMatrix<f64, M, M>,
    pose: &SVector<f64, D>,
    landmark: &Gaussian<K>,
    measured: &SVector<f64, M>,
) -> Result<Option<Linearised<D, M>>, RbpfError>
where
    B: ObservationJacobians<D, K, M>,
{
    let (Some(innovation), Some((slope, of_landmark))) = (
        residual(sensor, pose, &landmark.mean, measured),
        sensor.jacobians(pose, &landmark.mean),
    ) else {
        return Ok(None);
    };
    let noise = noise + of_landmark * landmark.covariance * of_landmark.transpose();
    let factor = Factor::definite(&symmetric(&noise), "innovation")?;
    Ok(Some(Linearised {
        innovation,
        slope,
        weighted: factor.solve(&slope).transpose(),
    }))
}

impl<P, A, B, const D: usize, const K: usize, const M: usize> Proposal<P, Frame<A::Control, M>>
    for ExtendedProposal<A, B, D, K>
where
    P: PoseAndMap<D, K>,
    A: MotionModel<D>,
    B: ObservationJacobians<D, K, M>,
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
        let pose_at = |tangent: &SVector<f64, D>| self.motion.retract(&predicted.mean, tangent);
        let prior = Factor::definite(&predicted.covariance, "motion model")?;
        let prior_information = symmetric(&prior.solve(&SMatrix::identity()));
        let noise = checked_noise(&self.sensor)?;
        let held = held(particle, &frame.measurements)?;

        // q = N(mean, information^-1) in the tangent at the predicted pose
        let mut mean = SVector::<f64, D>::zeros();
        let mut information = Factor::definite(&prior_information, "motion model")?;
        let (passes, sequential) = match self.linearisation {
            Linearisation::Sequential => (1, true),
            Linearisation::Together(passes) => (passes, false),
        };
        for _ in 0..passes {
            let mut sum = prior_information;
            let mut vector = SVector::<f64, D>::zeros();
            let mut about = mean;
            for (landmark, measured) in &held {
                let linearised =
                    linearise(&self.sensor, &noise, &pose_at(&about), landmark, measured)?;
                let Some(seen) = linearised else { continue };
                sum += seen.weighted * seen.slope;
                vector += seen.weighted * (seen.innovation + seen.slope * about);
                if sequential {
                    about = Factor::definite(&symmetric(&sum), "pose proposal")?.solve(&vector);
                }
            }
            information = Factor::definite(&symmetric(&sum), "pose proposal")?;
            mean = information.solve(&vector);
        }

        let (tangent, log_ratio) = draw_tangent(&mean, &information, &prior, rng);
        let pose = pose_at(&tangent);
        let log_likelihood =
            linearised_log_likelihood(&self.sensor, particle, &pose, &frame.measurements)?;
        particle.set_pose(pose);
        Ok(log_likelihood + log_ratio)
    }
}
