//! The calibration that a sequence states, which may be wrong by a chosen amount.
//!
//! The images are rendered with the true camera; only what `camera.toml` says departs from it.

use crate::camera::{
    CX, CY, FX, FY, HEIGHT, Lens, POSITION_IN_BODY, ROTATION_BODY_FROM_CAMERA, WIDTH,
};
use mono_geometry::{Mount, Pinhole, Se3};
use nalgebra::{Matrix3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};

/// Errors of the stated calibration.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct CalibrationError {
    /// Turn of the stated mount against the true one about the body's vertical, radians.
    pub mount_yaw_rad: f64,
    /// Relative error of the stated focal lengths.
    pub focal_ratio: f64,
}

impl CalibrationError {
    /// The stated intrinsics.
    pub(crate) fn pinhole(&self, lens: Lens) -> Pinhole {
        let (fx, fy) = match lens {
            Lens::Pinhole => (FX, FY),
            Lens::Equidistant(focal) => (focal, focal),
        };
        Pinhole {
            width: WIDTH,
            height: HEIGHT,
            fx: fx * (1.0 + self.focal_ratio),
            fy: fy * (1.0 + self.focal_ratio),
            cx: CX,
            cy: CY,
        }
    }

    /// The stated pose of the camera in the body.
    pub(crate) fn mount(&self) -> Mount {
        let rows = ROTATION_BODY_FROM_CAMERA;
        let mut axes = Matrix3::from_fn(|r, c| rows[r][c]);
        // A product with one would turn zeros into negative zeros.
        if self.mount_yaw_rad != 0.0 {
            axes =
                Rotation3::from_axis_angle(&Vector3::z_axis(), self.mount_yaw_rad).matrix() * axes;
        }
        Mount {
            body_from_camera: Se3::new(
                Rotation3::from_matrix_unchecked(axes),
                POSITION_IN_BODY.into(),
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stated_errors_have_the_chosen_size_and_sign() {
        let wrong = CalibrationError {
            mount_yaw_rad: 0.005,
            focal_ratio: -0.005,
        };
        assert!((wrong.pinhole(Lens::Pinhole).fx / FX - 0.995).abs() < 1e-12);
        assert!((wrong.pinhole(Lens::Pinhole).fy / FY - 0.995).abs() < 1e-12);
        let forward = |mount: Mount| mount.body_from_camera.rotation * Vector3::z();
        let (truth, stated) = (
            forward(CalibrationError::default().mount()),
            forward(wrong.mount()),
        );
        // The camera looks to the left; turned further to the left it looks a little back.
        let angle = truth.cross(&stated);
        assert!((angle - Vector3::new(0.0, 0.0, 0.005_f64.sin())).norm() < 1e-12);
        assert_eq!(
            wrong.mount().body_from_camera.translation,
            CalibrationError::default()
                .mount()
                .body_from_camera
                .translation
        );
    }
}
