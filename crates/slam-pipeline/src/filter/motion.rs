//! The motion prior: the distribution of the camera pose that odometry implies for one particle.
//!
//! The body motion (dx, dy, dphi) in the previous body frame comes with a covariance from the velocity model (Eq. 25,
//! exact arc). The camera sits at l in the body, and lengths are in the particle's unit of s metres:
//! c_t = c_{t-1} + (R(phi) d + (R(phi + dphi) - R(phi)) l) / s.
//! The scale s is itself Gaussian in the particle, so the prior covariance is J Q J^T + g g^T Var(s), with g = dc/ds.
//! Roll and pitch revert to zero and the height follows the slope of the floor; odometry measures neither.

use estimation_base::Manifold;
use nalgebra::{Matrix3, Vector2};

use mono_geometry::Se2;

use crate::odometry::Control;

use super::pose::{CameraPose, PLANAR, PoseMatrix, PoseStep};

/// Where the motion of a particle starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Departure {
    /// Pose at the last filter step.
    pub(crate) pose: CameraPose,
    /// Metres per unit of length of the particle.
    pub(crate) scale: f64,
    /// Variance of the scale.
    pub(crate) scale_variance: f64,
}

/// The freedoms of the carrier that odometry does not measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CarrierModel {
    /// Standard deviation of roll and pitch, radians; zero for a strictly planar carrier.
    pub(crate) tilt_sigma: f64,
    /// Time after which roll and pitch are forgotten, seconds.
    pub(crate) tilt_time_s: f64,
    /// Height change per distance driven (standard deviation of the slope).
    pub(crate) slope_sigma: f64,
    /// Drift of the local scale, relative, per square root of a metre.
    pub(crate) scale_drift: f64,
    /// Standard deviation of the scale at the start, relative; zero switches
    /// the marginalised scale off.
    pub(crate) scale_sigma: f64,
}

/// Floors that keep the prior covariance positive definite: a tenth of a
/// millimetre and a tenth of a milliradian are far below what any wheel or
/// floor repeats.
const POSITION_FLOOR_M: f64 = 1e-4;
const ANGLE_FLOOR: f64 = 1e-4;
/// The same for states a strictly planar method pins to zero.
const PINNED_FLOOR: f64 = 1e-7;

/// Gaussian prior of the pose of one frame in one particle.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MotionPrior {
    /// Pose the motion started from.
    pub(crate) from: CameraPose,
    /// Mean.
    pub(crate) mean: CameraPose,
    /// Lower Cholesky factor of the covariance.
    pub(crate) factor: PoseMatrix,
    /// d pose / d s.
    pub(crate) scale_gain: PoseStep,
    /// Variance added to the scale by its drift over the step.
    pub(crate) scale_drift_variance: f64,
    lever_m: Vector2<f64>,
}

impl MotionPrior {
    /// log N(pose; mean, A A^T) up to a constant.
    #[must_use]
    pub(crate) fn log_density(&self, pose: &CameraPose) -> f64 {
        self.factor
            .solve_lower_triangular(&self.mean.local(pose))
            .map_or(f64::NEG_INFINITY, |w| -0.5 * w.norm_squared())
    }

    /// (R(phi) - R(phi_from)) l: how the camera moves when the body only turns, metres.
    #[must_use]
    pub(crate) fn lever_displacement(&self, phi: f64) -> Vector2<f64> {
        rotate(phi, &self.lever_m) - rotate(self.from.phi, &self.lever_m)
    }
}

fn rotate(phi: f64, v: &Vector2<f64>) -> Vector2<f64> {
    let (s, c) = phi.sin_cos();
    Vector2::new(c * v.x - s * v.y, s * v.x + c * v.y)
}

impl CarrierModel {
    /// The prior after `control`, for a camera at `lever_m` in the body.
    #[must_use]
    pub(crate) fn prior(
        &self,
        lever_m: &Vector2<f64>,
        departure: &Departure,
        control: &Control,
    ) -> MotionPrior {
        let Departure {
            pose: from, scale, ..
        } = *departure;
        let Se2 {
            x: dx,
            y: dy,
            phi: dphi,
        } = control.increment;
        let (sin, cos) = from.phi.sin_cos();
        let turned = from.phi + dphi;
        let lever_shift = rotate(turned, lever_m) - rotate(from.phi, lever_m);
        let metric_step = rotate(from.phi, &Vector2::new(dx, dy)) + lever_shift;
        let step = metric_step / scale;

        let keep = if self.tilt_time_s > 0.0 {
            (-control.dt_s / self.tilt_time_s).exp()
        } else {
            0.0
        };
        let mut mean = from;
        mean.centre.x += step.x;
        mean.centre.y += step.y;
        mean.phi = estimation_base::wrap(turned);
        mean.roll *= keep;
        mean.pitch *= keep;

        // d(c_x, c_y, phi) / d(dx, dy, dphi)
        let lever_rate = rotate(turned, &Vector2::new(-lever_m.y, lever_m.x));
        let jacobian = Matrix3::new(
            cos / scale,
            -sin / scale,
            lever_rate.x / scale,
            sin / scale,
            cos / scale,
            lever_rate.y / scale,
            0.0,
            0.0,
            1.0,
        );
        let planar = jacobian * control.covariance * jacobian.transpose();
        let mut scale_gain = PoseStep::zeros();
        scale_gain[0] = -step.x / scale;
        scale_gain[1] = -step.y / scale;
        let (scale_drift_variance, scale_variance) = if self.scale_sigma > 0.0 {
            let drift = self.scale_drift * self.scale_drift * control.distance_m * scale * scale;
            (drift, departure.scale_variance + drift)
        } else {
            (0.0, 0.0)
        };

        let mut covariance = scale_gain * scale_gain.transpose() * scale_variance;
        for (i, gi) in PLANAR.into_iter().enumerate() {
            for (j, gj) in PLANAR.into_iter().enumerate() {
                covariance[(gi, gj)] += planar[(i, j)];
            }
        }
        let tilt_variance = self.tilt_sigma * self.tilt_sigma * (1.0 - keep * keep);
        let height_sigma = self.slope_sigma * control.distance_m / scale;
        let floor = |used: f64, floor: f64| if used > 0.0 { floor } else { PINNED_FLOOR };
        let height_floor = floor(self.slope_sigma, POSITION_FLOOR_M);
        let tilt_floor = floor(self.tilt_sigma, ANGLE_FLOOR);
        let diagonal = [
            POSITION_FLOOR_M * POSITION_FLOOR_M,
            POSITION_FLOOR_M * POSITION_FLOOR_M,
            height_sigma * height_sigma + height_floor * height_floor,
            ANGLE_FLOOR * ANGLE_FLOOR,
            tilt_variance + tilt_floor * tilt_floor,
            tilt_variance + tilt_floor * tilt_floor,
        ];
        for (i, d) in diagonal.into_iter().enumerate() {
            covariance[(i, i)] += d;
        }
        let factor = covariance.cholesky().map_or_else(
            || PoseMatrix::from_diagonal(&covariance.diagonal().map(f64::sqrt)),
            |c| c.l(),
        );
        MotionPrior {
            from,
            mean,
            factor,
            scale_gain,
            scale_drift_variance,
            lever_m: *lever_m,
        }
    }
}
