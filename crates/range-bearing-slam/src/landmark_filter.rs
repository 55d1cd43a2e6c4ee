//! The filter of one landmark, given the pose.
//!
//! A landmark that the sensor cannot start or predict from this pose gives `None`, which leaves the map
//! as it is. Posterior covariances are symmetric and in Joseph form.

use crate::covariance::{definite, semidefinite};
use crate::error::RangeBearingError;
use crate::frame::check_measurement;
use crate::innovation::{checked_noise, linearise, sample};
use crate::models::{Gaussian, InverseObservation, ObservationJacobians};
use crate::spread::Spread;
use estimation_base::{CholeskyFactor, symmetric};
use nalgebra::{SMatrix, SVector};

/// A landmark after a measurement, and the fit of the measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LandmarkUpdate<const K: usize> {
    /// The landmark after the measurement.
    pub posterior: Gaussian<K>,
    /// Normalised innovation squared, chi-square of M degrees of freedom.
    pub nis: f64,
    /// log N(z; z^, S).
    pub log_likelihood: f64,
}

/// Starts and updates one landmark. S is the sensor; D, K and M are the dimensions of pose, landmark and
/// measurement.
pub trait LandmarkFilter<S, const D: usize, const K: usize, const M: usize>: Sync {
    /// The landmark after its first measurement.
    ///
    /// # Errors
    /// [`RangeBearingError`] for values that are not finite and matrices that are no covariances.
    fn start(
        &self,
        sensor: &S,
        pose: &SVector<f64, D>,
        measurement: &SVector<f64, M>,
    ) -> Result<Option<Gaussian<K>>, RangeBearingError>;

    /// The landmark after a further measurement.
    ///
    /// # Errors
    /// [`RangeBearingError`] for values that are not finite and matrices that are no covariances.
    fn update(
        &self,
        sensor: &S,
        pose: &SVector<f64, D>,
        measurement: &SVector<f64, M>,
        prior: &Gaussian<K>,
    ) -> Result<Option<LandmarkUpdate<K>>, RangeBearingError>;
}

/// The extended Kalman filter of `FastSLAM`, by Jacobians.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExtendedLandmarks;

/// The unscented Kalman filter, by sigma points of the measurement at the start and of the landmark
/// afterwards.
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
    ) -> Result<Option<Gaussian<K>>, RangeBearingError> {
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
    ) -> Result<Option<LandmarkUpdate<K>>, RangeBearingError> {
        check_measurement(0, measurement)?;
        checked(*prior)?;
        let noise = checked_noise(sensor)?;
        let Some(seen) = linearise(sensor, &noise, pose, prior, measurement) else {
            return Ok(None);
        };
        let h = seen.of_landmark;
        let factor = definite(&seen.innovation.covariance, "innovation")?;
        let gain = factor.solve(&(h * prior.covariance)).transpose();
        let rest = SMatrix::<f64, K, K>::identity() - gain * h;
        let joseph = rest * prior.covariance * rest.transpose() + gain * noise * gain.transpose();
        let posterior = Gaussian {
            mean: prior.mean + gain * seen.innovation.mean,
            covariance: symmetric(&joseph),
        };
        updated(posterior, &factor, &seen.innovation.mean).map(Some)
    }
}

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
    ) -> Result<Option<Gaussian<K>>, RangeBearingError> {
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
    ) -> Result<Option<LandmarkUpdate<K>>, RangeBearingError> {
        check_measurement(0, measurement)?;
        let noise = checked_noise(sensor)?;
        let spread = Spread::of(prior, "landmark")?;
        let Some(seen) = sample(sensor, &noise, pose, &spread, measurement)? else {
            return Ok(None);
        };
        let innovation = seen.innovation;
        let factor = definite(&innovation.covariance, "innovation")?;
        // P - K S K^T = L (I - G^T S^-1 G) L^T with G = d residual / d u; in square-root form the
        // Joseph form of the same, with the noise of the linear fit (image - G G^T + R)
        let slope = seen.slope;
        let root = spread.root;
        let gain = factor.solve(&slope).transpose();
        let rest = SMatrix::<f64, K, K>::identity() - gain * slope;
        let fit_noise = innovation.covariance - slope * slope.transpose();
        let whitened = rest * rest.transpose() + gain * fit_noise * gain.transpose();
        let posterior = Gaussian {
            mean: prior.mean - root.lower() * (gain * innovation.mean),
            covariance: symmetric(&(root.lower() * whitened * root.lower().transpose())),
        };
        updated(posterior, &factor, &innovation.mean).map(Some)
    }
}

/// The posterior, checked, with the fit of an innovation whose covariance has this factor.
fn updated<const K: usize, const M: usize>(
    posterior: Gaussian<K>,
    factor: &CholeskyFactor<M>,
    innovation: &SVector<f64, M>,
) -> Result<LandmarkUpdate<K>, RangeBearingError> {
    Ok(LandmarkUpdate {
        posterior: checked(posterior)?,
        nis: factor.mahalanobis_squared(innovation),
        log_likelihood: factor.log_density(innovation),
    })
}

/// The landmark, if it is finite and its covariance is one.
fn checked<const K: usize>(landmark: Gaussian<K>) -> Result<Gaussian<K>, RangeBearingError> {
    if !landmark.mean.iter().all(|entry| entry.is_finite()) {
        return Err(RangeBearingError::NotFinite { what: "landmark" });
    }
    semidefinite(&landmark.covariance, "landmark")?;
    Ok(landmark)
}
