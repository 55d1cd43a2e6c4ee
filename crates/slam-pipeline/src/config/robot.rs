//! Kinds of robot, and the settings that go with each.
//!
//! Wheels of every robot slip by about the same share of the way; the length over which that averages out grows with
//! the robot, and so do the noise per square root of a metre and the distance of the body origin from the point that does
//! not slip. A preset sets these; every key may still be set by itself.

use super::sections::{Config, Robot};

impl Config {
    /// The defaults for a kind of robot.
    #[must_use]
    pub fn for_robot(robot: Robot) -> Self {
        let mut config = Self::default();
        config.robot.preset = robot;
        match robot {
            Robot::Room => {}
            Robot::TableTop => {
                config.odometry.sideways_per_sqrt_m = 0.01;
                config.carrier.turning_centre_sigma_m = 0.1;
            }
            Robot::Car => {
                config.odometry.forward_per_sqrt_m = 0.03;
                config.odometry.sideways_per_sqrt_m = 0.03;
                config.carrier.turning_centre_sigma_m = 0.5;
                config.keyframes.min_parallax_px = 4.0;
                // A street bends a long rigid window by what the calibration is off.
                config.filter.window = 12;
            }
        }
        config
    }
}
