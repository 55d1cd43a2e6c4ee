//! The camera on the robot: everything about the sensor that does not change during a run.

use mono_geometry::{Camera, Mount, Pinhole};
use nalgebra::{Matrix3, Vector2, Vector3};

/// A calibrated camera and its pose on the robot.
///
/// The frame loop undistorts keypoints with [`Rig::camera`] once; the estimator behind it sees ideal pixels only.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rig {
    /// Intrinsics and lens distortion.
    pub camera: Camera,
    /// Pose of the camera in the body.
    pub mount: Mount,
}

impl Rig {
    /// The ideal pinhole behind the lens.
    pub(crate) fn pinhole(&self) -> &Pinhole {
        self.camera.pinhole()
    }

    /// Rotation from camera to body axes.
    pub(crate) fn body_from_camera(&self) -> &Matrix3<f64> {
        self.mount.body_from_camera.rotation.matrix()
    }

    /// Position of the camera in the body, metres.
    pub(crate) fn position_in_body(&self) -> &Vector3<f64> {
        &self.mount.body_from_camera.translation
    }

    /// Planar position of the camera in the body, metres: the arm that a turn of the body swings.
    pub(crate) fn lever_m(&self) -> Vector2<f64> {
        self.position_in_body().xy()
    }

    /// Width and height of the image, pixels.
    pub(crate) fn image_size_px(&self) -> Vector2<f64> {
        let pinhole = self.pinhole();
        Vector2::new(pinhole.width as f64, pinhole.height as f64)
    }
}
