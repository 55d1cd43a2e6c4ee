//! Odometry between two frames: a planar increment and its covariance.
//!
//! The paper's velocity model (Eq. 25) is x' = x + v dt cos(phi + w dt), y' = y + v dt sin(phi + w dt),
//! phi' = phi + w dt: a straight step in the direction of the *final* heading, which puts the displacement off by half
//! the turn, w dt / 2. [`exact_arc`] is the motion that constant (v, w) really makes, [`paper_euler`] the printed form.
//!
//! [`accumulate`] chains the samples that arrive between two frames. With independent noise n_k on the controls of
//! sample k the motion is the product of exp((u_k + n_k) dt_k), and to first order the covariance in the tangent at
//! the right of the mean follows the recursion
//!
//! > P <- Ad(step^-1) P Ad(step^-1)^T + J_r (dt^2 Q_k) J_r^T,
//!
//! with J_r the right Jacobian of SE(2) at u_k dt_k. The noise is white per *sample*: a standard deviation is that of one
//! row of the odometry, so the same ratio at twice the rate gives a path sqrt(2) surer.
//!
//! Degenerate: a robot at rest has no motion noise but the floors; without them its covariance is singular. The
//! mean leaves out the second-order shortening by sigma_w^2 / 2 of the path, below 1e-3 while the heading noise of an
//! increment is below 0.04 rad.

use estimation_base::{Se2, symmetric};
use nalgebra::{Matrix3, Vector3};

use crate::error::{GeometryError, checked};

/// Motion of constant forward speed (m/s) and turning rate (rad/s) held for `dt` seconds, in the starting body frame.
///
/// Exact for every turn, with no cancellation for a small one. O(1).
#[must_use]
pub fn exact_arc(v_mps: f64, omega_radps: f64, dt_s: f64) -> Se2 {
    Se2::exp(&Vector3::new(v_mps * dt_s, 0.0, omega_radps * dt_s))
}

/// The printed form of Eq. 25 as an increment: `pose.compose(&paper_euler(v, w, dt))` is the paper's next pose.
///
/// Kept to reproduce the paper. Its direction of travel is wrong by w dt / 2 to the side of the turn.
#[must_use]
pub fn paper_euler(v_mps: f64, omega_radps: f64, dt_s: f64) -> Se2 {
    let turn = omega_radps * dt_s;
    let (sine, cosine) = turn.sin_cos();
    Se2::new(v_mps * dt_s * cosine, v_mps * dt_s * sine, turn)
}

/// One row of odometry; it holds from its time to the next row's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometrySample {
    /// Time, seconds.
    pub t_s: f64,
    /// Forward speed, metres per second.
    pub v_mps: f64,
    /// Turning rate, positive to the left, radians per second.
    pub omega_radps: f64,
}

/// Standard deviations of the noise of one odometry sample; terms of one quantity add in squares.
///
/// All values finite and not negative; every one may be zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlNoise {
    /// Speed noise per |v|, without unit.
    pub v_ratio: f64,
    /// Speed noise at rest, m/s.
    pub v_floor_mps: f64,
    /// Sideways speed noise (slip) per |v|, without unit.
    pub lateral_ratio: f64,
    /// Sideways speed noise at rest, m/s.
    pub lateral_floor_mps: f64,
    /// Turning-rate noise per |omega|, without unit.
    pub omega_ratio: f64,
    /// Turning-rate noise per |v|, rad/m.
    pub omega_per_v: f64,
    /// Turning-rate noise at rest, rad/s.
    pub omega_floor_radps: f64,
    /// Added once per increment to both position axes, metres: keeps the covariance regular at rest.
    pub increment_floor_m: f64,
    /// Added once per increment to the heading, radians.
    pub increment_floor_rad: f64,
}

impl ControlNoise {
    /// No noise at all.
    pub const ZERO: Self = Self {
        v_ratio: 0.0,
        v_floor_mps: 0.0,
        lateral_ratio: 0.0,
        lateral_floor_mps: 0.0,
        omega_ratio: 0.0,
        omega_per_v: 0.0,
        omega_floor_radps: 0.0,
        increment_floor_m: 0.0,
        increment_floor_rad: 0.0,
    };

    /// Variances of (forward speed, sideways speed, turning rate) of one sample; (m/s)^2, (m/s)^2, (rad/s)^2.
    #[must_use]
    pub fn variances(&self, v_mps: f64, omega_radps: f64) -> Vector3<f64> {
        let square = |x: f64| x * x;
        Vector3::new(
            square(self.v_ratio * v_mps) + square(self.v_floor_mps),
            square(self.lateral_ratio * v_mps) + square(self.lateral_floor_mps),
            square(self.omega_ratio * omega_radps)
                + square(self.omega_per_v * v_mps)
                + square(self.omega_floor_radps),
        )
    }

