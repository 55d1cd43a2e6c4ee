//! Reference paths: the body's planar path, relative to the body pose of the first frame.
//!
//! A camera-to-world file is moved to the body, `world_from_body = world_from_camera *
//! camera_from_body`, made relative, `first_from_body = world_from_first^-1 *
//! world_from_body`, and flattened: height, roll and pitch are dropped, the heading is
//! the direction of the body's x axis in the plane.

use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};

use crate::camera::MountFile;
use crate::error::SequenceError;
use crate::text::{increasing, line_fault, read_table};
use crate::tum::read_tum;
use mono_geometry::Se2;

/// A reference pose this near to the first frame's time (seconds) is that frame's pose.
const SAME_TIME_S: f64 = 0.01;

/// The folder's reference path; `None` when it has neither file.
pub(super) fn read_reference(
    root: &Path,
    mount: &MountFile,
    first_frame_s: f64,
) -> Result<Option<Vec<(f64, Se2)>>, SequenceError> {
    let planar = root.join("groundtruth_planar.csv");
    let tum = root.join("groundtruth.txt");
    let poses = if planar.exists() {
        read_planar(&planar)?
    } else if tum.exists() {
        let body_from_camera = isometry_of(mount);
        read_tum(&tum)?
            .into_iter()
            .map(|pose| (pose.t_s, pose.world_from_frame * body_from_camera.inverse()))
            .collect()
    } else {
        return Ok(None);
    };
    Ok(Some(relative_to_first(&poses, first_frame_s)))
}

/// Rows `frame,t_s,x_m,y_m,phi_rad` as poses in space.
fn read_planar(path: &Path) -> Result<Vec<(f64, Isometry3<f64>)>, SequenceError> {
    let mut poses: Vec<(f64, Isometry3<f64>)> = Vec::new();
    for (line, [frame, t_s, x, y, phi]) in
        read_table(path, ["frame", "t_s", "x_m", "y_m", "phi_rad"])?
    {
        if frame < 0.0 || frame.fract() != 0.0 {
            return Err(line_fault(
                path,
                line,
                "a whole frame number",
                frame.to_string(),
            ));
        }
        increasing(path, line, poses.last().map(|&(before, _)| before), t_s)?;
        let rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, phi);
        poses.push((
            t_s,
            Isometry3::from_parts(Translation3::new(x, y, 0.0), rotation),
        ));
    }
    Ok(poses)
}

fn isometry_of(mount: &MountFile) -> Isometry3<f64> {
    let rows = mount.rotation_body_from_camera;
    let rotation =
        Rotation3::from_matrix_unchecked(Matrix3::from_fn(|row, column| rows[row][column]));
    let [x, y, z] = mount.position_in_body;
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_rotation_matrix(&rotation),
    )
}

/// Poses relative to the one at the first frame's time (or to the first of all), flattened.
fn relative_to_first(poses: &[(f64, Isometry3<f64>)], first_frame_s: f64) -> Vec<(f64, Se2)> {
    let origin = poses
        .iter()
        .min_by(|a, b| {
            (a.0 - first_frame_s)
                .abs()
                .total_cmp(&(b.0 - first_frame_s).abs())
        })
        .filter(|pose| (pose.0 - first_frame_s).abs() <= SAME_TIME_S)
        .or(poses.first());
    let Some(&(_, world_from_first)) = origin else {
        return Vec::new();
    };
    let first_from_world = world_from_first.inverse();
    poses
        .iter()
        .map(|&(t_s, world_from_body)| (t_s, flattened(&(first_from_world * world_from_body))))
        .collect()
}

fn flattened(pose: &Isometry3<f64>) -> Se2 {
    let forward = pose.rotation * nalgebra::Vector3::x();
    Se2 {
        x: pose.translation.x,
        y: pose.translation.y,
        phi: forward.y.atan2(forward.x),
    }
}
