//! Odometry between two frames: a planar increment and its covariance.
//!
//! The paper's velocity model (Eq. 25) is x' = x + v dt cos(phi + w dt), y' = y + v dt sin(phi + w dt),
//! phi' = phi + w dt: a straight step in the direction of the *final* heading, which puts the displacement off by half
//! the turn, w dt / 2. [`exact_arc`] is the motion that constant (v, w) really makes, [`paper_euler`] the printed form.
//!
//! [`differential_drive`] and [`steered_turn_rate`] turn what wheels and steering say into such controls.
//!
//! [`accumulate`] chains the samples that arrive between two frames. With independent noise n_k on the controls of
//! sample k the motion is the product of exp((u_k + n_k) dt_k), and to first order the covariance in the tangent at
//! the right of the mean follows the recursion
//!
//! > P <- Ad(step^-1) P Ad(step^-1)^T + J_r Q_k J_r^T,
//!
//! with J_r the right Jacobian of SE(2) at u_k dt_k. The noise is a white process in time and in distance: variances grow
//! with the seconds and the metres of a sample, so the covariance of a path does not depend on how many samples report it:
//! rows at 10 or at 200 Hz give the same but for the higher orders of one row's turn.
//! The same recursion without the noise carries the effect of a constant error of the turning rate along
//! ([`Increment::turn_bias_gain`]).
//!
//! Degenerate: a robot at rest has no motion noise but that of time, and sideways none at all: the covariance is
//! singular. The mean leaves out the second-order shortening by sigma_w^2 / 2 of the path, below 1e-3 while the heading noise of an
//! increment is below 0.04 rad.

use estimation_base::{Se2, symmetric};
use nalgebra::{Matrix3, Vector3};

use crate::error::{GeometryError, checked};

mod wheels;

pub use wheels::{Travel, differential_drive, steered_turn_rate};

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

/// Noise of wheel odometry as a white process: standard deviations after one second, metre or radian.
///
/// They grow with the square root of time, distance and turn; terms of one quantity add in squares. All values are finite
/// and not negative; every one may be zero.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ControlNoise {
    /// Forward, per square root of the distance driven: m / sqrt(m).
    pub forward_per_sqrt_m: f64,
    /// Forward, per square root of the time: m / sqrt(s).
    pub forward_per_sqrt_s: f64,
    /// Sideways (slip), per square root of the distance driven: m / sqrt(m).
    pub sideways_per_sqrt_m: f64,
    /// Heading, per square root of the angle turned: rad / sqrt(rad).
    pub turn_per_sqrt_rad: f64,
    /// Heading, per square root of the distance driven: rad / sqrt(m).
    pub turn_per_sqrt_m: f64,
    /// Heading, per square root of the time: rad / sqrt(s).
    pub turn_per_sqrt_s: f64,
}

impl ControlNoise {
    /// No noise at all.
    pub const ZERO: Self = Self {
        forward_per_sqrt_m: 0.0,
        forward_per_sqrt_s: 0.0,
        sideways_per_sqrt_m: 0.0,
        turn_per_sqrt_rad: 0.0,
        turn_per_sqrt_m: 0.0,
        turn_per_sqrt_s: 0.0,
    };

    /// Variances of (forward, sideways, turn) of a sample held for `dt_s` seconds; m^2, m^2, rad^2.
    #[must_use]
    pub fn variances(&self, v_mps: f64, omega_radps: f64, dt_s: f64) -> Vector3<f64> {
        let square = |x: f64| x * x;
        let distance_m = (v_mps * dt_s).abs();
        let turn_rad = (omega_radps * dt_s).abs();
        Vector3::new(
            square(self.forward_per_sqrt_m) * distance_m + square(self.forward_per_sqrt_s) * dt_s,
            square(self.sideways_per_sqrt_m) * distance_m,
            square(self.turn_per_sqrt_rad) * turn_rad
                + square(self.turn_per_sqrt_m) * distance_m
                + square(self.turn_per_sqrt_s) * dt_s,
        )
    }

    /// The error naming the first value that is negative or not finite.
    ///
    /// # Errors
    /// [`GeometryError::InvalidParameter`].
    pub fn check(&self) -> Result<(), GeometryError> {
        let named = [
            ("forward_per_sqrt_m", self.forward_per_sqrt_m),
            ("forward_per_sqrt_s", self.forward_per_sqrt_s),
            ("sideways_per_sqrt_m", self.sideways_per_sqrt_m),
            ("turn_per_sqrt_rad", self.turn_per_sqrt_rad),
            ("turn_per_sqrt_m", self.turn_per_sqrt_m),
            ("turn_per_sqrt_s", self.turn_per_sqrt_s),
        ];
        for (name, value) in named {
            checked(name, value, "finite and not negative", |v| v >= 0.0)?;
        }
        Ok(())
    }
}

/// A planar motion with its uncertainty: motion = mean * exp(delta), delta ~ N(0, covariance).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Increment {
    /// End pose in the frame of the start pose.
    pub mean: Se2,
    /// Covariance of (dx, dy, dphi) in the body axes of the end pose; m^2, m rad, rad^2.
    pub covariance: Matrix3<f64>,
    /// Derivative of (dx, dy, dphi), body axes of the end pose, with respect to a constant addition to the turning rate:
    /// m s / rad, m s / rad, s.
    pub turn_bias_gain: Vector3<f64>,
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
            turn_bias_gain: adjoint * self.turn_bias_gain + next.turn_bias_gain,
        }
    }
}

/// Chains samples, each held for its duration in seconds, into one increment. O(samples).
///
/// No samples: the identity without noise.
///
/// # Errors
/// [`GeometryError::InvalidParameter`] for a speed or rate that is not finite, a duration that is negative or not
/// finite, noise outside its range, or numbers so large that the result overflows.
///
/// ```
/// use mono_geometry::motion::{ControlNoise, OdometrySample, accumulate};
///
/// // Ten centimetres straight on, then a quarter turn to the left on a circle of half a metre.
/// let turn = std::f64::consts::FRAC_PI_2;
/// let samples = [
///     (OdometrySample { t_s: 0.0, v_mps: 0.1, omega_radps: 0.0 }, 1.0),
///     (OdometrySample { t_s: 1.0, v_mps: 0.5 * turn, omega_radps: turn }, 1.0),
/// ];
/// let noise = ControlNoise { forward_per_sqrt_m: 0.02, turn_per_sqrt_rad: 0.03, ..ControlNoise::ZERO };
/// let motion = accumulate(&samples, &noise)?;
/// assert!((motion.mean.x - 0.6).abs() < 1e-12 && (motion.mean.y - 0.5).abs() < 1e-12);
/// assert!((motion.covariance[(2, 2)].sqrt() - 0.03 * turn.sqrt()).abs() < 1e-12);
/// # Ok::<(), mono_geometry::GeometryError>(())
/// ```
pub fn accumulate(
    samples_with_durations: &[(OdometrySample, f64)],
    noise: &ControlNoise,
) -> Result<Increment, GeometryError> {
    noise.check()?;
    let mut total = Increment {
        mean: Se2::identity(),
        covariance: Matrix3::zeros(),
        turn_bias_gain: Vector3::zeros(),
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
        let jacobian = Se2::right_jacobian(&twist);
        let controls = Matrix3::from_diagonal(&noise.variances(v, omega, dt));
        total = total.then(&Increment {
            mean: Se2::exp(&twist),
            covariance: jacobian * controls * jacobian.transpose(),
            turn_bias_gain: jacobian * Vector3::new(0.0, 0.0, dt),
        });
    }
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
