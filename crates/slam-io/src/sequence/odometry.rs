//! The odometry of a folder, from whichever file holds it.
//!
//! | file | header | becomes |
//! |---|---|---|
//! | `odometry.csv` | `t_s,v_mps,omega_radps` | rows as they are |
//! | | `t_s,x_m,y_m,phi_rad`, or lines of a TUM trajectory | differences of poses |
//! | | `t_s,v_mps,steering_rad` | with `robot.toml`: turn rate of the rear axle |
//! | `wheels.csv` | `t_s,left_ticks,right_ticks` | with `robot.toml`: mean speed and turn rate between readings |
//! | `steering.csv` | `t_s,v_mps,steering_rad` | as above |
//! | `gyro.csv` | `t_s,omega_radps` | beside one of the others: its turn rate replaces theirs |
//!
//! The first of the three that is there is read. Columns are found by name.

use std::path::Path;

use mono_geometry::Se2;

use super::columns::{HEADING, SPEED, TIME, TURN_RATE, Table, X, Y};
use super::coverage::check_coverage;
use super::gyro::{self, GYRO};
use super::poses::{remarks, rows_of_poses};
use super::reference::flattened;
use super::robot::{ROBOT, Robot};
use super::rows::{Odometry, OdometryRow, OdometrySource};
use super::steering::{STEERING_FILE, read_steering};
use super::wheels::{WHEELS, read_wheels};
use crate::error::SequenceError;
use crate::text::{content_lines, increasing, line_fault, read_text};
use crate::tum::read_tum;
use crate::warning::Warning;

/// File name of the rows.
pub(super) const ODOMETRY: &str = "odometry.csv";
/// Their header.
const HEADER: &str = "t_s,v_mps,omega_radps";

/// Largest believable forward speed of a wheeled robot, m/s.
const MAX_SPEED_MPS: f64 = 100.0;
/// Largest believable turn rate of a wheeled robot, rad/s.
const MAX_ANGULAR_SPEED_RADPS: f64 = 50.0;
/// Turn rate that only an unusual robot reaches, rad/s: nearly a turn a second.
const UNUSUAL_ANGULAR_SPEED_RADPS: f64 = 5.0;

/// The odometry of a folder, whichever of its files holds it.
///
/// `times_s` are the times of the images, if they are known.
pub(super) fn find_odometry(
    root: &Path,
    times_s: Option<&[f64]>,
    warnings: &mut Vec<Warning>,
) -> Result<Odometry, SequenceError> {
    let there: Vec<&str> = [ODOMETRY, WHEELS, STEERING_FILE]
        .into_iter()
        .filter(|name| root.join(name).exists())
        .collect();
    let Some((&name, unused)) = there.split_first() else {
        return Err(no_odometry(&root.join(ODOMETRY)));
    };
    if !unused.is_empty() {
        warnings.push(Warning::new(
            "odometry-not-used",
            format!("{} is read, {} is not", name, unused.join(" and ")),
        ));
    }
    let robot_path = root.join(ROBOT);
    let robot = robot_path
        .exists()
        .then(|| Robot::read(&robot_path))
        .transpose()?;
    let gyro_path = root.join(GYRO);
    let gyro = gyro_path.exists();
    let path = root.join(name);
    let mut read = match name {
        WHEELS => {
            let Some(wheels) = robot.and_then(|robot| robot.wheels) else {
                return Err(no_wheels(&robot_path, robot.is_some()));
            };
            Rows {
                rows: read_wheels(&path, &robot_path, &wheels, gyro, warnings)?,
                source: OdometrySource::Wheels,
                line: None,
                native: false,
            }
        }
        STEERING_FILE => {
            let table = Table::open(&path, &TIME, super::steering::HEADER)?;
            steered(&path, &table, &robot_path, robot.as_ref(), warnings)?
                .ok_or_else(|| table.header_fault(super::steering::HEADER))?
        }
        _ => read_rows(&path, &robot_path, robot.as_ref(), warnings)?,
    };
    if gyro {
        gyro::apply(&gyro_path, &mut read.rows, warnings)?;
    }
    if let Some(times_s) = times_s {
        warnings.extend(check_coverage(&path, read.line, &mut read.rows, times_s)?);
    }
    Ok(Odometry {
        rows: read.rows,
        source: read.source,
        file: (read.native && !gyro).then_some(path),
    })
}

