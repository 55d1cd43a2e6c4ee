//! The likelihood log p(z | s, map) of a whole frame.
//!
//! It is the sum over the measured landmarks that the particle holds, and minus infinity if one of them
//! has no predicted measurement at this pose.

use crate::covariance::definite;
use crate::error::RangeBearingError;
use crate::frame::check_measurement;
use crate::innovation::{linearise, sample};
use crate::landmark_particle::LandmarkParticle;
use crate::models::{Gaussian, ObservationJacobians, ObservationModel};
use crate::spread::Spread;
use nalgebra::{SMatrix, SVector};

/// The landmarks that the particle holds, in the form `T` that a proposal needs, with their measurements.
pub(crate) type Held<T, const M: usize> = Vec<(T, SVector<f64, M>)>;

/// The measured landmarks that the particle holds, each brought into `form`.
pub(crate) fn held<T, const D: usize, const K: usize, const M: usize>(
    particle: &LandmarkParticle<D, K>,
    measurements: &[(u32, SVector<f64, M>)],
    form: impl Fn(&Gaussian<K>) -> Result<T, RangeBearingError>,
) -> Result<Held<T, M>, RangeBearingError> {
    let mut held = Vec::with_capacity(measurements.len());
    for (id, measured) in measurements {
        check_measurement(*id, measured)?;
        if let Some(landmark) = particle.map.get(*id) {
            held.push((form(&landmark.position)?, *measured));
        }
    }
    Ok(held)
}

/// The measured landmarks that the particle holds, factorised once.
pub(crate) fn held_spreads<const D: usize, const K: usize, const M: usize>(
    particle: &LandmarkParticle<D, K>,
    measurements: &[(u32, SVector<f64, M>)],
) -> Result<Held<Spread<K>, M>, RangeBearingError> {
    held(particle, measurements, |position| {
        Spread::of(position, "landmark")
    })
}

/// The likelihood to first order in the landmarks.
pub(crate) fn linearised<B, const D: usize, const K: usize, const M: usize>(
    sensor: &B,
    noise: &SMatrix<f64, M, M>,
    pose: &SVector<f64, D>,
    held: &Held<Gaussian<K>, M>,
) -> Result<f64, RangeBearingError>
where
    B: ObservationJacobians<D, K, M>,
{
    sum_log_densities(pose, held, |landmark, measured| {
        let seen = linearise(sensor, noise, pose, landmark, measured);
        Ok(seen.map(|seen| seen.innovation))
    })
}

/// The likelihood by sigma points of the landmarks.
pub(crate) fn sampled<B, const D: usize, const K: usize, const M: usize>(
    sensor: &B,
    noise: &SMatrix<f64, M, M>,
    pose: &SVector<f64, D>,
    held: &Held<Spread<K>, M>,
) -> Result<f64, RangeBearingError>
where
    B: ObservationModel<D, K, M>,
{
    sum_log_densities(pose, held, |landmark, measured| {
        let seen = sample(sensor, noise, pose, landmark, measured)?;
        Ok(seen.map(|seen| seen.innovation))
    })
}

/// The sum of log N(d; 0, S) over the innovations (d, S).
fn sum_log_densities<T, const D: usize, const M: usize>(
    pose: &SVector<f64, D>,
    held: &Held<T, M>,
    innovation: impl Fn(&T, &SVector<f64, M>) -> Result<Option<Gaussian<M>>, RangeBearingError>,
) -> Result<f64, RangeBearingError> {
    if !pose.iter().all(|entry| entry.is_finite()) {
        return Err(RangeBearingError::NotFinite {
            what: "the proposed pose",
        });
    }
    let mut sum = 0.0;
    for (landmark, measured) in held {
        let Some(innovation) = innovation(landmark, measured)? else {
            return Ok(f64::NEG_INFINITY);
        };
        sum += definite(&innovation.covariance, "innovation")?.log_density(&innovation.mean);
    }
    Ok(sum)
}
