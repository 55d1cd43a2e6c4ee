//! log p(z | s, map) with landmark covariances by sigma points.

use super::{check_pose, checked_noise, residual};
use crate::error::RbpfError;
use crate::factor::{Factor, symmetric};
use crate::models::{ObservationModel, PoseAndMap, check_measurement};
use crate::unscented::Spread;
use nalgebra::{SMatrix, SVector};

/// log p(z | s, map) of a whole frame, landmark covariances pushed through the measurement by sigma
/// points: the sum over the landmarks that the particle holds, minus
/// infinity if one of them has no predicted measurement at this pose.
///
/// # Errors
/// [`RbpfError::NotFinite`] or [`RbpfError::MeasurementNotFinite`] for NaN or infinity,
/// [`RbpfError::NotPositiveDefinite`] or [`RbpfError::NotSymmetric`] for the covariance of a landmark or of the noise.
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
    let noise = checked_noise(sensor)?;
    let held = held_spreads(particle, measurements)?;
    sampled_log_likelihood(sensor, &noise, pose, &held)
}

/// A landmark and its measurement.
pub(super) type HeldSpread<const K: usize, const M: usize> = (Spread<K>, SVector<f64, M>);

/// The measured landmarks that the particle holds, factorised once.
pub(super) fn held_spreads<P, const D: usize, const K: usize, const M: usize>(
    particle: &P,
    measurements: &[(u32, SVector<f64, M>)],
) -> Result<Vec<HeldSpread<K, M>>, RbpfError>
where
    P: PoseAndMap<D, K>,
{
    let mut held = Vec::with_capacity(measurements.len());
    for (id, measured) in measurements {
        check_measurement(*id, measured)?;
        if let Some(landmark) = particle.landmark(*id) {
            held.push((Spread::of(&landmark, "landmark")?, *measured));
        }
    }
    Ok(held)
}

pub(super) fn sampled_log_likelihood<B, const D: usize, const K: usize, const M: usize>(
    sensor: &B,
    noise: &SMatrix<f64, M, M>,
    pose: &SVector<f64, D>,
    held: &[HeldSpread<K, M>],
) -> Result<f64, RbpfError>
where
    B: ObservationModel<D, K, M>,
{
    check_pose(pose)?;
    let mut sum = 0.0;
    for (landmark, measured) in held {
        let Some(image) = landmark.through(|at| residual(sensor, pose, at, measured))? else {
            return Ok(f64::NEG_INFINITY);
        };
        let covariance = symmetric(&(image.covariance + noise));
        sum += Factor::definite(&covariance, "innovation")?.log_density(&image.mean);
    }
    Ok(sum)
}
