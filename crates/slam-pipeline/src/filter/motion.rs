//! The motion prior: the distribution of the camera pose that odometry implies for one particle.
//!
//! The body motion (dx, dy, dphi) in the previous body frame comes with a covariance from the velocity model (Eq. 25,
//! exact arc). The camera sits at l in the body, and lengths are in the particle's unit of s metres:
//! c_t = c_{t-1} + (R(phi) d + (R(phi + dphi) - R(phi)) l) / s.
//! Three constants of the carrier are Gaussian in the particle (see `metric`): the scale s, a bias b of the turn rate,
//! and the distance kappa from the body origin ahead to the point that does not slip. Wheels that turn about that point
//! move the origin by d - kappa (R(dphi) - I) e_x. With the gains G = d pose / d (s, b, kappa) and the joint covariance M of
//! the constants, the covariance of the prior is J Q J^T + G M G^T.
//! Roll and pitch revert to zero and the height follows the slope of the floor; odometry measures neither.

use estimation_base::Manifold;
use nalgebra::{Matrix3, SMatrix, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use crate::odometry::Control;

use super::pose::{CameraPose, PLANAR, POSE_DIM, PoseMatrix};

/// Where the motion of a particle starts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Departure {
    /// Pose at the last filter step.
    pub(crate) pose: CameraPose,
    /// The constants of the carrier: metres per unit of length of the particle, bias of the turn rate (rad/s), and
    /// distance from the body origin ahead to the point that does not slip (m).
    pub(crate) constants: Vector3<f64>,
    /// Their covariance.
    pub(crate) constants_covariance: Matrix3<f64>,
}

/// Number of constants of the carrier.
pub(crate) const CONSTANTS: usize = 3;

/// d pose / d (scale, turn-rate bias, turning centre).
pub(crate) type ConstantGains = SMatrix<f64, POSE_DIM, CONSTANTS>;

/// The freedoms of the carrier that odometry does not measure.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
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
    /// Standard deviation of the turn-rate bias at the start, rad/s.
    pub(crate) turn_bias_sigma: f64,
    /// Standard deviation of the turning centre at the start, metres.
    pub(crate) turning_centre_sigma_m: f64,
    /// Factors of the process noise that the innovations ask for.
    pub(crate) noise: NoiseFactors,
}

/// Factors of the standard deviation of the process noise, by body axis; one where the stated noise is right.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct NoiseFactors {
    /// Sideways.
    pub(crate) sideways: f64,
    /// Height.
    pub(crate) height: f64,
    /// Heading.
    pub(crate) heading: f64,
    /// Roll.
    pub(crate) roll: f64,
    /// Pitch.
    pub(crate) pitch: f64,
}

impl NoiseFactors {
    /// The stated noise.
    pub(crate) const NOMINAL: Self = Self {
        sideways: 1.0,
        height: 1.0,
        heading: 1.0,
        roll: 1.0,
        pitch: 1.0,
    };
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
    /// d pose / d (scale, turn-rate bias, turning centre).
    pub(crate) gains: ConstantGains,
    /// Variance added to the scale by its drift over the step.
    pub(crate) scale_drift_variance: f64,
    lever_m: Vector2<f64>,
    /// Share of roll and pitch that is left after the step.
    tilt_kept: f64,
}

impl MotionPrior {
    /// log N(pose; mean, A A^T) up to a constant.
    #[must_use]
    pub(crate) fn log_density(&self, pose: &CameraPose) -> f64 {
        self.factor
            .solve_lower_triangular(&self.mean.local(pose))
            .map_or(f64::NEG_INFINITY, |w| -0.5 * w.norm_squared())
    }

    /// Derivative of the mean with respect to the tangent of the pose `from` that the motion started from.
    #[must_use]
    pub(crate) fn by_departure(&self, from: &CameraPose) -> PoseMatrix {
        let mut derivative = PoseMatrix::identity();
        // The step turns with the heading.
        derivative[(0, 3)] = from.centre.y - self.mean.centre.y;
        derivative[(1, 3)] = self.mean.centre.x - from.centre.x;
        derivative[(4, 4)] = self.tilt_kept;
        derivative[(5, 5)] = self.tilt_kept;
        derivative
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
            pose: from,
            constants,
            constants_covariance,
        } = *departure;
        let [scale, turn_bias, centre_m] = constants.into();
        let d = Vector3::new(
            control.increment.x,
            control.increment.y,
            control.increment.phi,
        ) + control.turn_bias_gain * turn_bias;
        let (sin, cos) = from.phi.sin_cos();
        let turned = from.phi + d.z;
        // The camera as seen from the point that does not slip.
        let lever = lever_m - Vector2::new(centre_m, 0.0);
        let turn = |v: &Vector2<f64>| rotate(turned, v) - rotate(from.phi, v);
        let step = (rotate(from.phi, &d.xy()) + turn(&lever)) / scale;

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
        let lever_rate = rotate(turned, &Vector2::new(-lever.y, lever.x));
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
        let of_bias = jacobian * control.turn_bias_gain;
        let of_centre = -turn(&Vector2::x()) / scale;
        let mut gains = ConstantGains::zeros();
        for (i, gain) in [
            Vector3::new(-step.x, -step.y, 0.0) / scale,
            of_bias,
            Vector3::new(of_centre.x, of_centre.y, 0.0),
        ]
        .iter()
        .enumerate()
        {
            for (j, row) in PLANAR.into_iter().enumerate() {
                gains[(row, i)] = gain[j];
            }
        }

        let drift = self.scale_drift * scale;
        let scale_drift_variance = drift * drift * control.distance_m;
        let mut constants_covariance = constants_covariance;
        constants_covariance[(0, 0)] += scale_drift_variance;
        let factors =
            Matrix3::from_diagonal(&Vector3::new(1.0, self.noise.sideways, self.noise.heading));
        let noise = factors * control.covariance * factors;
        let planar = jacobian * noise * jacobian.transpose();
        let mut covariance = gains * constants_covariance * gains.transpose();
        for (i, gi) in PLANAR.into_iter().enumerate() {
            for (j, gj) in PLANAR.into_iter().enumerate() {
                covariance[(gi, gj)] += planar[(i, j)];
            }
        }
        let tilt_variance = self.tilt_sigma * self.tilt_sigma * (1.0 - keep * keep);
        let height_sigma = self.noise.height * self.slope_sigma * control.distance_m / scale;
        let floor = |used: f64, floor: f64| if used > 0.0 { floor } else { PINNED_FLOOR };
        let height_floor = floor(self.slope_sigma, POSITION_FLOOR_M);
        let tilt_floor = floor(self.tilt_sigma, ANGLE_FLOOR);
        let diagonal = [
            POSITION_FLOOR_M * POSITION_FLOOR_M,
            POSITION_FLOOR_M * POSITION_FLOOR_M,
            height_sigma * height_sigma + height_floor * height_floor,
            ANGLE_FLOOR * ANGLE_FLOOR,
            self.noise.roll.powi(2) * tilt_variance + tilt_floor * tilt_floor,
            self.noise.pitch.powi(2) * tilt_variance + tilt_floor * tilt_floor,
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
            gains,
            scale_drift_variance,
            lever_m: *lever_m,
            tilt_kept: keep,
        }
    }
}
