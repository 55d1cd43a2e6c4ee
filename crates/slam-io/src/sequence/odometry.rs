//! `odometry.csv`: forward speed and turn rate of the body at any rate.

use std::path::Path;

use crate::error::SequenceError;
use crate::text::{increasing, line_fault, read_table};

/// Largest believable forward speed of a wheeled robot, m/s.
const MAX_SPEED_MPS: f64 = 100.0;
/// Largest believable turn rate of a wheeled robot, rad/s.
const MAX_ANGULAR_SPEED_RADPS: f64 = 50.0;

/// One row: it holds from its time to the next row's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryRow {
    /// Time from which the row holds, seconds.
    pub t_s: f64,
    /// Forward speed, m/s.
    pub v_mps: f64,
    /// Turn rate about the body's z axis (left positive), rad/s.
    pub omega_radps: f64,
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
