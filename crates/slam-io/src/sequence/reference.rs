//! Reference paths: the body's planar path, relative to the body pose of the first frame.
//!
//! A camera-to-world file is moved to the body, `world_from_body = world_from_camera *
//! camera_from_body`, made relative, `first_from_body = world_from_first^-1 *
//! world_from_body`, and flattened: height, roll and pitch are dropped, the heading is
//! the direction of the body's x axis in the plane.

use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use super::motions::isometry_of;
use super::survey::Part;
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
    first_frame_s: Option<f64>,
) -> Part<Option<Vec<(f64, Se2)>>> {
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

/// Poses relative to the one at the first frame's time (or to the first of all), flattened.
pub(super) fn relative_to_first(
    poses: &[(f64, Isometry3<f64>)],
    first_frame_s: Option<f64>,
) -> Vec<(f64, Se2)> {
    let Some(&(earliest_s, earliest)) = poses.first() else {
        return Vec::new();
    };
    let world_from_first = pose_at(poses, first_frame_s.unwrap_or(earliest_s)).unwrap_or(earliest);
    let first_from_world = world_from_first.inverse();
    poses
        .iter()
        .map(|&(t_s, world_from_body)| (t_s, flattened(&(first_from_world * world_from_body))))
        .collect()
}

/// The pose at a time: the nearest one where it is near enough, otherwise between its neighbours.
fn pose_at(poses: &[(f64, Isometry3<f64>)], time_s: f64) -> Option<Isometry3<f64>> {
    let next = poses.partition_point(|pose| pose.0 < time_s);
    let neighbours = [next.checked_sub(1), Some(next)]
        .into_iter()
        .flatten()
        .filter_map(|index| poses.get(index));
    let nearest = neighbours.min_by(|a, b| {
        let far = |pose: &(f64, Isometry3<f64>)| (pose.0 - time_s).abs();
        far(a).total_cmp(&far(b))
    })?;
    if (nearest.0 - time_s).abs() <= SAME_TIME_S {
        return Some(nearest.1);
    }
    let (before, after) = (poses.get(next.checked_sub(1)?)?, poses.get(next)?);
    let share = (time_s - before.0) / (after.0 - before.0);
    before.1.try_lerp_slerp(&after.1, share, f64::EPSILON)
}

/// The planar part of a pose of the body.
pub(super) fn flattened(pose: &Isometry3<f64>) -> Se2 {
    let forward = pose.rotation * nalgebra::Vector3::x();
    Se2 {
        x: pose.translation.x,
        y: pose.translation.y,
        phi: forward.y.atan2(forward.x),
    }
}
