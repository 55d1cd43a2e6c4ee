//! The metric state of a particle: the part of it that is solved in closed form given the path.
//!
//! A camera measures no length: scaling the camera path and the map by one factor changes no pixel. Only odometry
//! measures the factor, and given the path its information about it is Gaussian. So the particle's path and map live
//! in a unit of their own, and the particle carries y = (s, p_x, p_y, b, kappa) ~ N(mean, covariance): the metres per unit,
//! the metric position of the body, and two constants of the carrier, the bias of its turn rate and the distance from
//! the body origin ahead to the point that does not slip, all conditional on the path. Sampling the path and solving y
//! in closed form is one more Rao-Blackwellisation; its cost does not depend on the size of the map, and every odometry
//! reading renews the constants. Methods without these freedoms start with a zero covariance, which keeps s = 1, b = 0 and
//! kappa = 0.

use estimation_base::Manifold;
use mono_geometry::Se2;
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::motion::{CONSTANTS, CarrierModel, MotionPrior};
use super::pose::{CameraPose, PoseStep};

/// Number of axes of the metric state.
const AXES: usize = 5;

/// Gaussian over the metric position of the body and the constants of the carrier, given the path.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct MetricState {
    /// Mean over the axes.
    pub(crate) mean: SVector<f64, AXES>,
    /// Covariance over the axes.
    pub(crate) covariance: SMatrix<f64, AXES, AXES>,
}

/// The scale, metres per unit, as it was known when the path came to a keyframe.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct ScaleNote {
    /// Mean.
    pub(crate) mean: f64,
    /// Variance.
    pub(crate) variance: f64,
    /// Variance of its drift since the keyframe before.
    pub(crate) drift: f64,
}

impl ScaleNote {
    /// The unit is the metre.
    pub(crate) const METRE: Self = Self {
        mean: 1.0,
        variance: 0.0,
        drift: 0.0,
    };
}

impl MetricState {
    /// Axis of the scale, metres per unit of the particle.
    pub(crate) const SCALE: usize = 0;
    /// Axis of the body's x, metres.
    pub(crate) const X: usize = 1;
    /// Axis of the body's y, metres.
    pub(crate) const Y: usize = 2;
    /// Axis of the bias of the turn rate, rad/s.
    pub(crate) const TURN_BIAS: usize = 3;
    /// Axis of the distance from the body origin ahead to the point that does not slip, metres.
    pub(crate) const TURNING_CENTRE: usize = 4;
    /// The axes of the constants, in the order of [`super::motion::ConstantGains`].
    const CONSTANTS: [usize; 3] = [Self::SCALE, Self::TURN_BIAS, Self::TURNING_CENTRE];

    /// At the origin, with the constants of `carrier` as uncertain as it says.
    #[must_use]
    pub(crate) fn new(carrier: &CarrierModel) -> Self {
        let mut mean = SVector::zeros();
        mean[Self::SCALE] = 1.0;
        let mut covariance = SMatrix::zeros();
        for (axis, sigma) in Self::CONSTANTS.into_iter().zip([
            carrier.scale_sigma,
            carrier.turn_bias_sigma,
            carrier.turning_centre_sigma_m,
        ]) {
            covariance[(axis, axis)] = sigma * sigma;
        }
        Self { mean, covariance }
    }

    /// The constants of the carrier: scale, turn-rate bias (rad/s), turning centre (m).
    #[must_use]
    pub(crate) fn constants(&self) -> Vector3<f64> {
        Vector3::from_fn(|i, _| self.mean[Self::CONSTANTS[i]])
    }

    /// Covariance of the constants.
    #[must_use]
    pub(crate) fn constants_covariance(&self) -> Matrix3<f64> {
        Matrix3::from_fn(|i, j| self.covariance[(Self::CONSTANTS[i], Self::CONSTANTS[j])])
    }

    /// The most likely number of metres per unit.
    #[must_use]
    pub(crate) fn scale(&self) -> f64 {
        self.mean[Self::SCALE]
    }

    /// The scale of a keyframe, after a drift of this variance since the one before.
    #[must_use]
    pub(crate) fn scale_note(&self, drift: f64) -> ScaleNote {
        ScaleNote {
            mean: self.scale(),
            variance: self.covariance[(Self::SCALE, Self::SCALE)],
            drift,
        }
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
    /// `prior` is the motion prior under which the pose was proposed. Its gains G = d pose / d (s, b, kappa) make the pose
    /// and the constants jointly Gaussian, so knowing the pose is a linear measurement of them. Then
    /// p += s dc - (R_t - R_{t-1}) l, with the lever arm of the body origin, wherever the wheels turn.
    #[must_use]
    pub(crate) fn condition_on_pose(&self, prior: &MotionPrior, pose: &CameraPose) -> Self {
        let mut mean = self.mean;
        let mut covariance = self.covariance;
        covariance[(Self::SCALE, Self::SCALE)] += prior.scale_drift_variance;
        if Self::CONSTANTS.iter().any(|c| covariance[(*c, *c)] > 0.0) {
            let innovation: PoseStep = prior.mean.local(pose);
            // Whitened by the factor of P = A A^T: one solve serves K and S.
            if let (Some(w_innovation), Some(w_gains)) = (
                prior.factor.solve_lower_triangular(&innovation),
                prior.factor.solve_lower_triangular(&prior.gains),
            ) {
                let cross = SMatrix::<f64, AXES, CONSTANTS>::from_fn(|i, j| {
                    covariance[(i, Self::CONSTANTS[j])]
                });
                let gain = cross * w_gains.transpose();
                mean += gain * w_innovation;
                covariance -= gain * gain.transpose();
            }
        }
        let step = Vector2::new(
            pose.centre.x - prior.from.centre.x,
            pose.centre.y - prior.from.centre.y,
        );
        let turn = prior.lever_displacement(pose.phi);
        let mut transition = SMatrix::<f64, AXES, AXES>::identity();
        transition[(Self::X, Self::SCALE)] = step.x;
        transition[(Self::Y, Self::SCALE)] = step.y;
        let mut mean = transition * mean;
        mean[Self::X] -= turn.x;
        mean[Self::Y] -= turn.y;
        let covariance = transition * covariance * transition.transpose();
        Self {
            mean,
            covariance: (covariance + covariance.transpose()) * 0.5,
        }
    }

    /// The state with the body at another mean position; what is known relative to it stays.
    pub(crate) fn move_to(&mut self, body: &Se2) {
        self.mean[Self::X] = body.x;
        self.mean[Self::Y] = body.y;
    }

    /// The state with the body at `body` by landmarks, whose positions in the unit are known: what is open of its position in
    /// metres is the scale alone, p = s c.
    pub(crate) fn place_by_landmarks(&mut self, body: &Se2) {
        self.move_to(body);
        let mut by_scale = SMatrix::<f64, AXES, AXES>::identity();
        for (axis, position) in [(Self::X, body.x), (Self::Y, body.y)] {
            by_scale[(axis, axis)] = 0.0;
            by_scale[(axis, Self::SCALE)] = position / self.scale();
        }
        self.covariance = by_scale * self.covariance * by_scale.transpose();
    }

    /// The state of a body whose unit is the metre of a known map, up to `sigma`.
    pub(crate) fn with_scale_of_map(mut self, sigma: f64) -> Self {
        self.mean[Self::SCALE] = 1.0;
        self.covariance.row_mut(Self::SCALE).fill(0.0);
        self.covariance.column_mut(Self::SCALE).fill(0.0);
        self.covariance[(Self::SCALE, Self::SCALE)] = sigma * sigma;
        self
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
