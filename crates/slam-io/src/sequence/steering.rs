//! Speed and steering angle of a robot that is steered by its front wheels.
//!
//! The angle may be that of the front wheels or of a steering wheel; `robot.toml` holds the ratio, the reading straight
//! ahead and the wheelbase. The motion is that of the rear axle's middle: the body's origin lies there.

use std::path::Path;

use mono_geometry::motion::steered_turn_rate;

use super::columns::{SPEED, STEERING, STEERING_DEGREES, TIME, Table};
use super::robot::{ROBOT, Robot};
use super::rows::OdometryRow;
use crate::error::SequenceError;
use crate::text::{increasing, line_fault};

/// File name.
pub(super) const STEERING_FILE: &str = "steering.csv";
/// Its header.
pub(super) const HEADER: &str = "t_s,v_mps,steering_rad";
/// Largest believable angle of a front wheel, radians: 80 degrees.
const MAX_ANGLE_RAD: f64 = 1.4;

/// Rows made from speed and steering angle.
pub(super) struct Steered {
    pub(super) rows: Vec<OdometryRow>,
    /// How the header departs from [`HEADER`].
    pub(super) departure: Option<String>,
}

/// The rows of a table with speed and steering angle; `None` where it has no such columns.
pub(super) fn read_steering(
    path: &Path,
    table: &Table<'_>,
    robot_path: &Path,
    robot: Option<&Robot>,
) -> Result<Option<Steered>, SequenceError> {
    let radians = [&TIME, &SPEED, &STEERING];
    let degrees = [&TIME, &SPEED, &STEERING_DEGREES];
    let (selection, departure, unit) = match (table.select(radians), table.select(degrees)) {
        (Some(s), _) => (s, table.departure(&s, radians), 1.0),
        (None, Some(s)) => (s, table.departure(&s, degrees), 1.0_f64.to_radians()),
        (None, None) => return Ok(None),
    };
    let Some(steering) = robot.and_then(|robot| robot.steering) else {
        return Err(SequenceError::File {
            path: robot_path.to_path_buf(),
            expected: "wheelbase_m, the distance between the axles, in [steering] to read a steering angle".into(),
            found: if robot.is_some() {
                "none".into()
            } else {
                format!("no {ROBOT}")
            },
        });
    };
    let mut rows: Vec<OdometryRow> = Vec::new();
    for (line, [t_s, v_mps, angle]) in table.rows(&selection)? {
        increasing(path, line, rows.last().map(|row| row.t_s), t_s)?;
        let delta = (angle * unit - steering.offset_rad) / steering.ratio;
        if delta.abs() > MAX_ANGLE_RAD {
            return Err(line_fault(
                path,
                line,
                format!("an angle of the front wheels of at most {MAX_ANGLE_RAD} rad"),
                format!(
                    "{delta:.3} rad; degrees (then the column is steering_deg), or the angle of a steering wheel (then \
                     [steering] of robot.toml needs its ratio)?"
                ),
            ));
        }
        rows.push(OdometryRow {
            t_s,
            v_mps,
            omega_radps: steered_turn_rate(v_mps, delta, steering.wheelbase_m),
        });
    }
    Ok(Some(Steered { rows, departure }))
}
