//! A camera at a place in the world, in the form that inner loops project with.
//!
//! A pixel of a point X needs the difference X - c and one rotation, so the centre and the rotation from the world are
//! kept instead of a pose that would be inverted for every point.

use nalgebra::{Matrix3, Vector3};

use crate::se3::Se3;

/// Centre and orientation of a camera, ready to project.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PlacedCamera {
    /// Centre of the camera in world axes, in the length unit of the world (commonly metres).
    pub centre: Vector3<f64>,
    /// Rotation from world to camera axes (camera axes x right, y down, z forward).
    pub camera_from_world: Matrix3<f64>,
}

impl PlacedCamera {
    /// The camera at a pose. O(1).
    #[must_use]
    pub fn new(world_from_camera: &Se3) -> Self {
        Self {
            centre: world_from_camera.translation,
            camera_from_world: world_from_camera.rotation.matrix().transpose(),
        }
    }

    /// Maps a direction from world to camera axes.
    pub(crate) fn rotate(&self, in_world: &Vector3<f64>) -> Vector3<f64> {
        self.camera_from_world * in_world
    }
}