/// The rows that `Sequence::input_files` put beside the results of a run.
pub(super) fn read_odometry(
    path: &Path,
    first_frame_s: f64,
) -> Result<Vec<OdometryRow>, SequenceError> {
    let mut read = read_rows(path, &path.with_file_name(ROBOT), None, &mut Vec::new())?;
    check_coverage(path, read.line, &mut read.rows, &[first_frame_s])?;
    Ok(read.rows)
}

/// The sentence about missing odometry.
pub(super) fn no_odometry(path: &Path) -> SequenceError {
    SequenceError::Missing {
        path: path.to_path_buf(),
        holds: format!(
            "the speeds of the robot, one row per measurement under the header {HEADER} (seconds, metres per second \
             forwards, radians per second to the left); {WHEELS} with {ROBOT} serves as well"
        ),
    }
}

fn no_wheels(path: &Path, exists: bool) -> SequenceError {
    let holds = format!(
        "the wheels for {WHEELS}: [wheels] with metres_per_tick (or wheel_radius_m and ticks_per_turn) and base_m"
    );
    if exists {
        SequenceError::File {
            path: path.to_path_buf(),
            expected: holds,
            found: "no [wheels]".into(),
        }
    } else {
        SequenceError::Missing {
            path: path.to_path_buf(),
            holds,
        }
    }
}

/// Rows as a file gave them.
struct Rows {
    rows: Vec<OdometryRow>,
    source: OdometrySource,
    /// Line of the first row.
    line: Option<u64>,
    /// Whether the file reads to the same rows by itself.
    native: bool,
}

/// Reads `odometry.csv`, whichever of its forms it has.
fn read_rows(
    path: &Path,
    robot_path: &Path,
    robot: Option<&Robot>,
    warnings: &mut Vec<Warning>,
) -> Result<Rows, SequenceError> {
    let name = path
        .file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    if is_tum(&read_text(path)?) {
        let poses: Vec<(f64, Se2)> = read_tum(path)?
            .into_iter()
            .map(|pose| (pose.t_s, flattened(&pose.world_from_frame)))
            .collect();
        return from_poses(path, &name, &poses, warnings);
    }
    let table = Table::open(path, &TIME, HEADER)?;
    let columns = [&TIME, &SPEED, &TURN_RATE];
    if let Some(selection) = table.select(columns) {
        let departure = table.departure(&selection, columns);
        remark_columns(&name, departure, warnings);
        let rows = table.rows(&selection)?;
        let line = rows.first().map(|row| row.0);
        return Ok(Rows {
            rows: checked(path, &rows, warnings)?,
            source: OdometrySource::File(name),
            line,
            native: true,
        });
    }
    if let Some(rows) = steered(path, &table, robot_path, robot, warnings)? {
        return Ok(rows);
    }
    let columns = [&TIME, &X, &Y, &HEADING];
    let Some(selection) = table.select(columns) else {
        return Err(table.header_fault(HEADER));
    };
    remark_columns(&name, table.departure(&selection, columns), warnings);
    let mut poses: Vec<(f64, Se2)> = Vec::new();
    for (line, [t_s, x, y, phi]) in table.rows(&selection)? {
        increasing(path, line, poses.last().map(|pose| pose.0), t_s)?;
        poses.push((t_s, Se2::new(x, y, phi)));
    }
    from_poses(path, &name, &poses, warnings)
}

fn remark_columns(name: &str, departure: Option<String>, warnings: &mut Vec<Warning>) {
    if let Some(departure) = departure {
        warnings.push(Warning::new(
            "odometry-columns",
            format!("{name}: {departure}"),
        ));
    }
}

