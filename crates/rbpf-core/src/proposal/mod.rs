//! Proposals of the pose: from the motion model alone, extended, unscented.
//!
//! All return the exact increment of the importance weight,
//!
//! ```text
//! log p(z | s, map) + log p(s | s_prev, u) - log q(s)
//! ```
//!
//! with p(z | s, map) = prod_k N(z_k; z^_k(s), V_k(s) + R), V_k the covariance of landmark k
//! as it appears in the measurement. The likelihood alone is
//! right for `MotionProposal` (q = p(s | s_prev, u)) and wrong for any other: it counts the
//! measurement twice, once in drawing and once in weighting.
//!
//! [`ExtendedProposal`] and `UnscentedProposal` take in all landmarks of the frame that the particle
//! holds. Given the pose the measurements are independent, so each adds information,
//!
//! ```text
//! R_k = R + V_k,   Lambda = Q^-1 + sum H_k^T R_k^-1 H_k
//! ```
//!
//! to the motion prior (s^, Q), all in the tangent at s^. Without V_k the proposal
//! is over-confident. In the linear Gaussian case q is the exact posterior and the increment is log N(z; z^, S)
//! whatever pose is drawn.
//!
//! Landmarks that the particle does not hold are left out; a measurement that cannot be
//! predicted is left out of the proposal, and one that cannot be predicted at
//! the drawn pose makes the weight zero. Not for multimodal posteriors (a robot that may be in one of
//! two places).
//!
//! Without the feature `ukf` what needs Jacobians remains; `Linearisation::Together(0)` then proposes from the
//! motion model.

mod extended;
#[cfg(feature = "ukf")]
mod likelihood;
#[cfg(feature = "ukf")]
mod motion;
#[cfg(feature = "ukf")]
mod unscented;

pub use extended::{ExtendedProposal, Linearisation};
#[cfg(feature = "ukf")]
pub use likelihood::log_likelihood;
#[cfg(feature = "ukf")]
pub use motion::MotionProposal;
#[cfg(feature = "ukf")]
pub use unscented::UnscentedProposal;

use crate::error::RbpfError;
use crate::factor::{Factor, symmetric};
use crate::models::{
    Gaussian, ObservationJacobians, ObservationModel, PoseAndMap, check_measurement,
};
use nalgebra::{SMatrix, SVector};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::TAU;

/// log p(z | s, map) of a whole frame, landmark covariances pushed through the measurement by Jacobians:
/// the sum over the landmarks that the particle holds, minus infinity if one of them has no predicted
/// measurement at this pose.
///
/// # Errors
/// [`RbpfError::NotFinite`] or [`RbpfError::MeasurementNotFinite`] for NaN or infinity,
/// [`RbpfError::NotPositiveDefinite`] or [`RbpfError::NotSymmetric`] for the covariance of a landmark or of the noise.
pub fn linearised_log_likelihood<P, B, const D: usize, const K: usize, const M: usize>(
    sensor: &B,
    particle: &P,
    pose: &SVector<f64, D>,
    measurements: &[(u32, SVector<f64, M>)],
) -> Result<f64, RbpfError>
where
    P: PoseAndMap<D, K>,
    B: ObservationJacobians<D, K, M>,
{
    check_pose(pose)?;
    let noise = checked_noise(sensor)?;
    let mut sum = 0.0;
    for (landmark, measured) in held(particle, measurements)? {
        let Some(predicted) = sensor.predict(pose, &landmark.mean) else {
            return Ok(f64::NEG_INFINITY);
        };
        let Some((_, h)) = sensor.jacobians(pose, &landmark.mean) else {
            return Ok(f64::NEG_INFINITY);
        };
        let covariance = symmetric(&(h * landmark.covariance * h.transpose() + noise));
        let innovation = sensor.innovation(&measured, &predicted);
        sum += Factor::definite(&covariance, "innovation")?.log_density(&innovation);
    }
    Ok(sum)
}

/// The measured landmarks that the particle holds; their covariances are checked here.
fn held<P, const D: usize, const K: usize, const M: usize>(
    particle: &P,
    measurements: &[(u32, SVector<f64, M>)],
) -> Result<Vec<(Gaussian<K>, SVector<f64, M>)>, RbpfError>
where
    P: PoseAndMap<D, K>,
{
    let mut held = Vec::with_capacity(measurements.len());
    for (id, measured) in measurements {
        check_measurement(*id, measured)?;
        if let Some(landmark) = particle.landmark(*id) {
            Factor::semidefinite(&landmark.covariance, "landmark")?;
            held.push((landmark, *measured));
        }
    }
    Ok(held)
}

/// z - h(s, landmark).
pub(crate) fn residual<B, const D: usize, const K: usize, const M: usize>(
    sensor: &B,
    pose: &SVector<f64, D>,
    landmark: &SVector<f64, K>,
    measured: &SVector<f64, M>,
) -> Option<SVector<f64, M>>
where
    B: ObservationModel<D, K, M>,
{
    let predicted = sensor.predict(pose, landmark)?;
    Some(sensor.innovation(measured, &predicted))
}

/// R, if it is a covariance.
pub(crate) fn checked_noise<B, const D: usize, const K: usize, const M: usize>(
    sensor: &B,
) -> Result<SMatrix<f64, M, M>, RbpfError>
where
    B: ObservationModel<D, K, M>,
{
    let noise = sensor.noise();
    Factor::definite(&noise, "measurement noise")?;
    Ok(noise)
}

fn check_pose<const D: usize>(pose: &SVector<f64, D>) -> Result<(), RbpfError> {
    if pose.iter().all(|entry| entry.is_finite()) {
        Ok(())
    } else {
        Err(RbpfError::NotFinite {
            what: "the proposed pose",
        })
    }
}

fn standard_normal<const D: usize>(rng: &mut ChaCha8Rng) -> SVector<f64, D> {
    SVector::from_fn(|_, _| rng.sample(StandardNormal))
}

/// Draws a tangent from q = N(mean, information^-1); with it log p(s | s_prev, u) - log q(s), p = N(0, prior).
fn draw_tangent<const D: usize>(
    mean: &SVector<f64, D>,
    information: &Factor<D>,
    prior: &Factor<D>,
    rng: &mut ChaCha8Rng,
) -> (SVector<f64, D>, f64) {
    let draw = standard_normal(rng);
    // L L^T = information: L^-T e has its inverse as covariance
    let tangent = mean + information.solve_transposed(&draw);
    let log_proposal =
        -0.5 * (draw.norm_squared() - information.log_determinant() + D as f64 * TAU.ln());
    (tangent, prior.log_density(&tangent) - log_proposal)
}
