//! The robot's departures from a body that rolls exactly where its wheels say.
//!
//! All are zero for the paper's robot. The truth contains them exactly; the wheels do not see them, or see them wrong.

use serde::{Deserialize, Serialize};

/// A robot that slips, sways, climbs, and measures its motion wrongly in a constant way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Carrier {
    /// Slip angle per turn rate, seconds: in a turn of rate omega the robot drifts outwards with `-curve_slip_s omega`
    /// radians between its heading and its motion.
    pub curve_slip_s: f64,
    /// White sideways slip of a frame, standard deviation as a share of the frame's length.
    pub slip_ratio: f64,
    /// Sway about the driving direction, root mean square, radians.
    pub roll_rad: f64,
    /// Sway about the sideways axis, root mean square, radians.
    pub pitch_rad: f64,
    /// Distance by which the body origin lies ahead of the point that does not move sideways in a turn, metres;
    /// negative behind it.
    pub origin_ahead_m: f64,
    /// Steepest slope of the floor, radians: the robot climbs and comes down again, nose along the slope.
    pub slope_rad: f64,
    /// Constant error of the reported turn rate, radians per second.
    pub turn_bias_radps: f64,
    /// Constant relative error of the reported speed, as from a wrong wheel radius.
    pub wheel_radius_ratio: f64,
}

impl Carrier {
    /// A body that rolls exactly where its wheels say.
    pub const IDEAL: Self = Self {
        curve_slip_s: 0.0,
        slip_ratio: 0.0,
        roll_rad: 0.0,
        pitch_rad: 0.0,
        origin_ahead_m: 0.0,
        slope_rad: 0.0,
        turn_bias_radps: 0.0,
        wheel_radius_ratio: 0.0,
    };
}

impl Default for Carrier {
    fn default() -> Self {
        Self::IDEAL
    }
}
