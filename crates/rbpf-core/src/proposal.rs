//! Two generic proposals: from the motion model alone, and unscented.
//!
//! Both return the exact increment of the importance weight,
//!
//! ```text
//! log p(z | s, map) + log p(s | s_prev, u) - log q(s)
//! ```
//!
//! with p(z | s, map) = prod_k N(z_k; z^_k(s), V_k(s) + R), V_k the covariance of landmark k
//! pushed through the measurement by sigma points. The `paper` scores the likelihood alone, which is
//! right for [`MotionProposal`] (q = p(s | s_prev, u)) and wrong for any other: it counts the
//! measurement twice, once in drawing and once in weighting.
//!
//! [`UnscentedProposal`] (Eq. 7-12 in their right form) takes in all matched landmarks at once. Given
//! the pose the measurements are independent, so each adds information, by statistical linearisation
//! z_k ~ H_k (s - s_bar) + z_bar_k + e_k about the present estimate (s_bar, P):
//!
//! ```text
//! H_k = P_zs P^-1,   R_k = R + V_k + (P_zz - H_k P H_k^T)
//! Lambda = Q^-1 + sum H_k^T R_k^-1 H_k
//! ```
//!
//! starting at the motion prior (s^, Q) and iterated about the posterior just found, always with
//! the prior (s^, Q), all in the tangent at s^. The landmark's own covariance is in R_k; without it the proposal is
//! over-confident. In the linear Gaussian case q is the exact posterior and the increment is log N(z; z^, S) whatever pose is drawn.
//!
//! Landmarks that the particle does not hold are left out; a measurement that cannot be
//! predicted at a sigma point is left out of the proposal, and one that cannot be predicted at
//! the drawn pose makes the weight zero. Cost per frame and particle: O(matches) times
//! (2 D + 1 + 2 K) predictions and iteration.
//!
//! Not for multimodal posteriors (a robot that may be in one of two places).

use crate::error::RbpfError;
use crate::filter::Proposal;
use crate::models::{
    Frame, MotionModel, ObservationModel, PoseAndMap, factorise, from_ukf, log_gaussian,
};
use nalgebra::{SMatrix, SVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::TAU;
use ukf::{SigmaPoints, Transformed, UkfError, unscented_transform};

/// Draws from p(s | s_prev, u) and weights by the likelihood: the conventional filter.
/// D, K: dimensions of pose and landmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotionProposal<A, B, const D: usize, const K: usize> {
    /// p(s | s_prev, u).
    pub motion: A,
    /// p(z | s, landmark).
    pub sensor: B,
}

/// Draws from the unscented posterior of the pose, given all matched landmarks.
/// D, K: dimensions of pose and landmark.
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
    for MotionProposal<A, B, D, K>
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
        let predicted = self.motion.predict(&particle.pose(), &frame.control);
        let root = factorise(&predicted.covariance, "motion model")?;
        let tangent = root.lower() * standard_normal(rng);
        let pose = self.motion.retract(&predicted.mean, &tangent);
        let log_likelihood = log_likelihood(&self.sensor, particle, &pose, &frame.measurements)?;
        particle.set_pose(pose);
        Ok(log_likelihood)
    }
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
        let predicted = self.motion.predict(&particle.pose(), &frame.control);
        let pose_at = |tangent: &SVector<f64, D>| self.motion.retract(&predicted.mean, tangent);
        let prior = factorise(&predicted.covariance, "motion model")?;
        let prior_information = prior.solve(&SMatrix::identity());

        // q = N(mean, information^-1) in the tangent at the predicted pose
        let mut mean = SVector::<f64, D>::zeros();
        let mut covariance = predicted.covariance;
        let mut information = factorise(&symmetric(&prior_information), "motion model")?;
        for _ in 0..self.iterations {
            let mut sum = prior_information;
            let mut vector = SVector::<f64, D>::zeros();
            let spread = factorise(&covariance, "pose proposal")?;
            for (id, measured) in &frame.measurements {
                let Some(landmark) = particle.landmark(*id) else {
                    continue;
                };
                let about_pose =
                    unscented_transform(&mean, &covariance, &SigmaPoints::default(), |tangent| {
                        residual(&self.sensor, &pose_at(tangent), &landmark.mean, measured)
                    });
                let pose = pose_at(&mean);
                let about_landmark = unscented_transform(
                    &landmark.mean,
                    &landmark.covariance,
                    &SigmaPoints::default(),
                    |position| residual(&self.sensor, &pose, position, measured),
                );
                let (Some(about_pose), Some(about_landmark)) =
                    (where_defined(about_pose)?, where_defined(about_landmark)?)
                else {
                    continue;
                };
                // residual ~ about_pose.mean + G (t - mean), G = -H
                let slope = spread.solve(&about_pose.cross_covariance).transpose();
                let curvature = about_pose.covariance - slope * covariance * slope.transpose();
                let noise = self.sensor.noise() + about_landmark.covariance + curvature;
                let noise = factorise(&symmetric(&noise), "innovation")?;
                let weighted = noise.solve(&slope).transpose();
                sum += weighted * slope;
                vector += weighted * (slope * mean - about_pose.mean);
            }
            information = factorise(&symmetric(&sum), "pose proposal")?;
            mean = information.solve(&vector);
            covariance = symmetric(&information.solve(&SMatrix::identity()));
        }

        let draw = standard_normal(rng);
        // L L^T = information: L^-T e has its inverse as covariance
        let tangent = mean + solve_upper(information.lower(), &draw);
        let log_proposal =
            -0.5 * (draw.norm_squared() - information.log_determinant() + D as f64 * TAU.ln());
        let log_prior = log_gaussian(&tangent, &prior);
        let pose = pose_at(&tangent);
        let log_likelihood = log_likelihood(&self.sensor, particle, &pose, &frame.measurements)?;
        particle.set_pose(pose);
        Ok(log_likelihood + log_prior - log_proposal)
    }
}

