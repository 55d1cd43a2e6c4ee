//! Rigid motions as files write them.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::camera::MountFile;

/// Poses with their times in seconds.
pub(super) type TimedPoses = Vec<(f64, Isometry3<f64>)>;

/// `body_from_camera`.
pub(super) fn isometry_of(mount: &MountFile) -> Isometry3<f64> {
    let rows = mount.rotation_body_from_camera;
    rigid_motion(
        &std::array::from_fn(|index| rows[index / 3][index % 3]),
        mount.position_in_body,
    )
}

/// The mount of `body_from_camera`.
pub(super) fn mount_of(body_from_camera: &Isometry3<f64>) -> MountFile {
    let rotation = body_from_camera.rotation.to_rotation_matrix();
    MountFile {
        position_in_body: body_from_camera.translation.vector.into(),
        rotation_body_from_camera: std::array::from_fn(|row| {
            std::array::from_fn(|column| rotation[(row, column)])
        }),
    }
}

/// A rotation, row by row and nearly orthonormal, and a translation.
pub(super) fn rigid_motion(rotation: &[f64; 9], translation: [f64; 3]) -> Isometry3<f64> {
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(rotation));
    let mut rotation = UnitQuaternion::from_rotation_matrix(&rotation);
    rotation.renormalize();
    Isometry3::from_parts(Translation3::from(Vector3::from(translation)), rotation)
}
