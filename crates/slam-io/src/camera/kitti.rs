//! KITTI's calibrations: `calib_cam_to_cam.txt` of a raw recording, `calib.txt` of an odometry sequence.
//!
//! ```text
//! S_rect_00: 1.242000e+03 3.750000e+02
//! P_rect_00: 7.215377e+02 0 6.095593e+02 0 0 7.215377e+02 1.728540e+02 0 0 0 1 0
//! ```
//!
//! The images of both are rectified: the left three columns of the projection are the pinhole, and there is no lens.
//! `calib.txt` (`P0:` to `P3:`) says no image size.

use std::path::Path;

use mono_geometry::Distortion;

use super::file::{CameraFile, file_fault};
use super::read::Wanted;
use crate::error::SequenceError;
use crate::text::{content_lines, finite, line_fault};

/// Whether a line is one of these files: a name of theirs, a colon, numbers.
pub(super) fn recognises(text: &str) -> bool {
    content_lines(text).any(|(_, line)| {
        line.split_once(':').is_some_and(|(name, values)| {
            camera_of(name).is_some() && values.split_ascii_whitespace().count() == 12
        })
    })
}

/// The camera that a projection belongs to: `P0` and `P_rect_00` are those of camera 0.
fn camera_of(name: &str) -> Option<u32> {
    let digits = name
        .strip_prefix("P_rect_")
        .or_else(|| name.strip_prefix('P'))?;
    digits.parse().ok()
}

pub(super) fn parse(
    path: &Path,
    text: &str,
    wanted: &mut Wanted<'_>,
) -> Result<CameraFile, SequenceError> {
    let rows: Vec<(u64, &str, &str)> = content_lines(text)
        .filter_map(|(line, content)| {
            let (name, values) = content.split_once(':')?;
            Some((line, name.trim(), values))
        })
        .collect();
    let numbers = |line: u64, values: &str| {
        values
            .split_ascii_whitespace()
            .map(|cell| finite(path, line, "a matrix", cell))
            .collect::<Result<Vec<_>, _>>()
    };
    let cameras: Vec<String> = rows
        .iter()
        .filter_map(|(_, name, _)| camera_of(name).map(|index| index.to_string()))
        .collect();
    let chosen = wanted.choose(path, &cameras, Some("0"))?;
    let projection = rows
        .iter()
        .find(|(_, name, _)| camera_of(name).is_some_and(|index| index.to_string() == chosen));
    let Some(&(line, name, values)) = projection else {
        return Err(file_fault(path, "a projection P0 or P_rect_00", "none"));
    };
    let values = numbers(line, values)?;
    let &[fx, skew, cx, _, zero, fy, cy, _, a, b, c, _] = values.as_slice() else {
        return Err(line_fault(
            path,
            line,
            format!("12 numbers for {name}"),
            values.len().to_string(),
        ));
    };
    if [skew, zero, a, b, c] != [0.0, 0.0, 0.0, 0.0, 1.0] {
        return Err(line_fault(
            path,
            line,
            format!("fx 0 cx, 0 fy cy, 0 0 1 in the left of {name}"),
            format!("{fx} {skew} {cx}, {zero} {fy} {cy}, {a} {b} {c}"),
        ));
    }
    let size_name = name.replacen('P', "S", 1);
    let size = match rows.iter().find(|(_, name, _)| *name == size_name) {
        None => None,
        Some(&(line, name, values)) => match numbers(line, values)?.as_slice() {
            &[width, height] if whole(width) && whole(height) => {
                Some([width as u32, height as u32])
            }
            _ => {
                return Err(line_fault(
                    path,
                    line,
                    format!("two whole numbers for {name}"),
                    values.trim(),
                ));
            }
        },
    };
    wanted.note(format!(
        "line {line}: {name} is the camera of rectified images, without a lens"
    ));
    let size = wanted.size_of(path, size, &format!("a size {size_name}"))?;
    Ok(CameraFile::of(size, [fx, fy, cx, cy], Distortion::None))
}

fn whole(value: f64) -> bool {
    value.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&value)
}
