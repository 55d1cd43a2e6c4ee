//! Pose of the target in one view, in closed form (Zhang 2000, section 3.1 and appendix C).
//!
//! With H ~ K [r1 r2 t], A = K^-1 H and s = 2 / (|a1| + |a2|): r1 = s a1, r2 = s a2, r3 = r1 x r2, t = s a3. The three
//! columns are orthonormal only up to noise; the nearest rotation in the Frobenius norm replaces them. The sign of H is
//! positive at the middle of the corners, so the target is in front of the camera.
//!
//! Degenerate: a1 or a2 vanishes (no view of a plane). A strong perspective with wrong correspondences puts some
//! corners behind the camera; the caller checks that all of them project.

use nalgebra::{Matrix3, Vector2};

use crate::camera::Pinhole;
use crate::homography::Homography;
use crate::linalg::nearest_rotation;
use crate::se3::Se3;

/// `camera_from_board` of a homography board -> ideal pixel, `middle` a board point in front of the camera; `None` for
/// a homography that is not the view of a plane. O(1).
#[must_use]
pub fn pose_from_homography(
    pinhole: &Pinhole,
    homography: &Homography,
    middle: &Vector2<f64>,
) -> Option<Se3> {
    let normalized_from_pixel = pinhole.normalized_from_pixel();
    let columns = normalized_from_pixel * homography.matrix();
    let depth = (columns * middle.push(1.0)).z;
    let size = columns.column(0).norm() + columns.column(1).norm();
    let columns = columns * (2.0 * depth.signum() / size);
    let r1 = columns.column(0).into_owned();
    let r2 = columns.column(1).into_owned();
    let rotation = nearest_rotation(&Matrix3::from_columns(&[r1, r2, r1.cross(&r2)])).ok()?;
    let translation = columns.column(2).into_owned();
    translation
        .iter()
        .chain(rotation.matrix().iter())
        .all(|v| v.is_finite())
        .then(|| Se3::new(rotation, translation))
}
