//! What the generic proposals need to know of a robot and its sensor.
//!
//! D is the dimension of the pose, K of a landmark, M of a measurement. Poses are vectors whose
//! headings are plain entries: [`MotionModel::retract`] wraps them.

use crate::error::RbpfError;
use nalgebra::{SMatrix, SVector};
use std::f64::consts::TAU;
use ukf::{Cholesky, Step, UkfError};

/// A Gaussian in N dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian<const N: usize> {
    /// Mean.
    pub mean: SVector<f64, N>,
    /// Covariance, symmetric.
    pub covariance: SMatrix<f64, N, N>,
}

/// p(s | s_prev, u): s = retract(predicted, t) with a Gaussian tangent t of mean zero.
pub trait MotionModel<const D: usize>: Sync {
    /// u.
    type Control;

    /// The predicted pose, and the covariance of the tangent there, positive definite.
    fn predict(&self, pose: &SVector<f64, D>, control: &Self::Control) -> Gaussian<D>;

    /// The pose reached from `pose` along `tangent`; wrap headings here.
    fn retract(&self, pose: &SVector<f64, D>, tangent: &SVector<f64, D>) -> SVector<f64, D> {
        pose + tangent
    }
}

/// z = h(s, landmark) + noise.
pub trait ObservationModel<const D: usize, const K: usize, const M: usize>: Sync {
    /// The measurement expected of a landmark at `landmark` from `pose`; `None` where there is none,
    /// such as behind a camera.
    fn predict(
        &self,
        pose: &SVector<f64, D>,
        landmark: &SVector<f64, K>,
    ) -> Option<SVector<f64, M>>;

    /// R, positive definite.
    fn noise(&self) -> SMatrix<f64, M, M>;

    /// z - z^; wrap bearings here.
    fn innovation(
        &self,
        measured: &SVector<f64, M>,
        predicted: &SVector<f64, M>,
    ) -> SVector<f64, M> {
        measured - predicted
    }
}

/// A particle that the generic proposals can move.
pub trait PoseAndMap<const D: usize, const K: usize>: Clone {
    /// The present pose.
    fn pose(&self) -> SVector<f64, D>;

    /// Takes the new pose, appending it to the path if there is one.
    fn set_pose(&mut self, pose: SVector<f64, D>);

    /// The landmark of this id in the particle's own map.
    fn landmark(&self, id: u32) -> Option<Gaussian<K>>;
}

/// What a frame brings: the control since the last one, and measurements of known landmarks.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame<C, const M: usize> {
    /// u.
    pub control: C,
    /// Landmark ids, each at most once, and what was measured of them.
    pub measurements: Vec<(u32, SVector<f64, M>)>,
}

/// log N(difference; 0, P), P given by its factor.
pub(crate) fn log_gaussian<const N: usize>(
    difference: &SVector<f64, N>,
    factor: &Cholesky<N>,
) -> f64 {
    let normaliser = factor.log_determinant() + N as f64 * TAU.ln();
    -0.5 * (factor.mahalanobis_squared(difference) + normaliser)
}

/// Cholesky of a covariance; an error names `what` it is the covariance of.
pub(crate) fn factorise<const N: usize>(
    covariance: &SMatrix<f64, N, N>,
    what: &'static str,
) -> Result<Cholesky<N>, RbpfError> {
    Cholesky::positive_definite(covariance, Step::Prediction)
        .map_err(|error| from_ukf(&error, what))
}

/// The error of this crate for one of the filter beneath.
pub(crate) const fn from_ukf(error: &UkfError, what: &'static str) -> RbpfError {
    match *error {
        UkfError::NotPositiveDefinite { pivot, value, .. } => {
            RbpfError::NotPositiveDefinite { what, pivot, value }
        }
        _ => RbpfError::NotFinite { what },
    }
}
