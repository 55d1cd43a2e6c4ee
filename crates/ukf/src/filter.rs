//! The unscented Kalman filter with additive noise (Eq. 3-9 in their right form).
//!
//! - predict: x^ = UT mean of f, P^ = UT covariance of f + Q;
//! - update: sigma points are drawn afresh from P^, so that they spread with the
//!   process noise; S = P_zz + R; see [`crate::unscented_correction`].
//!
//! Using the propagated points again in the update, as is sometimes done to save a factorisation,
//! leaves Q out of S and out of the gain.
//!
//! Both steps return an error and keep the state for NaN, infinity, or a covariance that
//! is not positive definite.

use estimation_base::{Manifold, symmetric};
use nalgebra::SMatrix;

use crate::covariance::{finite, require_symmetric, semidefinite};
use crate::error::{Step, UkfError};
use crate::innovation::Innovation;
use crate::sigma_points::SigmaPoints;
use crate::transform::Images;
use crate::update::{Update, unscented_correction};

/// A Gaussian state and its sigma points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ukf<X, const L: usize> {
    mean: X,
    covariance: SMatrix<f64, L, L>,
    set: SigmaPoints<L>,
}

impl<X: Manifold<L>, const L: usize> Ukf<X, L> {
    /// A filter starting at (`mean`, `covariance`); rounding is symmetrised away.
    ///
    /// # Errors
    /// [`UkfError::NotFinite`] for the mean, [`UkfError::Covariance`] for a matrix that is no covariance.
    pub fn new(
        mean: X,
        covariance: SMatrix<f64, L, L>,
        set: SigmaPoints<L>,
    ) -> Result<Self, UkfError> {
        require_symmetric(&covariance, Step::SigmaPoints)?;
        let covariance = symmetric(&covariance);
        semidefinite(&covariance, Step::SigmaPoints)?;
        finite(mean.local(&mean), Step::SigmaPoints, "the mean")?;
        Ok(Self {
            mean,
            covariance,
            set,
        })
    }

    /// The mean.
    pub const fn mean(&self) -> &X {
        &self.mean
    }

    /// The covariance, symmetric, in the tangent at the mean.
    pub const fn covariance(&self) -> &SMatrix<f64, L, L> {
        &self.covariance
    }

    /// Moves the state by x' = f(x) + noise of covariance `process_noise` (in the tangent at the
    /// new mean).
    ///
    /// # Errors
    /// As [`crate::unscented_transform`], and if the predicted covariance is not positive semidefinite.
    /// The state is then unchanged.
    pub fn predict(
        &mut self,
        process_noise: &SMatrix<f64, L, L>,
        mut function: impl FnMut(&X) -> X,
    ) -> Result<(), UkfError> {
        require_symmetric(process_noise, Step::Prediction)?;
        let root = semidefinite(&self.covariance, Step::SigmaPoints)?;
        let images = Images::new(&self.mean, root.lower(), &self.set, &mut function)?;
        let covariance = images.covariance(&self.set) + process_noise;
        self.move_to(images.mean, &covariance)
    }

    /// Takes in a measurement z = h(x) + noise of covariance `measurement_noise`.
    ///
    /// # Errors
    /// As [`unscented_correction`]; the state is then unchanged.
    pub fn update<Z: Manifold<M>, const M: usize>(
        &mut self,
        measurement: &Z,
        measurement_noise: &SMatrix<f64, M, M>,
        function: impl FnMut(&X) -> Z,
    ) -> Result<Innovation<M>, UkfError> {
        let update = unscented_correction(
            &self.mean,
            &self.covariance,
            &self.set,
            measurement,
            measurement_noise,
            function,
        )?;
        Ok(self.take(update))
    }

    /// The sigma points.
    pub const fn sigma_points(&self) -> &SigmaPoints<L> {
        &self.set
    }

    pub(crate) fn move_to(
        &mut self,
        mean: X,
        covariance: &SMatrix<f64, L, L>,
    ) -> Result<(), UkfError> {
        let covariance = symmetric(covariance);
        semidefinite(&covariance, Step::Prediction)?;
        self.set_state(mean, covariance);
        Ok(())
    }

    /// Takes the state of an update, and returns how well the measurement fitted.
    pub(crate) fn take<const M: usize>(&mut self, update: Update<X, L, M>) -> Innovation<M> {
        self.set_state(update.mean, update.covariance);
        update.innovation
    }

    /// Both are known to be finite, the covariance symmetric and positive semidefinite.
    pub(crate) fn set_state(&mut self, mean: X, covariance: SMatrix<f64, L, L>) {
        self.mean = mean;
        self.covariance = covariance;
    }
}
