//! Trajectories in TUM format: `t x y z qx qy qz qw` a line, `#` comments.

use std::path::Path;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use trajectory_eval::StampedPose;

use crate::error::SequenceError;
use crate::text::{content_lines, finite, increasing, line_fault, quoted, read_text};

/// Names of the eight columns, for messages.
const COLUMNS: [&str; 8] = ["time", "x", "y", "z", "qx", "qy", "qz", "qw"];
/// How far from one the norm of a written quaternion may be.
const NORM_TOLERANCE: f64 = 1e-2;

/// Reads a TUM file.
///
/// # Errors
/// [`SequenceError`] for an unreadable file, a line without eight finite numbers, times
/// that do not increase, a quaternion that is far from unit length, or no pose at all.
pub fn read_tum(path: &Path) -> Result<Vec<StampedPose>, SequenceError> {
    parse_tum(path, &read_text(path)?)
}

/// The poses of the text of a TUM file; `path` is for messages.
fn parse_tum(path: &Path, text: &str) -> Result<Vec<StampedPose>, SequenceError> {
    let mut poses: Vec<StampedPose> = Vec::new();
    for (line, content) in content_lines(text) {
        let cells: Vec<&str> = content
            .split([' ', '\t', ','])
            .filter(|cell| !cell.is_empty())
            .collect();
        if cells.len() != COLUMNS.len() {
            return Err(line_fault(
                path,
                line,
                "eight numbers (t x y z qx qy qz qw)",
                format!("{} in {}", cells.len(), quoted(content)),
            ));
        }
        let mut values = [0.0; COLUMNS.len()];
        for ((value, name), cell) in values.iter_mut().zip(COLUMNS).zip(cells) {
            *value = finite(path, line, name, cell)?;
        }
        let [t_s, x, y, z, qx, qy, qz, qw] = values;
        increasing(path, line, poses.last().map(|pose| pose.t_s), t_s)?;
        let quaternion = Quaternion::new(qw, qx, qy, qz);
        if (quaternion.norm() - 1.0).abs() > NORM_TOLERANCE {
            return Err(line_fault(
                path,
                line,
                "a quaternion of unit length",
                format!("length {}", quaternion.norm()),
            ));
        }
        poses.push(StampedPose {
            t_s,
            world_from_frame: Isometry3::from_parts(
                Translation3::new(x, y, z),
                UnitQuaternion::from_quaternion(quaternion),
            ),
        });
    }
    if poses.is_empty() {
        return Err(SequenceError::File {
            path: path.to_path_buf(),
            expected: "at least one line t x y z qx qy qz qw".into(),
            found: "none".into(),
        });
    }
    Ok(poses)
}
