//! What the generic proposals need to know of a robot and its sensor.
//!
//! D is the dimension of the pose, K of a landmark, M of a measurement. Poses are vectors whose
//! headings are plain entries: [`MotionModel::retract`] wraps them.

use crate::error::RbpfError;
use nalgebra::{SMatrix, SVector};

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

/// Derivatives of a measurement, for everything extended.
pub trait ObservationJacobians<const D: usize, const K: usize, const M: usize>:
    ObservationModel<D, K, M>
{
    /// d z / d tangent of the pose (M x D; the tangent of [`MotionModel::retract`] at `pose`) and
    /// d z / d landmark (M x K); `None` where there is no prediction.
    fn jacobians(
        &self,
        pose: &SVector<f64, D>,
        landmark: &SVector<f64, K>,
    ) -> Option<(SMatrix<f64, M, D>, SMatrix<f64, M, K>)>;
}

/// Where one measurement puts a landmark.
pub trait InverseObservation<const D: usize, const K: usize, const M: usize>:
    ObservationModel<D, K, M>
{
    /// The landmark seen as `measurement` from `pose`; `None` if one measurement does not tell.
    fn locate(
        &self,
        pose: &SVector<f64, D>,
        measurement: &SVector<f64, M>,
    ) -> Option<SVector<f64, K>>;

    /// d landmark / d z, K x M.
    fn locate_jacobian(
        &self,
        pose: &SVector<f64, D>,
        measurement: &SVector<f64, M>,
    ) -> Option<SMatrix<f64, K, M>>;
}

/// Which landmarks a sensor can see, for unknown association.
pub trait FieldOfView<const D: usize, const K: usize>: Sync {
    /// Whether a measurement from about `pose` may be of `landmark`; generous, to save the
    /// comparison with all others.
    fn reaches(&self, pose: &SVector<f64, D>, landmark: &SVector<f64, K>) -> bool;

    /// Whether `landmark` is so well in view that not seeing it is evidence against it.
    fn expects(&self, pose: &SVector<f64, D>, landmark: &SVector<f64, K>) -> bool;
}

/// A particle that the generic proposals can move.
pub trait PoseAndMap<const D: usize, const K: usize>: Clone {
    /// The present pose.
    fn pose(&self) -> SVector<f64, D>;

    /// Takes the new pose. Proposals and moves may call it more than once in a frame: a path takes its
    /// pose in the map update.
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

impl<C, const M: usize> Frame<C, M> {
    /// Refuses what would be counted twice or not at all. O(n), O(n log n) for ids out of order.
    ///
    /// # Errors
    /// [`RbpfError::DuplicateId`], [`RbpfError::MeasurementNotFinite`].
    pub fn check(&self) -> Result<(), RbpfError> {
        if !self.measurements.is_sorted_by_key(|(id, _)| *id)
            || self
                .measurements
                .windows(2)
                .any(|pair| pair[0].0 == pair[1].0)
        {
            let mut ids: Vec<u32> = self.measurements.iter().map(|(id, _)| *id).collect();
            ids.sort_unstable();
            if let Some(pair) = ids.windows(2).find(|pair| pair[0] == pair[1]) {
                let times = ids.iter().filter(|id| **id == pair[0]).count();
                return Err(RbpfError::DuplicateId { id: pair[0], times });
            }
        }
        self.measurements
            .iter()
            .try_for_each(|(id, measured)| check_measurement(*id, measured))
    }
}

/// `id` names the measurement in the error.
pub(crate) fn check_measurement<const M: usize>(
    id: u32,
    measured: &SVector<f64, M>,
) -> Result<(), RbpfError> {
    match measured.iter().enumerate().find(|(_, z)| !z.is_finite()) {
        Some((entry, &value)) => Err(RbpfError::MeasurementNotFinite { id, entry, value }),
        None => Ok(()),
    }
}
