//! The camera on the robot: from a planar body pose to a camera pose in space.
//!
//! Body axes x forward, y left, z up; camera axes x right, y down, z forward. The robot moves in the plane, its carrier
//! may roll and pitch a little and its height may vary: R_world_from_body = Rz(phi) Ry(pitch) Rx(roll), translation
//! (x, y, height). Positive pitch lowers the nose, positive roll lowers the right side. With roll = pitch = height = 0
//! this is the planar model of the paper, whose camera looks sideways (theta_cr = 90 degrees in its Table I).

use estimation_base::Se2;
use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::error::{GeometryError, checked};
use crate::se3::Se3;
use crate::so3::rotation_from_matrix;

/// Pose of the camera in the body: from a planar body pose to a camera pose in space.
///
/// R_world_from_body = Rz(phi) Ry(pitch) Rx(roll); positive pitch lowers the nose, positive roll lowers the right side.
///
/// ```
/// use mono_geometry::nalgebra::Vector3;
/// use mono_geometry::{Mount, Se2};
///
/// // A camera that looks along the body's x axis: its z axis is forward.
/// let mount = Mount::forward();
/// let world_from_camera = mount.world_from_camera(&Se2::new(1.0, 0.0, 0.0), 0.0, 0.0, 0.0);
/// let ahead = world_from_camera.transform_point(&Vector3::new(0.0, 0.0, 2.0));
/// assert!((ahead - Vector3::new(3.0, 0.0, 0.0)).norm() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mount {
    /// Maps camera points to body points; the translation is the camera's position in the body, metres.
    pub body_from_camera: Se3,
}

impl Mount {
    /// A mount from numbers read from outside: the columns of the rotation are the camera's x, y and z axes in body
    /// axes, the position is that of the camera in the body, metres.
    ///
    /// # Errors
    /// [`GeometryError::NotARotation`] for a matrix that is not orthonormal with determinant +1 to within
    /// [`crate::so3::ROTATION_TOLERANCE`]; [`GeometryError::InvalidParameter`] for a position that is not finite.
    pub fn new(
        rotation_body_from_camera: &Matrix3<f64>,
        position_in_body: &Vector3<f64>,
    ) -> Result<Self, GeometryError> {
        let names = [
            "mount position x (m)",
            "mount position y (m)",
            "mount position z (m)",
        ];
        for (name, value) in names.into_iter().zip(position_in_body.iter()) {
            checked(name, *value, "finite", |_| true)?;
        }
        Ok(Self {
            body_from_camera: Se3::new(
                rotation_from_matrix(rotation_body_from_camera)?,
                *position_in_body,
            ),
        })
    }

    /// A camera at the body's origin looking along body x.
    #[must_use]
    pub fn forward() -> Self {
        // Columns: camera x = right = -y, camera y = down = -z, camera z = forward = +x.
        let axes = Matrix3::new(
            0.0, 0.0, 1.0, //
            -1.0, 0.0, 0.0, //
            0.0, -1.0, 0.0,
        );
        Self {
            body_from_camera: Se3::new(Rotation3::from_matrix_unchecked(axes), Vector3::zeros()),
        }
    }

    /// Camera pose in the world of a body at `world_from_body`, tilted by `roll` and `pitch` (radians) at `height`
    /// (metres). O(1).
    #[must_use]
    pub fn world_from_camera(
        &self,
        world_from_body: &Se2,
        roll: f64,
        pitch: f64,
        height: f64,
    ) -> Se3 {
        world_from_tilted_body(world_from_body, roll, pitch, height).compose(&self.body_from_camera)
    }
}

impl Default for Mount {
    fn default() -> Self {
        Self::forward()
    }
}

/// Axes, world, about which the heading, roll and pitch of [`world_from_tilted_body`] turn the body, as columns in this
/// order: e_z, Rz(phi) Ry(pitch) e_x and Rz(phi) e_y. Radians.
#[must_use]
pub fn tilted_body_axes(phi: f64, pitch: f64) -> Matrix3<f64> {
    let (sin, cos) = phi.sin_cos();
    let (sin_pitch, cos_pitch) = pitch.sin_cos();
    Matrix3::from_columns(&[
        Vector3::z(),
        Vector3::new(cos * cos_pitch, sin * cos_pitch, -sin_pitch),
        Vector3::new(-sin, cos, 0.0),
    ])
}

/// The body's pose in space: rotation Rz(phi) Ry(pitch) Rx(roll), translation (x, y, height). Radians, metres.
#[must_use]
pub fn world_from_tilted_body(world_from_body: &Se2, roll: f64, pitch: f64, height: f64) -> Se3 {
    let (sr, cr) = roll.sin_cos();
    let (sp, cp) = pitch.sin_cos();
    let (sy, cy) = world_from_body.phi.sin_cos();
    let rotation = Matrix3::new(
        cy * cp,
        cy * sp * sr - sy * cr,
        cy * sp * cr + sy * sr,
        sy * cp,
        sy * sp * sr + cy * cr,
        sy * sp * cr - cy * sr,
        -sp,
        cp * sr,
        cp * cr,
    );
    Se3::new(
        Rotation3::from_matrix_unchecked(rotation),
        Vector3::new(world_from_body.x, world_from_body.y, height),
    )
}
