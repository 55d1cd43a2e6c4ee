//! A pose with its time, in space or in the plane.

use estimation_base::Se2;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};

/// A pose with its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StampedPose {
    /// Time in seconds.
    pub t_s: f64,
    /// World from whatever moves, camera or body; metres.
    pub world_from_frame: Isometry3<f64>,
}

impl StampedPose {
    /// A pose in the plane: height zero, `x` and `y` in metres, heading `phi` about the z axis in radians.
    pub fn planar(t_s: f64, x: f64, y: f64, phi: f64) -> StampedPose {
        StampedPose {
            t_s,
            world_from_frame: Isometry3::from_parts(
                Translation3::new(x, y, 0.0),
                UnitQuaternion::from_euler_angles(0.0, 0.0, phi),
            ),
        }
    }
}

/// Planar poses, (time in seconds, pose), as poses in space with height zero.
pub fn spatial<P: Copy + Into<Se2>>(path: &[(f64, P)]) -> Vec<StampedPose> {
    path.iter()
        .map(|&(t_s, pose)| {
            let Se2 { x, y, phi } = pose.into();
            StampedPose::planar(t_s, x, y, phi)
        })
        .collect()
}
