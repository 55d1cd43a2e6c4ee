//! The models of a robot and its sensor: the traits that proposals and landmark filters ask for.
//!
//! D is the dimension of a pose, K of a landmark, M of a measurement. Poses are vectors whose headings
//! are plain entries; [`MotionModel::retract`] and [`MotionModel::local`] wrap them.

use nalgebra::{SMatrix, SVector};

/// A Gaussian in N dimensions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian<const N: usize> {
    /// Mean.
    pub mean: SVector<f64, N>,
    /// Covariance, symmetric.
    pub covariance: SMatrix<f64, N, N>,
}

/// The motion p(s | s_prev, u) of a robot: s = retract(predicted, t) with a Gaussian tangent t of mean
/// zero.
pub trait MotionModel<const D: usize>: Sync {
    /// The control u of one frame.
    type Control;

    /// The predicted pose, and the covariance of the tangent there, positive definite.
    fn predict(&self, pose: &SVector<f64, D>, control: &Self::Control) -> Gaussian<D>;

    /// The pose reached from `pose` along `tangent`, with headings wrapped.
    fn retract(&self, pose: &SVector<f64, D>, tangent: &SVector<f64, D>) -> SVector<f64, D> {
        pose + tangent
    }

    /// The tangent with `retract(from, tangent) == to`, the shortest where there are several. A model
    /// that overrides [`Self::retract`] overrides this too.
    fn local(&self, from: &SVector<f64, D>, to: &SVector<f64, D>) -> SVector<f64, D> {
        to - from
    }
}

/// The measurement z = h(s, landmark) + noise of a sensor.
pub trait ObservationModel<const D: usize, const K: usize, const M: usize>: Sync {
    /// The measurement expected of a landmark at `landmark` from `pose`; `None` where the sensor has
    /// none, such as behind a camera.
    fn predict(
        &self,
        pose: &SVector<f64, D>,
        landmark: &SVector<f64, K>,
    ) -> Option<SVector<f64, M>>;

    /// The covariance R of the noise, positive definite.
    fn noise(&self) -> SMatrix<f64, M, M>;

    /// The innovation z - z^, with bearings wrapped.
    fn innovation(
        &self,
        measured: &SVector<f64, M>,
        predicted: &SVector<f64, M>,
    ) -> SVector<f64, M> {
        measured - predicted
    }
}

/// The derivatives of a measurement, for [`crate::ExtendedProposal`] and [`crate::ExtendedLandmarks`].
pub trait ObservationJacobians<const D: usize, const K: usize, const M: usize>:
    ObservationModel<D, K, M>
{
    /// The derivatives of z by the tangent of [`MotionModel::retract`] at `pose` (M x D) and by the
    /// landmark (M x K); `None` where there is no prediction.
    fn jacobians(
        &self,
        pose: &SVector<f64, D>,
        landmark: &SVector<f64, K>,
    ) -> Option<(SMatrix<f64, M, D>, SMatrix<f64, M, K>)>;
}

/// The inverse of a measurement, which starts a landmark.
pub trait InverseObservation<const D: usize, const K: usize, const M: usize>:
    ObservationModel<D, K, M>
{
    /// The position of a landmark seen as `measurement` from `pose`; `None` if one measurement does not
    /// determine it.
    fn locate(
        &self,
        pose: &SVector<f64, D>,
        measurement: &SVector<f64, M>,
    ) -> Option<SVector<f64, K>>;

    /// The derivative of the position by z (K x M); `None` as for [`Self::locate`].
    fn locate_jacobian(
        &self,
        pose: &SVector<f64, D>,
        measurement: &SVector<f64, M>,
    ) -> Option<SMatrix<f64, K, M>>;
}

/// The landmarks that a sensor can see, for unknown association.
pub trait FieldOfView<const D: usize, const K: usize>: Sync {
    /// Whether a measurement from about `pose` may be of `landmark`. A generous answer is right; it
    /// saves the comparison with all other landmarks.
    fn reaches(&self, pose: &SVector<f64, D>, landmark: &SVector<f64, K>) -> bool;

    /// Whether `landmark` is so well in view that a missing measurement is evidence against it.
    fn expects(&self, pose: &SVector<f64, D>, landmark: &SVector<f64, K>) -> bool;
}
