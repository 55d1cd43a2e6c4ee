//! The innovation of one measurement, to first order or by sigma points.
//!
//! With the residual d(s, l) = z - h(s, l), a landmark N(l, V) and the noise R of the sensor, the innovation
//! at a pose s is Gaussian with mean d and covariance
//!
//! ```text
//! S = G V G^T + R,   G = d h / d landmark
//! ```
//!
//! to first order, or with the covariance of d over the sigma points of the landmark in the place of
//! G V G^T. Likelihoods, landmark filters and proposals all start from it.

use crate::covariance::definite;
use crate::error::RangeBearingError;
use crate::models::{Gaussian, ObservationJacobians, ObservationModel};
use crate::spread::Spread;
use estimation_base::symmetric;
use nalgebra::{SMatrix, SVector};

/// z - h(s, landmark); `None` where there is no prediction.
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

/// The covariance R of the noise, checked.
pub(crate) fn checked_noise<B, const D: usize, const K: usize, const M: usize>(
    sensor: &B,
) -> Result<SMatrix<f64, M, M>, RangeBearingError>
where
    B: ObservationModel<D, K, M>,
{
    let noise = sensor.noise();
    definite(&noise, "measurement noise")?;
    Ok(noise)
}

/// An innovation to first order, with the derivatives of the measurement.
pub(crate) struct Linearised<const D: usize, const K: usize, const M: usize> {
    /// Mean d and covariance S.
    pub(crate) innovation: Gaussian<M>,
    /// d z / d tangent of the pose.
    pub(crate) of_pose: SMatrix<f64, M, D>,
    /// G = d z / d landmark.
    pub(crate) of_landmark: SMatrix<f64, M, K>,
}

/// The innovation to first order; `None` where there is no prediction.
pub(crate) fn linearise<B, const D: usize, const K: usize, const M: usize>(
    sensor: &B,
    noise: &SMatrix<f64, M, M>,
    pose: &SVector<f64, D>,
    landmark: &Gaussian<K>,
    measured: &SVector<f64, M>,
) -> Option<Linearised<D, K, M>>
where
    B: ObservationJacobians<D, K, M>,
{
    let mean = residual(sensor, pose, &landmark.mean, measured)?;
    let (of_pose, of_landmark) = sensor.jacobians(pose, &landmark.mean)?;
    let covariance = of_landmark * landmark.covariance * of_landmark.transpose() + noise;
    Some(Linearised {
        innovation: Gaussian {
            mean,
            covariance: symmetric(&covariance),
        },
        of_pose,
        of_landmark,
    })
}

/// An innovation by sigma points.
pub(crate) struct Sampled<const K: usize, const M: usize> {
    /// Mean d and covariance S.
    pub(crate) innovation: Gaussian<M>,
    /// d residual / d u, where the landmark is m + L u.
    pub(crate) slope: SMatrix<f64, M, K>,
}

/// The innovation by sigma points; `None` where one of them has no prediction.
pub(crate) fn sample<B, const D: usize, const K: usize, const M: usize>(
    sensor: &B,
    noise: &SMatrix<f64, M, M>,
    pose: &SVector<f64, D>,
    landmark: &Spread<K>,
    measured: &SVector<f64, M>,
) -> Result<Option<Sampled<K, M>>, RangeBearingError>
where
    B: ObservationModel<D, K, M>,
{
    let image = landmark.through(|at| residual(sensor, pose, at, measured))?;
    Ok(image.map(|image| Sampled {
        innovation: Gaussian {
            mean: image.mean,
            covariance: symmetric(&(image.covariance + noise)),
        },
        slope: image.cross_covariance.transpose(),
    }))
}
