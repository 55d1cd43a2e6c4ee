//! The pose that a particle samples: the position of the camera and the attitude of the body.
//!
//! It has six numbers: the camera centre (x, y, z) in the particle's own length unit, the heading phi of the body, and
//! its roll and pitch. The planar part is the paper's state; z, roll and pitch are the small nuisance states of a
//! carrier that is not quite planar. They are zero in the strictly planar methods. The camera centre, not the body, is
//! the state because scaling the camera path and the map together changes no pixel, whatever the lever arm is.
//!
//! R_world_from_camera = Rz(phi) Ry(pitch) Rx(roll) R_body_from_camera.

use estimation_base::{Manifold, wrap};
use mono_geometry::world_from_tilted_body;
use mono_geometry::{PlacedCamera, Se2};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use serde::{Deserialize, Serialize};

use crate::rig::Rig;

/// Dimension of the sampled pose.
pub(crate) const POSE_DIM: usize = 6;

/// Tangent of a pose: (dx, dy, dz, dphi, droll, dpitch).
pub(crate) type PoseStep = SVector<f64, POSE_DIM>;

/// 6 x 6 matrix over the pose tangent.
pub(crate) type PoseMatrix = SMatrix<f64, POSE_DIM, POSE_DIM>;

/// Rows of the pose tangent that belong to the plane: x, y and heading.
pub(crate) const PLANAR: [usize; 3] = [0, 1, 3];

/// Camera centre and body attitude.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct CameraPose {
    /// Camera centre in the particle's world, in its length unit.
    pub(crate) centre: Vector3<f64>,
    /// Heading of the body, radians, in (-pi, pi].
    pub(crate) phi: f64,
    /// Roll of the body, radians.
    pub(crate) roll: f64,
    /// Pitch of the body, radians.
    pub(crate) pitch: f64,
}

impl CameraPose {
    /// The camera of `rig` at this pose, ready to project.
    #[must_use]
    pub(crate) fn place(&self, rig: &Rig) -> PlacedCamera {
        PlacedCamera {
            centre: self.centre,
            camera_from_world: (self.world_from_body() * rig.body_from_camera()).transpose(),
        }
    }

    /// Rotation from body to world axes.
    #[must_use]
    pub(crate) fn world_from_body(&self) -> Matrix3<f64> {
        let heading = Se2::new(0.0, 0.0, self.phi);
        *world_from_tilted_body(&heading, self.roll, self.pitch, 0.0)
            .rotation
            .matrix()
    }
}

/// Addition with a wrapped heading: volumes are those of the six numbers, as the Metropolis-Hastings moves require.
impl Manifold<POSE_DIM> for CameraPose {
    fn retract(&self, step: &PoseStep) -> Self {
        Self {
            centre: self.centre + step.fixed_rows::<3>(0),
            phi: wrap(self.phi + step[3]),
            roll: self.roll + step[4],
            pitch: self.pitch + step[5],
        }
    }

    fn local(&self, other: &Self) -> PoseStep {
        let d = other.centre - self.centre;
        PoseStep::from([
            d.x,
            d.y,
            d.z,
            wrap(other.phi - self.phi),
            other.roll - self.roll,
            other.pitch - self.pitch,
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    #[test]
    fn retract_and_local_are_inverse_across_pi() {
        let a = CameraPose {
            centre: Vector3::new(1.0, -2.0, 0.1),
            phi: PI - 0.01,
            roll: 0.02,
            pitch: -0.03,
        };
        let step = PoseStep::from([0.1, 0.2, -0.3, 0.05, 0.01, -0.02]);
        let b = a.retract(&step);
        assert!(b.phi < 0.0, "the heading wrapped");
        assert!((a.local(&b) - step).norm() < 1e-14);
    }

    #[test]
    fn attitude_is_rz_ry_rx() {
        let pose = CameraPose {
            centre: Vector3::zeros(),
            phi: 0.7,
            roll: -0.2,
            pitch: 0.3,
        };
        let oracle = nalgebra::Rotation3::from_euler_angles(-0.2, 0.3, 0.7);
        assert!((pose.world_from_body() - oracle.matrix()).norm() < 1e-15);
    }
}
