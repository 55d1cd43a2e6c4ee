//! The metric state of a particle: the part of it that is solved in closed form given the path.
//!
//! A camera measures no length: scaling the camera path and the map by one factor changes no pixel. Only odometry
//! measures the factor, and given the path its information about it is Gaussian. So the particle's path and map live
//! in a unit of their own, and the particle carries y = (s, p_x, p_y) ~ N(mean, covariance): the metres per unit and
//! the metric position of the body, conditional on the path. Sampling the path and solving y in closed form is one
//! more Rao-Blackwellisation; its cost does not depend on the size of the map, and every odometry reading renews the
//! scale. Methods without an open scale start with a zero covariance, which keeps s = 1.

use estimation_base::Manifold;
use mono_geometry::Se2;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::motion::MotionPrior;
use super::pose::{CameraPose, PoseStep};

/// Gaussian over the metric scale and the metric position of the body, given the path.
///
/// The axes are [`MetricState::SCALE`] (metres per unit), [`MetricState::X`] and [`MetricState::Y`] (metres).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct MetricState {
    /// Mean over (scale, x, y).
    pub(crate) mean: Vector3<f64>,
    /// Covariance over (scale, x, y).
    pub(crate) covariance: Matrix3<f64>,
}

impl MetricState {
    /// Axis of the scale, metres per unit of the particle.
    pub(crate) const SCALE: usize = 0;
    /// Axis of the body's x, metres.
    pub(crate) const X: usize = 1;
    /// Axis of the body's y, metres.
    pub(crate) const Y: usize = 2;

    /// One metre per unit with standard deviation `scale_sigma`, at the origin.
    #[must_use]
    pub(crate) fn new(scale_sigma: f64) -> Self {
        let mut covariance = Matrix3::zeros();
        covariance[(Self::SCALE, Self::SCALE)] = scale_sigma * scale_sigma;
        Self {
            mean: Vector3::new(1.0, 0.0, 0.0),
            covariance,
        }
    }

    /// The most likely number of metres per unit.
    #[must_use]
    pub(crate) fn scale(&self) -> f64 {
        self.mean[Self::SCALE]
    }

    /// Variance of the scale.
    #[must_use]
    pub(crate) fn scale_variance(&self) -> f64 {
        self.covariance[(Self::SCALE, Self::SCALE)]
    }

    /// Mean position of the body, metres.
    #[must_use]
    pub(crate) fn position(&self) -> Vector2<f64> {
        Vector2::new(self.mean[Self::X], self.mean[Self::Y])
    }

    /// Covariance of the position of the body, square metres.
    #[must_use]
    pub(crate) fn position_covariance(&self) -> Matrix2<f64> {
        self.covariance.fixed_view::<2, 2>(Self::X, Self::X).into()
    }

    /// The state after the pose of the frame is known.
    ///
    /// `prior` is the motion prior under which the pose was proposed. Its gain g = d pose / d s makes (pose, s) jointly
    /// Gaussian, so knowing the pose is a linear measurement of s. Then p += s dc - (R_t - R_{t-1}) l.
    #[must_use]
    pub(crate) fn condition_on_pose(&self, prior: &MotionPrior, pose: &CameraPose) -> Self {
        let mut mean = self.mean;
        let mut covariance = self.covariance;
        covariance[(Self::SCALE, Self::SCALE)] += prior.scale_drift_variance;
        if covariance[(Self::SCALE, Self::SCALE)] > 0.0 {
            let innovation: PoseStep = prior.mean.local(pose);
            // Whitened by the factor of P = A A^T: one solve serves K and S.
            if let (Some(w_innovation), Some(w_gain)) = (
                prior.factor.solve_lower_triangular(&innovation),
                prior.factor.solve_lower_triangular(&prior.scale_gain),
            ) {
                let cross = covariance.column(Self::SCALE).into_owned();
                let gain = cross * w_gain.dot(&w_innovation);
                mean += gain;
                covariance -= cross * cross.transpose() * w_gain.norm_squared();
            }
        }
        let step = Vector2::new(
            pose.centre.x - prior.from.centre.x,
            pose.centre.y - prior.from.centre.y,
        );
        let turn = prior.lever_displacement(pose.phi);
        let transition = Matrix3::new(1.0, 0.0, 0.0, step.x, 1.0, 0.0, step.y, 0.0, 1.0);
        let mut mean = transition * mean;
        mean[Self::X] -= turn.x;
        mean[Self::Y] -= turn.y;
        let covariance = transition * covariance * transition.transpose();
        Self {
            mean,
            covariance: (covariance + covariance.transpose()) * 0.5,
        }
    }

    /// The metric body pose with heading `phi`.
    #[must_use]
    pub(crate) fn body(&self, phi: f64) -> Se2 {
        Se2 {
            x: self.mean[Self::X],
            y: self.mean[Self::Y],
            phi,
        }
    }
}