    /// The error naming the first value that is negative or not finite.
    ///
    /// # Errors
    /// [`GeometryError::InvalidParameter`].
    pub fn check(&self) -> Result<(), GeometryError> {
        let named = [
            ("v_ratio", self.v_ratio),
            ("v_floor_mps", self.v_floor_mps),
            ("lateral_ratio", self.lateral_ratio),
            ("lateral_floor_mps", self.lateral_floor_mps),
            ("omega_ratio", self.omega_ratio),
            ("omega_per_v", self.omega_per_v),
            ("omega_floor_radps", self.omega_floor_radps),
            ("increment_floor_m", self.increment_floor_m),
            ("increment_floor_rad", self.increment_floor_rad),
        ];
        for (name, value) in named {
            checked(name, value, "finite and not negative", |v| v >= 0.0)?;
        }
        Ok(())
    }
}

/// A planar motion with its uncertainty: motion = mean * exp(delta), delta ~ N(0, covariance).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Increment {
    /// End pose in the frame of the start pose.
    pub mean: Se2,
    /// Covariance of (dx, dy, dphi) in the body axes of the end pose; m^2, m rad, rad^2.
    pub covariance: Matrix3<f64>,
}

impl Increment {
    /// This motion followed by an independent other one. O(1).
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        let adjoint = next.mean.inverse().adjoint();
        Self {
            mean: self.mean.compose(&next.mean),
            covariance: symmetric(
                &(adjoint * self.covariance * adjoint.transpose() + next.covariance),
            ),
        }
    }
}

/// Chains samples, each held for its duration in seconds, into one increment. O(samples).
///
/// No samples: the identity with the floors as its covariance.
///
/// # Errors
/// [`GeometryError::InvalidParameter`] for a speed or rate that is not finite, a duration that is negative or not
/// finite, noise outside its range, or numbers so large that the result overflows.
pub fn accumulate(
    samples_with_durations: &[(OdometrySample, f64)],
    noise: &ControlNoise,
) -> Result<Increment, GeometryError> {
    noise.check()?;
    let mut total = Increment {
        mean: Se2::identity(),
        covariance: Matrix3::zeros(),
    };
    for (sample, duration_s) in samples_with_durations {
        let v = checked("odometry v (m/s)", sample.v_mps, "finite", |_| true)?;
        let omega = checked(
            "odometry omega (rad/s)",
            sample.omega_radps,
            "finite",
            |_| true,
        )?;
        let dt = checked(
            "odometry duration (s)",
            *duration_s,
            "finite and not negative",
            |d| d >= 0.0,
        )?;
        let twist = Vector3::new(v * dt, 0.0, omega * dt);
        let jacobian = Se2::right_jacobian(&twist) * dt;
        let controls = Matrix3::from_diagonal(&noise.variances(v, omega));
        total = total.then(&Increment {
            mean: Se2::exp(&twist),
            covariance: jacobian * controls * jacobian.transpose(),
        });
    }
    let position = noise.increment_floor_m * noise.increment_floor_m;
    let heading = noise.increment_floor_rad * noise.increment_floor_rad;
    total.covariance += Matrix3::from_diagonal(&Vector3::new(position, position, heading));
    // Finite controls can still overflow: an infinity times zero is the NaN that would poison a filter.
    let required = "finite: speeds, rates or noise are too large";
    for value in [total.mean.x, total.mean.y, total.mean.phi] {
        checked("odometry increment (m, rad)", value, required, |_| true)?;
    }
    for value in total.covariance.iter() {
        checked("odometry covariance (m^2, rad^2)", *value, required, |_| {
            true
        })?;
    }
    Ok(total)
}

/// The samples in force between two times, each with the duration it holds there (seconds).
///
/// `samples` ascend in time; each holds until the next, the last one without end. Before the first sample nothing is
/// known and nothing is returned. Empty if `end_s <= start_s`. O(log n + result).
#[must_use]
pub fn held_between(
    samples: &[OdometrySample],
    start_s: f64,
    end_s: f64,
) -> Vec<(OdometrySample, f64)> {
    let first = samples
        .partition_point(|sample| sample.t_s <= start_s)
        .saturating_sub(1);
    let mut held = Vec::new();
    for (index, sample) in samples.iter().enumerate().skip(first) {
        if sample.t_s >= end_s {
            break;
        }
        let until = samples
            .get(index + 1)
            .map_or(end_s, |next| next.t_s.min(end_s));
        let duration = until - sample.t_s.max(start_s);
        if duration > 0.0 {
            held.push((*sample, duration));
        }
    }
    held
}
