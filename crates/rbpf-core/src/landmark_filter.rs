//! The filter of one landmark, given the pose: start it, update it.
//!
//! A landmark that the sensor cannot start or predict from this pose gives `None`, which leaves the map as
//! it is. The posterior covariance is symmetric and in Joseph form where Jacobians are at hand.

use crate::error::RbpfError;
use crate::factor::{Factor, symmetric};
use crate::models::{Gaussian, InverseObservation, ObservationJacobians, check_measurement};
use crate::proposal::{checked_noise, residual};
#[cfg(feature = "ukf")]
use crate::unscented::Spread;
use nalgebra::{SMatrix, SVector};

/// A landmark after a measurement, and how well that fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LandmarkUpdate<const K: usize> {
    /// The landmark now.
    pub posterior: Gaussian<K>,
    /// Normalised innovation squared, chi-square of M degrees of freedom.
    pub nis: f64,
    /// log N(z; z^, S).
    pub log_likelihood: f64,
}

/// Starts and updates one landmark. S: the sensor; D, K, M: sizes of pose, landmark, measurement.
pub trait LandmarkFilter<S, const D: usize, const K: usize, const M: usize>: Sync {
    /// The landmark seen for the first time.
    ///
    /// # Errors
    /// For NaN, and covariances that are none.
    fn start(
        &self,
        sensor: &S,
        pose: &SVector<f64, D>,
        measurement: &SVector<f64, M>,
    ) -> Result<Option<Gaussian<K>>, RbpfError>;

    /// The landmark seen again.
    ///
    /// # Errors
    /// For NaN, and covariances that are none.
    fn update(
        &self,
        sensor: &S,
        pose: &SVector<f64, D>,
        measurement: &SVector<f64, M>,
        prior: &Gaussian<K>,
    ) -> Result<Option<LandmarkUpdate<K>>, RbpfError>;
}

/// By Jacobians: the extended Kalman filter of `FastSLAM`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExtendedLandmarks;

#[cfg(feature = "ukf")]
/// By sigma points, of the measurement at the start and of the landmark afterwards.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct UnscentedLandmarks;

impl<S, const D: usize, const K: usize, const M: usize> LandmarkFilter<S, D, K, M>
    for ExtendedLandmarks
where
    S: ObservationJacobians<D, K, M> + InverseObservation<D, K, M>,
{
    fn start(
        &self,
        sensor: &S,
        pose: &SVector<f64, D>,
        measurement: &SVector<f64, M>,
    ) -> Result<Option<Gaussian<K>>, RbpfError> {
        check_measurement(0, measurement)?;
        let noise = checked_noise(sensor)?;
        let (Some(mean), Some(j)) = (
            sensor.locate(pose, measurement),
            sensor.locate_jacobian(pose, measurement),
        ) else {
            return Ok(None);
        };
        let covariance = symmetric(&(j * noise * j.transpose()));
        checked(Gaussian { mean, covariance }).map(Some)
    }

    fn update(
        &self,
        sensor: &S,
        pose: &SVector<f64, D>,
        measurement: &SVector<f64, M>,
        prior: &Gaussian<K>,
    ) -> Result<Option<LandmarkUpdate<K>>, RbpfError> {
        check_measurement(0, measurement)?;
        checked(*prior)?;
        let noise = checked_noise(sensor)?;
        let (Some(innovation), Some((_, h))) = (
            residual(sensor, pose, &prior.mean, measurement),
            sensor.jacobians(pose, &prior.mean),
        ) else {
            return Ok(None);
        };
        let innovation_covariance = symmetric(&(h * prior.covariance * h.transpose() + noise));
        let factor = Factor::definite(&innovation_covariance, "innovation")?;
        let gain = factor.solve(&(h * prior.covariance)).transpose();
        let rest = SMatrix::<f64, K, K>::identity() - gain * h;
        let joseph = rest * prior.covariance * rest.transpose() + gain * noise * gain.transpose();
        let posterior = Gaussian {
            mean: prior.mean + gain * innovation,
            covariance: symmetric(&joseph),
        };
        Ok(Some(LandmarkUpdate {
            posterior: checked(posterior)?,
            nis: factor.mahalanobis_squared(&innovation),
            log_likelihood: factor.log_density(&innovation),
        }))
    }
}

#[cfg(feature = "ukf")]
impl<S, const D: usize, const K: usize, const M: usize> LandmarkFilter<S, D, K, M>
    for UnscentedLandmarks
where
    S: InverseObservation<D, K, M>,
{
    fn start(
        &self,
        sensor: &S,
        pose: &SVector<f64, D>,
        measurement: &SVector<f64, M>,
    ) -> Result<Option<Gaussian<K>>, RbpfError> {
        check_measurement(0, measurement)?;
        let seen = Gaussian {
            mean: *measurement,
            covariance: checked_noise(sensor)?,
        };
        let seen = Spread::of(&seen, "measurement noise")?;
        let Some(image) = seen.through(|z| sensor.locate(pose, z))? else {
            return Ok(None);
        };
        checked(Gaussian {
            mean: image.mean,
            covariance: image.covariance,
        })
        .map(Some)
    }

    fn update(
        &self,
        sensor: &S,
        pose: &SVector<f64, D>,
        measurement: &SVector<f64, M>,
        prior: &Gaussian<K>,
    ) -> Result<Option<LandmarkUpdate<K>>, RbpfError> {
        check_measurement(0, measurement)?;
        let noise = checked_noise(sensor)?;
        let spread = Spread::of(prior, "landmark")?;
        let Some(image) = spread.through(|at| residual(sensor, pose, at, measurement))? else {
            return Ok(None);
        };
        let innovation_covariance = symmetric(&(image.covariance + noise));
        let factor = Factor::definite(&innovation_covariance, "innovation")?;
        // P - K S K^T = L (I - G^T S^-1 G) L^T with G = d residual / d u; in square-root form the
        // Joseph form of the same, with the noise of the linear fit (image - G G^T + R)
        let slope = image.cross_covariance.transpose();
        let root = spread.root;
        let gain = factor.solve(&slope).transpose();
        let rest = SMatrix::<f64, K, K>::identity() - gain * slope;
        let fit_noise = innovation_covariance - slope * slope.transpose();
        let whitened = rest * rest.transpose() + gain * fit_noise * gain.transpose();
        let posterior = Gaussian {
            mean: prior.mean - root.lower() * (gain * image.mean),
            covariance: symmetric(&(root.lower() * whitened * root.lower().transpose())),
        };
        Ok(Some(LandmarkUpdate {
            posterior: checked(posterior)?,
            nis: factor.mahalanobis_squared(&image.mean),
            log_likelihood: factor.log_density(&image.mean),
        }))
    }
}

fn checked<const K: usize>(landmark: Gaussian<K>) -> Result<Gaussian<K>, RbpfError> {
    if !landmark.mean.iter().all(|entry| entry.is_finite()) {
        return Err(RbpfError::NotFinite { what: "landmark" });
    }
    Factor::semidefinite(&landmark.covariance, "landmark")?;
    Ok(landmark)
}