fn steered(
    path: &Path,
    table: &Table<'_>,
    robot_path: &Path,
    robot: Option<&Robot>,
    warnings: &mut Vec<Warning>,
) -> Result<Option<Rows>, SequenceError> {
    let Some(steered) = read_steering(path, table, robot_path, robot)? else {
        return Ok(None);
    };
    let name = path
        .file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    remark_columns(&name, steered.departure, warnings);
    check_speeds(path, &steered.rows)?;
    Ok(Some(Rows {
        rows: steered.rows,
        source: OdometrySource::Steering,
        line: None,
        native: false,
    }))
}

/// Eight bare numbers: a TUM trajectory.
fn is_tum(text: &str) -> bool {
    content_lines(text).next().is_some_and(|(_, first)| {
        let cells: Vec<&str> = first.split_whitespace().collect();
        cells.len() == 8 && cells.iter().all(|cell| cell.parse::<f64>().is_ok())
    })
}

fn from_poses(
    path: &Path,
    name: &str,
    poses: &[(f64, Se2)],
    warnings: &mut Vec<Warning>,
) -> Result<Rows, SequenceError> {
    if poses.len() < 2 {
        return Err(SequenceError::File {
            path: path.to_path_buf(),
            expected: "at least two poses, a motion is their difference".into(),
            found: poses.len().to_string(),
        });
    }
    warnings.extend(remarks(name, poses));
    let rows = rows_of_poses(poses);
    check_speeds(path, &rows)?;
    Ok(Rows {
        rows,
        source: OdometrySource::File(name.to_owned()),
        line: None,
        native: false,
    })
}

/// Refuses speeds that no wheeled robot has, where they are made from something else.
fn check_speeds(path: &Path, rows: &[OdometryRow]) -> Result<(), SequenceError> {
    match rows.iter().find(|row| row.v_mps.abs() > MAX_SPEED_MPS) {
        None => Ok(()),
        Some(row) => Err(SequenceError::File {
            path: path.to_path_buf(),
            expected: format!("a robot of at most {MAX_SPEED_MPS} m/s"),
            found: format!("{:.1} m/s at {} s; millimetres?", row.v_mps, row.t_s),
        }),
    }
}

/// Speeds and turn rates of a text file, checked line by line.
fn checked(
    path: &Path,
    table: &[(u64, [f64; 3])],
    warnings: &mut Vec<Warning>,
) -> Result<Vec<OdometryRow>, SequenceError> {
    let mut rows: Vec<OdometryRow> = Vec::with_capacity(table.len());
    for &(line, [t_s, v_mps, omega_radps]) in table {
        increasing(path, line, rows.last().map(|row| row.t_s), t_s)?;
        if v_mps.abs() > MAX_SPEED_MPS {
            return Err(line_fault(
                path,
                line,
                format!("|v_mps| of at most {MAX_SPEED_MPS}"),
                format!("{v_mps} (in millimetres per second? v_mps is in metres per second)"),
            ));
        }
        if omega_radps.abs() > MAX_ANGULAR_SPEED_RADPS {
            return Err(line_fault(
                path,
                line,
                format!("|omega_radps| of at most {MAX_ANGULAR_SPEED_RADPS}"),
                format!(
                    "{omega_radps} (in degrees per second? omega_radps is in radians per second)"
                ),
            ));
        }
        rows.push(OdometryRow {
            t_s,
            v_mps,
            omega_radps,
        });
    }
    let fastest = rows
        .iter()
        .map(|row| row.omega_radps.abs())
        .fold(0.0, f64::max);
    if fastest > UNUSUAL_ANGULAR_SPEED_RADPS {
        warnings.push(Warning::new(
            "turn-rate-implausible",
            format!(
                "The largest omega_radps is {fastest:.1}, {:.1} turns a second: if it is in degrees per second, it is {:.2} rad/s",
                fastest / core::f64::consts::TAU,
                fastest.to_radians()
            ),
        ));
    }
    Ok(rows)
}
