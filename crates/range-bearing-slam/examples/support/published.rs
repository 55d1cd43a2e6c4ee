//! The proposal of `FastSLAM` 2.0 with its published weights (Montemerlo, Thrun, Koller, Wegbreit 2003).

use nalgebra::{Matrix3, Vector2, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use range_bearing_slam::{
    Frame, LandmarkParticle, MotionModel, ObservationJacobians, ObservationModel, RangeBearing,
    RangeBearingError,
};
use rbpf_core::Proposal;
use std::f64::consts::TAU;

/// The landmarks of a frame update the predicted pose one after the other, each linearised at the mean
/// that the ones before left; the pose is drawn, and the weight is the product of the N(z; z^, S) met on the way.
/// [`range_bearing_slam::ExtendedProposal`] draws the same poses and weighs them exactly.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PublishedProposal<A> {
    /// The motion p(s | s_prev, u).
    pub(crate) motion: A,
    /// The measurement p(z | s, landmark).
    pub(crate) sensor: RangeBearing,
}

impl<A: MotionModel<3>> Proposal<LandmarkParticle<3, 2>, Frame<A::Control, 2>>
    for PublishedProposal<A>
{
    type Error = RangeBearingError;

    fn propose(
        &self,
        particle: &mut LandmarkParticle<3, 2>,
        frame: &Frame<A::Control, 2>,
        rng: &mut ChaCha8Rng,
    ) -> Result<f64, RangeBearingError> {
        const BROKEN: RangeBearingError = RangeBearingError::NotFinite {
            what: "pose or landmark",
        };
        let predicted = self.motion.predict(&particle.pose, &frame.control);
        let (mut mean, mut covariance) = (predicted.mean, predicted.covariance);
        let mut weight = 0.0;
        for (id, measured) in &frame.measurements {
            let Some(landmark) = particle.map.get(*id) else {
                continue;
            };
            let position = &landmark.position;
            let expected: Vector2<f64> =
                self.sensor.predict(&mean, &position.mean).ok_or(BROKEN)?;
            let (h, g) = self.sensor.jacobians(&mean, &position.mean).ok_or(BROKEN)?;
            let noise = g * position.covariance * g.transpose() + self.sensor.noise();
            let s = h * covariance * h.transpose() + noise;
            let factor = ((s + s.transpose()) * 0.5).cholesky().ok_or(BROKEN)?;
            let difference = self.sensor.innovation(measured, &expected);
            let log_root: f64 = factor.l().diagonal().iter().map(|entry| entry.ln()).sum();
            weight -= 0.5 * difference.dot(&factor.solve(&difference)) + log_root + TAU.ln();
            let gain = factor.solve(&(h * covariance)).transpose();
            mean = self.motion.retract(&mean, &(gain * difference));
            let rest = Matrix3::identity() - gain * h;
            let joseph = rest * covariance * rest.transpose() + gain * noise * gain.transpose();
            covariance = (joseph + joseph.transpose()) * 0.5;
        }
        let root = covariance.cholesky().ok_or(BROKEN)?.l();
        let draw = Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        particle.set_pose(self.motion.retract(&mean, &(root * draw)));
        Ok(weight)
    }
}
