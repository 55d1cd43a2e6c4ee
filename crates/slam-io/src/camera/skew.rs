//! The skew of a camera matrix, which this program's camera does not have.
//!
//! ROS and OpenCV leave the skew of a fisheye free, and find a fraction of a pixel. Left out it moves a pixel at the upper
//! or lower edge by skew times its height over fy; below [`LARGEST_SHIFT_PX`] that is less than what the lens model is
//! good for, and it is dropped with a note.

use super::file::CameraFile;
use super::read::Wanted;
use super::yaml::Node;
use crate::error::SequenceError;

/// Largest shift of a pixel that may be left out.
const LARGEST_SHIFT_PX: f64 = 1.5;

/// Leaves the skew out, or refuses one that would be missed.
pub(super) fn drop_skew(
    matrix: &Node<'_>,
    camera: &CameraFile,
    skew: f64,
    wanted: &mut Wanted<'_>,
) -> Result<(), SequenceError> {
    if skew == 0.0 {
        return Ok(());
    }
    let reach = camera
        .cy
        .abs()
        .max((f64::from(camera.height) - camera.cy).abs());
    let shift = (skew * reach / camera.fy).abs();
    // Written so that a NaN is refused.
    if shift <= LARGEST_SHIFT_PX {
        wanted.note(format!(
            "line {}: the skew of {skew} px is left out; it moves pixels by at most {shift:.2} px",
            matrix.line()
        ));
        return Ok(());
    }
    Err(matrix.fault(
        &format!("a skew that moves pixels by at most {LARGEST_SHIFT_PX} px"),
        format!("a skew of {skew} px, which moves them by {shift:.1} px"),
    ))
}
