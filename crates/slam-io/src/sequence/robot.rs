//! `robot.toml`: the numbers of a robot that turn encoder counts and steering angles into motion.
//!
//! ```toml
//! [wheels]                        # for wheels.csv
//! wheel_radius_m = 0.033          # or left_wheel_radius_m and right_wheel_radius_m
//! ticks_per_turn = 1024           # counts per turn of the wheel, gearbox and quadrature included
//! # metres_per_tick = 0.0002      # in place of the radius and ticks_per_turn
//! base_m = 0.16                   # between the points where the two wheels touch the floor
//! tick_range = [-32768, 32767]    # optional: where the counter wraps
//! counts = "cumulative"           # or "since_last_row"
//!
//! [steering]                      # for a column steering_rad or steering_deg
//! wheelbase_m = 2.70              # between the axles
//! ratio = 15.3                    # optional: steering wheel over front wheel
//! offset_rad = 0.0                # optional: the reading when the robot goes straight
//! ```

use std::path::Path;

use serde::Deserialize;

use crate::error::SequenceError;
use crate::text::{line_fault, read_text};

/// File name.
pub(crate) const ROBOT: &str = "robot.toml";

/// Contents of `robot.toml`, as written.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotFile {
    wheels: Option<WheelsSection>,
    steering: Option<SteeringSection>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct WheelsSection {
    wheel_radius_m: Option<f64>,
    left_wheel_radius_m: Option<f64>,
    right_wheel_radius_m: Option<f64>,
    ticks_per_turn: Option<f64>,
    metres_per_tick: Option<f64>,
    base_m: Option<f64>,
    tick_range: Option<[i64; 2]>,
    #[serde(default)]
    counts: Counts,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct SteeringSection {
    wheelbase_m: f64,
    #[serde(default = "one")]
    ratio: f64,
    #[serde(default)]
    offset_rad: f64,
}

fn one() -> f64 {
    1.0
}

/// The start of a count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Counts {
    /// From the start of the counter.
    #[default]
    Cumulative,
    /// From the row before.
    SinceLastRow,
}

/// The driven wheels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Wheels {
    /// Metres a tick of the left and the right wheel, where they are given or follow.
    pub(crate) metres_per_tick: Option<[f64; 2]>,
    /// Radii of the left and the right wheel, metres, where they are given.
    pub(crate) radii_m: Option<[f64; 2]>,
    /// Distance between the wheels, metres; `None` where a gyroscope tells the turn.
    pub(crate) base_m: Option<f64>,
    /// Smallest and largest count before the counter wraps.
    pub(crate) tick_range: Option<[i64; 2]>,
    /// The start of a count.
    pub(crate) counts: Counts,
}

/// The steering.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Steering {
    /// Distance between the axles, metres.
    pub(crate) wheelbase_m: f64,
    /// Angle read over angle of the front wheel.
    pub(crate) ratio: f64,
    /// Angle read when the robot goes straight, radians.
    pub(crate) offset_rad: f64,
}

/// Checked contents of `robot.toml`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Robot {
    pub(crate) wheels: Option<Wheels>,
    pub(crate) steering: Option<Steering>,
}

impl Robot {
    /// Reads and checks the file.
    pub(crate) fn read(path: &Path) -> Result<Self, SequenceError> {
        let text = read_text(path)?;
        let text = text.trim_start_matches('\u{feff}');
        let raw: RobotFile = ::toml::from_str(text).map_err(|error| {
            let offset = error.span().map_or(0, |span| span.start.min(text.len()));
            let newlines = text.as_bytes()[..offset].iter().filter(|&&b| b == b'\n');
            line_fault(
                path,
                1 + newlines.count() as u64,
                "[wheels] or [steering] of a robot",
                error.message().replace('\n', " "),
            )
        })?;
        Ok(Self {
            wheels: raw.wheels.map(|w| checked_wheels(path, &w)).transpose()?,
            steering: raw
                .steering
                .map(|s| checked_steering(path, &s))
                .transpose()?,
        })
    }
}

fn fault(path: &Path, expected: impl Into<String>, found: impl Into<String>) -> SequenceError {
    SequenceError::File {
        path: path.to_path_buf(),
        expected: expected.into(),
        found: found.into(),
    }
}

/// A finite value above zero.
fn positive(path: &Path, section: &str, name: &str, value: f64) -> Result<f64, SequenceError> {
    if value.is_finite() && value > 0.0 {
        Ok(value)
    } else {
        let expected = format!("a positive {name} in [{section}]");
        Err(fault(path, expected, value.to_string()))
    }
}

fn checked_wheels(path: &Path, raw: &WheelsSection) -> Result<Wheels, SequenceError> {
    let check = |name: &str, value: Option<f64>| {
        value
            .map(|value| positive(path, "wheels", name, value))
            .transpose()
    };
    let both = check("wheel_radius_m", raw.wheel_radius_m)?;
    let left = check("left_wheel_radius_m", raw.left_wheel_radius_m)?.or(both);
    let right = check("right_wheel_radius_m", raw.right_wheel_radius_m)?.or(both);
    let radii_m = match (left, right) {
        (Some(left), Some(right)) => Some([left, right]),
        (None, None) => None,
        _ => {
            return Err(fault(
                path,
                "left_wheel_radius_m and right_wheel_radius_m in [wheels]",
                "one of them",
            ));
        }
    };
    let ticks_per_turn = check("ticks_per_turn", raw.ticks_per_turn)?;
    let metres_per_tick = check("metres_per_tick", raw.metres_per_tick)?;
    let metres_per_tick = match (metres_per_tick, radii_m, ticks_per_turn) {
        (Some(_), Some(_), Some(_)) => {
            return Err(fault(
                path,
                "metres_per_tick, or a radius and ticks_per_turn, in [wheels]",
                "both",
            ));
        }
        (Some(metres), _, _) => Some([metres; 2]),
        (None, Some(radii), Some(ticks)) => {
            Some(radii.map(|radius| core::f64::consts::TAU * radius / ticks))
        }
        _ => None,
    };
    if let Some([low, high]) = raw.tick_range
        && low >= high
    {
        return Err(fault(
            path,
            "tick_range = [smallest, largest] in [wheels]",
            format!("[{low}, {high}]"),
        ));
    }
    Ok(Wheels {
        metres_per_tick,
        radii_m,
        base_m: check("base_m", raw.base_m)?,
        tick_range: raw.tick_range,
        counts: raw.counts,
    })
}

fn checked_steering(path: &Path, raw: &SteeringSection) -> Result<Steering, SequenceError> {
    let offset_rad = raw.offset_rad;
    if !offset_rad.is_finite() {
        let found = offset_rad.to_string();
        return Err(fault(path, "a finite offset_rad in [steering]", found));
    }
    // A sensor that counts to the right has a negative ratio.
    if !(raw.ratio.is_finite() && raw.ratio != 0.0) {
        let found = raw.ratio.to_string();
        return Err(fault(path, "a ratio other than zero in [steering]", found));
    }
    Ok(Steering {
        wheelbase_m: positive(path, "steering", "wheelbase_m", raw.wheelbase_m)?,
        ratio: raw.ratio,
        offset_rad,
    })
}