/// log p(z | s, map) of a whole frame: the sum over the landmarks that the particle holds, minus
/// infinity if one of them has no predicted measurement at this pose.
///
/// # Errors
/// [`RbpfError::NotFinite`] for a pose or a measurement with NaN, [`RbpfError::NotPositiveDefinite`] for a
/// landmark's or an innovation's covariance.
pub fn log_likelihood<P, B, const D: usize, const K: usize, const M: usize>(
    sensor: &B,
    particle: &P,
    pose: &SVector<f64, D>,
    measurements: &[(u32, SVector<f64, M>)],
) -> Result<f64, RbpfError>
where
    P: PoseAndMap<D, K>,
    B: ObservationModel<D, K, M>,
{
    if !pose.iter().all(|entry| entry.is_finite()) {
        return Err(RbpfError::NotFinite {
            what: "the proposed pose",
        });
    }
    let mut sum = 0.0;
    for (id, measured) in measurements {
        if !measured.iter().all(|entry| entry.is_finite()) {
            return Err(RbpfError::NotFinite {
                what: "a measurement",
            });
        }
        let Some(landmark) = particle.landmark(*id) else {
            continue;
        };
        let residuals = unscented_transform(
            &landmark.mean,
            &landmark.covariance,
            &SigmaPoints::default(),
            |position| residual(sensor, pose, position, measured),
        );
        let Some(residuals) = where_defined(residuals)? else {
            return Ok(f64::NEG_INFINITY);
        };
        let innovation_covariance = symmetric(&(residuals.covariance + sensor.noise()));
        let factor = factorise(&innovation_covariance, "innovation")?;
        sum += log_gaussian(&residuals.mean, &factor);
    }
    Ok(sum)
}

/// z - h(s, landmark), NaN where there is no prediction.
fn residual<B, const D: usize, const K: usize, const M: usize>(
    sensor: &B,
    pose: &SVector<f64, D>,
    landmark: &SVector<f64, K>,
    measured: &SVector<f64, M>,
) -> SVector<f64, M>
where
    B: ObservationModel<D, K, M>,
{
    sensor.predict(pose, landmark).map_or_else(
        || SVector::repeat(f64::NAN),
        |predicted| sensor.innovation(measured, &predicted),
    )
}

/// A transform whose function had no value somewhere is no error but nothing.
fn where_defined<const L: usize, const M: usize>(
    result: Result<Transformed<SVector<f64, M>, L, M>, UkfError>,
) -> Result<Option<Transformed<SVector<f64, M>, L, M>>, RbpfError> {
    match result {
        Ok(transformed) => Ok(Some(transformed)),
        Err(UkfError::NotFinite {
            step: ukf::Step::Function,
            ..
        }) => Ok(None),
        Err(error) => Err(from_ukf(&error, "pose or landmark")),
    }
}

fn standard_normal<const D: usize>(rng: &mut ChaCha8Rng) -> SVector<f64, D> {
    SVector::from_fn(|_, _| rng.sample(StandardNormal))
}

/// L^-T b.
fn solve_upper<const D: usize>(
    lower: &SMatrix<f64, D, D>,
    right: &SVector<f64, D>,
) -> SVector<f64, D> {
    let mut x = *right;
    for row in (0..D).rev() {
        for below in row + 1..D {
            x[row] -= lower[(below, row)] * x[below];
        }
        x[row] /= lower[(row, row)];
    }
    x
}

fn symmetric<const N: usize>(matrix: &SMatrix<f64, N, N>) -> SMatrix<f64, N, N> {
    (matrix + matrix.transpose()) * 0.5
}
