//! `odometry.csv`: forward speed and turn rate of the body at any rate.

use std::path::Path;

use super::rows::{Odometry, OdometryRow, OdometrySource};
use crate::error::SequenceError;
use crate::text::{increasing, line_fault, read_table};
use crate::warning::Warning;

/// File name of the rows.
pub(super) const ODOMETRY: &str = "odometry.csv";

/// Largest believable forward speed of a wheeled robot, m/s.
const MAX_SPEED_MPS: f64 = 100.0;
/// Largest believable turn rate of a wheeled robot, rad/s.
const MAX_ANGULAR_SPEED_RADPS: f64 = 50.0;

/// The odometry of a folder, whichever of its files holds it.
///
/// `first_frame_s` is the time of the first image, if it is known.
pub(super) fn find_odometry(
    root: &Path,
    first_frame_s: Option<f64>,
    _warnings: &mut Vec<Warning>,
) -> Result<Odometry, SequenceError> {
    let path = root.join(ODOMETRY);
    if !path.exists() {
        return Err(no_odometry(&path));
    }
    Ok(Odometry {
        rows: read_odometry(&path, first_frame_s.unwrap_or(f64::INFINITY))?,
        source: OdometrySource::File(ODOMETRY.into()),
        file: Some(path),
    })
}

/// The sentence about missing odometry.
pub(super) fn no_odometry(path: &Path) -> SequenceError {
    SequenceError::Missing {
        path: path.to_path_buf(),
        holds: "the speeds of the robot, one row per measurement under the header t_s,v_mps,omega_radps (seconds, \
                metres per second forwards, radians per second to the left)"
            .into(),
    }
}

/// The text of the rows in the native form; it reads back to the same bits.
pub(super) fn odometry_csv(rows: &[OdometryRow]) -> String {
    let mut text = String::from("t_s,v_mps,omega_radps\n");
    for row in rows {
        text.push_str(&format!("{},{},{}\n", row.t_s, row.v_mps, row.omega_radps));
    }
    text
}

/// Reads the rows and checks that they begin no later than the first frame at `first_frame_s`.
pub(super) fn read_odometry(
    path: &Path,
    first_frame_s: f64,
) -> Result<Vec<OdometryRow>, SequenceError> {
    let mut rows: Vec<OdometryRow> = Vec::new();
    for (line, [t_s, v_mps, omega_radps]) in read_table(path, ["t_s", "v_mps", "omega_radps"])? {
        increasing(path, line, rows.last().map(|row| row.t_s), t_s)?;
        if rows.is_empty() && t_s > first_frame_s {
            return Err(line_fault(
                path,
                line,
                format!("a first row no later than the first frame at {first_frame_s} s"),
                format!("{t_s} s"),
            ));
        }
        if v_mps.abs() > MAX_SPEED_MPS {
            return Err(line_fault(
                path,
                line,
                format!("|v_mps| of at most {MAX_SPEED_MPS}"),
                v_mps.to_string(),
            ));
        }
        if omega_radps.abs() > MAX_ANGULAR_SPEED_RADPS {
            return Err(line_fault(
                path,
                line,
                format!("|omega_radps| of at most {MAX_ANGULAR_SPEED_RADPS}"),
                omega_radps.to_string(),
            ));
        }
        rows.push(OdometryRow {
            t_s,
            v_mps,
            omega_radps,
        });
    }
    Ok(rows)
}
