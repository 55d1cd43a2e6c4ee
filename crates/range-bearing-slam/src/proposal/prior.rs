//! The motion prior of a particle, and draws in its tangent.

use crate::covariance::definite;
use crate::error::RangeBearingError;
use crate::models::MotionModel;
use estimation_base::{CholeskyFactor, symmetric};
use nalgebra::{SMatrix, SVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::TAU;

/// The motion prior N(0, Q) in the tangent at the predicted pose.
pub(crate) struct MotionPrior<const D: usize> {
    /// The predicted pose.
    pub(crate) pose: SVector<f64, D>,
    /// Q.
    pub(crate) covariance: SMatrix<f64, D, D>,
    /// The factor of Q.
    pub(crate) factor: CholeskyFactor<D>,
}

impl<const D: usize> MotionPrior<D> {
    /// The prior of a robot that was at `from`.
    pub(crate) fn of<A: MotionModel<D>>(
        motion: &A,
        from: &SVector<f64, D>,
        control: &A::Control,
    ) -> Result<Self, RangeBearingError> {
        let predicted = motion.predict(from, control);
        Ok(Self {
            pose: predicted.mean,
            covariance: predicted.covariance,
            factor: definite(&predicted.covariance, "motion model")?,
        })
    }

    /// Q^-1 and its factor.
    pub(crate) fn information(
        &self,
    ) -> Result<(SMatrix<f64, D, D>, CholeskyFactor<D>), RangeBearingError> {
        let information = symmetric(&self.factor.solve(&SMatrix::identity()));
        Ok((information, definite(&information, "motion model")?))
    }

    /// Draws a tangent from q = N(mean, information^-1); returns it with log p - log q, where p is the
    /// prior.
    pub(crate) fn draw_posterior(
        &self,
        mean: &SVector<f64, D>,
        information: &CholeskyFactor<D>,
        rng: &mut ChaCha8Rng,
    ) -> (SVector<f64, D>, f64) {
        let draw = standard_normal(rng);
        // L L^T = information: L^-T e has its inverse as covariance
        let tangent = mean + information.solve_transposed(&draw);
        let log_proposal =
            -0.5 * (draw.norm_squared() - information.log_determinant() + D as f64 * TAU.ln());
        (tangent, self.factor.log_density(&tangent) - log_proposal)
    }
}

/// D independent draws from the standard normal distribution.
pub(crate) fn standard_normal<const D: usize>(rng: &mut ChaCha8Rng) -> SVector<f64, D> {
    SVector::from_fn(|_, _| rng.sample(StandardNormal))
}
