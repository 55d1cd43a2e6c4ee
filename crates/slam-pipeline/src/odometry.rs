//! Odometry between filter steps: rows of (duration, v, omega) folded into one
//! body motion with its covariance.

use mono_geometry::motion::{ControlNoise, Increment, OdometrySample, accumulate, paper_euler};
use mono_geometry::{GeometryError, Se2};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::config::OdometrySection;
use crate::method::MotionStep;

/// One odometry row clipped to an interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OdometryInterval {
    /// Seconds it holds.
    pub duration_s: f64,
    /// Forward velocity, m/s.
    pub v_mps: f64,
    /// Turn rate, rad/s.
    pub omega_radps: f64,
}

/// Odometry between two filter steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Control {
    /// Body motion in the previous body frame, metres and radians.
    pub increment: Se2,
    /// Covariance of (dx, dy, dphi).
    pub covariance: Matrix3<f64>,
    /// Derivative of (dx, dy, dphi) with respect to a constant addition to the turn rate: m s / rad, m s / rad, s.
    pub turn_bias_gain: Vector3<f64>,
    /// Seconds between the steps.
    pub dt_s: f64,
    /// Metres driven between the steps.
    pub distance_m: f64,
}

/// Standard deviations of a motion whose odometry is in doubt, as shares of the distance and of the turn, and radians.
const DOUBTED_FORWARD_SHARE: f64 = 0.5;
const DOUBTED_SIDEWAYS_SHARE: f64 = 0.1;
const DOUBTED_TURN_SHARE: f64 = 0.25;
const DOUBTED_TURN_RAD: f64 = 0.02;

impl Control {
    /// The same motion, known only as well as that of wheels that may slip.
    #[must_use]
    pub(crate) fn doubted(&self) -> Self {
        let turn = DOUBTED_TURN_RAD + DOUBTED_TURN_SHARE * self.increment.phi.abs();
        let slip = Matrix3::from_diagonal(&Vector3::new(
            (DOUBTED_FORWARD_SHARE * self.distance_m).powi(2),
            (DOUBTED_SIDEWAYS_SHARE * self.distance_m).powi(2),
            turn * turn,
        ));
        Self {
            covariance: self.covariance + slip,
            ..*self
        }
    }
}

/// Accumulates intervals since the last filter step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Odometer {
    noise: ControlNoise,
    step: MotionStep,
    increment: Increment,
    dt_s: f64,
    distance_m: f64,
}

/// Speeds that no robot has, m/s and rad/s: numbers beyond them are errors of units or of memory.
const FASTEST: f64 = 1000.0;
/// A longest interval, seconds: thirty thousand years; clocks that jump do so by decades.
const LONGEST_S: f64 = 1e12;

const REST: Increment = Increment {
    mean: Se2 {
        x: 0.0,
        y: 0.0,
        phi: 0.0,
    },
    covariance: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    turn_bias_gain: Vector3::new(0.0, 0.0, 0.0),
};

fn within(
    name: &'static str,
    value: f64,
    largest: f64,
    required: &'static str,
) -> Result<(), GeometryError> {
    if value.abs() <= largest {
        return Ok(());
    }
    Err(GeometryError::InvalidParameter {
        name,
        value,
        required,
    })
}

impl Odometer {
    /// An odometer at rest that moves by exact arcs.
    #[must_use]
    pub fn new(noise: &OdometrySection) -> Self {
        Self::with_step(noise, MotionStep::ExactArc)
    }

    /// An odometer at rest that moves by `step`.
    #[must_use]
    pub(crate) fn with_step(noise: &OdometrySection, step: MotionStep) -> Self {
        Self {
            step,
            noise: ControlNoise {
                forward_per_sqrt_m: noise.forward_per_sqrt_m,
                forward_per_sqrt_s: noise.forward_per_sqrt_s,
                sideways_per_sqrt_m: noise.sideways_per_sqrt_m,
                turn_per_sqrt_rad: noise.turn_per_sqrt_rad,
                turn_per_sqrt_m: noise.turn_per_sqrt_m,
                turn_per_sqrt_s: noise.turn_per_sqrt_s,
            },
            increment: REST,
            dt_s: 0.0,
            distance_m: 0.0,
        }
    }

    /// Forgets what was accumulated.
    pub fn reset(&mut self) {
        self.increment = REST;
        self.dt_s = 0.0;
        self.distance_m = 0.0;
    }

    /// Adds an interval, its noise independent of that of the others.
    ///
    /// # Errors
    /// [`GeometryError`] for numbers that are not finite or that no robot drives: beyond 1000 m/s, 1000 rad/s and 10^12 s.
    pub fn push(&mut self, interval: &OdometryInterval) -> Result<(), GeometryError> {
        within("odometry v (m/s)", interval.v_mps, FASTEST, "-1000 to 1000")?;
        within(
            "odometry omega (rad/s)",
            interval.omega_radps,
            FASTEST,
            "-1000 to 1000",
        )?;
        within(
            "odometry duration (s)",
            interval.duration_s,
            LONGEST_S,
            "0 to 1e12",
        )?;
        let sample = OdometrySample {
            t_s: self.dt_s,
            v_mps: interval.v_mps,
            omega_radps: interval.omega_radps,
        };
        let mut next = accumulate(&[(sample, interval.duration_s)], &self.noise)?;
        if self.step == MotionStep::PrintedEuler {
            next.mean = paper_euler(interval.v_mps, interval.omega_radps, interval.duration_s);
        }
        self.increment = self.increment.then(&next);
        self.dt_s += interval.duration_s;
        self.distance_m += (interval.v_mps * interval.duration_s).abs();
        Ok(())
    }

    /// The accumulated motion; its covariance is turned from the body axes of the
    /// end to those of the start, where (dx, dy, dphi) is additive.
    #[must_use]
    pub fn control(&self) -> Control {
        let mean = self.increment.mean;
        let (sin, cos) = mean.phi.sin_cos();
        let turn = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
        Control {
            increment: mean,
            covariance: turn * self.increment.covariance * turn.transpose(),
            turn_bias_gain: turn * self.increment.turn_bias_gain,
            dt_s: self.dt_s,
            distance_m: self.distance_m,
        }
    }
}
