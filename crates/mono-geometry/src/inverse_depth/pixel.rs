//! From a direction in camera axes to a pixel: when it is visible, and the derivative.

use nalgebra::{Matrix2x3, Vector3};

use crate::camera::Pinhole;

/// Smallest depth of a direction that is visible, as a share of its largest coordinate in camera axes.
pub const HORIZON: f64 = 1e-3;

/// Whether a direction in camera axes is visible. One that is not a number counts as visible, so that its pixel is not a
/// number either and nothing hides the fault.
#[inline]
pub(super) fn in_front(in_camera: &Vector3<f64>) -> bool {
    let behind = in_camera.z <= HORIZON * in_camera.amax();
    !behind
}

/// Derivative of the ideal pixel with respect to a direction in camera axes (2x3).
#[inline]
pub(super) fn pixel_by_direction(pinhole: &Pinhole, in_camera: &Vector3<f64>) -> Matrix2x3<f64> {
    let inverse = 1.0 / in_camera.z;
    Matrix2x3::new(
        pinhole.fx * inverse,
        0.0,
        -pinhole.fx * in_camera.x * inverse * inverse,
        0.0,
        pinhole.fy * inverse,
        -pinhole.fy * in_camera.y * inverse * inverse,
    )
}
