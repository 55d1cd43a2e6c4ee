//! The factor of a sighting: the pixel of a landmark in a camera, whitened where the keypoint was found.
//!
//! A landmark is (u, v, rho) in the camera of its first sighting, its *anchor*: the direction (u, v, 1) and the inverse
//! depth. In another camera at centre c with rotation R it is, up to a factor that no pixel sees,
//!
//! > q = R (m + rho (o - c)),  m = R_anchor^T (u, v, 1),
//!
//! with o the centre of the anchor: regular for landmarks at any distance, and beyond.
//!
//! The noise is that of the raw pixel, so a residual in ideal pixels is whitened by d raw / d ideal over sigma. The
//! calibration moves the *measured* ideal pixel, not the projection: with raw = project(n; theta) held fixed,
//! dn = -F^-1 P dtheta, F = d raw / d n, P = d raw / d theta, and the whitened residual moves by P / sigma.

use mono_geometry::{Camera, Pinhole};
use nalgebra::{Matrix2, Matrix2x3, Matrix3, SMatrix, Vector2, Vector3};

use crate::constants::{Constant, Constants};
use crate::error::BatchError;
use crate::state::{CameraState, POSE};

/// Constants that move the pixels.
pub(crate) const CALIBRATION: usize = Constant::COUNT - Constant::OF_MOTION;

/// Residual (sigmas) that a landmark behind a camera counts: nothing larger is a measurement.
pub(crate) const BEHIND_SIGMAS: f64 = 200.0;

/// A camera at a keyframe, ready to project and to be differentiated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View {
    /// Centre, unit of the map.
    pub(crate) centre: Vector3<f64>,
    /// Rotation from world to camera axes.
    pub(crate) camera_from_world: Matrix3<f64>,
    /// Axes about which heading, roll and pitch turn, in camera axes.
    axes: [Vector3<f64>; 3],
}

impl View {
    pub(crate) fn new(state: &CameraState, body_from_camera: &Matrix3<f64>) -> Self {
        let body_from_world = state.world_from_body().transpose();
        let camera_from_body = body_from_camera.transpose();
        let (sin, cos) = state.roll.sin_cos();
        Self {
            centre: state.centre,
            camera_from_world: camera_from_body * body_from_world,
            axes: [
                camera_from_body * body_from_world.column(2),
                camera_from_body * Vector3::x(),
                camera_from_body * Vector3::new(0.0, cos, -sin),
            ],
        }
    }

    /// Derivatives of q = R (m + rho (o - c)) by the pose.
    pub(crate) fn point_by_pose(&self, q: &Vector3<f64>, rho: f64) -> SMatrix<f64, 3, POSE> {
        let mut by = SMatrix::<f64, 3, POSE>::zeros();
        by.fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(self.camera_from_world * -rho));
        for (column, axis) in self.axes.iter().enumerate() {
            by.set_column(3 + column, &q.cross(axis));
        }
        by
    }
}

/// A sighting with the lens taken out.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen {
    /// Keyframe.
    pub(crate) keyframe: usize,
    /// Ideal pixel of the nominal pinhole.
    pub(crate) ideal: Vector2<f64>,
    /// d raw / d ideal over sigma.
    pub(crate) whiten: Matrix2<f64>,
    /// Derivative of the whitened residual by focal scale, principal point and lens.
    pub(crate) by_calibration: SMatrix<f64, 2, CALIBRATION>,
}

impl Seen {
    /// Undistorts a raw pixel by `camera`; ideal pixels are those of `nominal`. `None` outside the field of the lens.
    pub(crate) fn new(
        keyframe: usize,
        raw: &Vector2<f64>,
        camera: &Camera,
        nominal: &Pinhole,
        sigma_px: f64,
    ) -> Option<Self> {
        let normalized = camera.undistort(raw).ok()?;
        let (_, by_point, by_parameters) =
            camera.project_with_jacobians(&Vector3::new(normalized.x, normalized.y, 1.0))?;
        let ideal_scale = Matrix2::new(1.0 / nominal.fx, 0.0, 0.0, 1.0 / nominal.fy);
        let mut by_calibration = SMatrix::<f64, 2, CALIBRATION>::zeros();
        let focal = by_parameters.column(0) * nominal.fx + by_parameters.column(1) * nominal.fy;
        by_calibration.set_column(0, &focal);
        for column in 1..CALIBRATION {
            by_calibration.set_column(column, &by_parameters.column(column + 1));
        }
        Some(Self {
            keyframe,
            ideal: nominal.pixel(&normalized),
            whiten: by_point.fixed_view::<2, 2>(0, 0) * ideal_scale / sigma_px,
            by_calibration: by_calibration / sigma_px,
        })
    }

    /// Whitened residual of a point in camera axes; `None` behind the camera.
    #[inline]
    pub(crate) fn residual(&self, pinhole: &Pinhole, q: &Vector3<f64>) -> Option<Vector2<f64>> {
        // q comes with the length of a direction, about one.
        if !(q.z > 1e-3) {
            return None;
        }
        let pixel = pinhole.pixel(&Vector2::new(q.x / q.z, q.y / q.z));
        Some(self.whiten * (pixel - self.ideal))
    }

    /// [`Self::residual`] with its derivative by the point.
    #[inline]
    pub(crate) fn linearise(
        &self,
        pinhole: &Pinhole,
        q: &Vector3<f64>,
    ) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        let residual = self.residual(pinhole, q)?;
        let (fx, fy) = (pinhole.fx / q.z, pinhole.fy / q.z);
        let by_point = Matrix2x3::new(fx, 0.0, -fx * q.x / q.z, 0.0, fy, -fy * q.y / q.z);
        Some((residual, self.whiten * by_point))
    }
}

/// The camera under the constants of the calibration.
///
/// # Errors
/// As [`Camera::with_parameters`].
pub(crate) fn calibrated(camera: &Camera, constants: &Constants) -> Result<Camera, BatchError> {
    let mut parameters = camera.parameters();
    parameters[0] *= 1.0 + constants[Constant::FocalScale];
    parameters[1] *= 1.0 + constants[Constant::FocalScale];
    parameters[2] += constants[Constant::PrincipalX];
    parameters[3] += constants[Constant::PrincipalY];
    if parameters.len() > 4 {
        parameters[4] += constants[Constant::Lens];
    }
    Ok(camera.with_parameters(parameters.as_slice())?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use mono_geometry::{Distortion, Mount};

    const SIGMA_PX: f64 = 0.4;

    fn camera() -> Camera {
        let pinhole = Pinhole {
            width: 320,
            height: 240,
            fx: 300.0,
            fy: 310.0,
            cx: 161.0,
            cy: 119.0,
        };
        let lens = Distortion::Radtan {
            k1: -0.2,
            k2: 0.05,
            p1: 0.001,
            p2: -0.002,
            k3: 0.0,
        };
        Camera::new(pinhole, lens).unwrap()
    }

    fn state() -> CameraState {
        CameraState {
            centre: Vector3::new(0.3, -0.2, 0.4),
            phi: 0.5,
            roll: 0.1,
            pitch: -0.15,
        }
    }

    fn residual(
        state: &CameraState,
        m: &Vector3<f64>,
        rho: f64,
        camera: &Camera,
        raw: &Vector2<f64>,
    ) -> Vector2<f64> {
        let nominal = *self::camera().pinhole();
        let view = View::new(state, Mount::forward().body_from_camera.rotation.matrix());
        let q = view.camera_from_world * (m + (Vector3::new(0.0, 0.1, 0.3) - view.centre) * rho);
        Seen::new(0, raw, camera, &nominal, SIGMA_PX)
            .unwrap()
            .residual(&nominal, &q)
            .unwrap()
    }

    #[test]
    fn derivatives_are_those_of_finite_differences() {
        let (m, rho) = (Vector3::new(0.8, 0.5, 0.2), 0.3);
        let raw = Vector2::new(120.0, 100.0);
        let nominal = *camera().pinhole();
        let view = View::new(
            &state(),
            Mount::forward().body_from_camera.rotation.matrix(),
        );
        let q = view.camera_from_world * (m + (Vector3::new(0.0, 0.1, 0.3) - view.centre) * rho);
        let seen = Seen::new(0, &raw, &camera(), &nominal, SIGMA_PX).unwrap();
        let (_, by_point) = seen.linearise(&nominal, &q).unwrap();
        let by_pose = by_point * view.point_by_pose(&q, rho);
        let h = 1e-6;
        for axis in 0..POSE {
            let at = |h: f64| {
                let mut s = state();
                match axis {
                    0..3 => s.centre[axis] += h,
                    3 => s.phi += h,
                    4 => s.roll += h,
                    _ => s.pitch += h,
                }
                residual(&s, &m, rho, &camera(), &raw)
            };
            let slope = (at(h) - at(-h)) / (2.0 * h);
            let error = (by_pose.column(axis) - slope).norm();
            assert!(error < 1e-5 * slope.norm().max(1.0), "{axis}: {error}");
        }
    }

    #[test]
    fn the_calibration_moves_the_residual_as_finite_differences_say() {
        let (m, rho) = (Vector3::new(0.8, 0.5, 0.2), 0.3);
        let raw = Vector2::new(40.0, 30.0);
        let nominal = *camera().pinhole();
        let q = {
            let view = View::new(
                &state(),
                Mount::forward().body_from_camera.rotation.matrix(),
            );
            view.camera_from_world * (m + (Vector3::new(0.0, 0.1, 0.3) - view.centre) * rho)
        };
        // Near its own pixel the whitening does not matter; far from it the residual is whitened anew, by no more
        // than its own size times the bend of the lens.
        let raw_of_q = camera().project(&q).unwrap();
        let seen = Seen::new(0, &raw_of_q, &camera(), &nominal, SIGMA_PX).unwrap();
        for column in 0..CALIBRATION {
            let constant = Constant::ALL[Constant::OF_MOTION + column];
            let h = 1e-5;
            let at = |h: f64| {
                let camera = calibrated(&camera(), &Constants::ZERO.with(constant, h)).unwrap();
                residual(&state(), &m, rho, &camera, &raw_of_q)
            };
            let slope = (at(h) - at(-h)) / (2.0 * h);
            let error = (seen.by_calibration.column(column) - slope).norm();
            assert!(
                error < 1e-4 * slope.norm().max(1.0),
                "{constant:?}: {error} of {slope}"
            );
        }
        assert!((raw - raw_of_q).norm() > 1.0);
    }

    #[test]
    fn whitening_is_that_of_the_raw_pixel() {
        // One raw pixel of shift is 1 / sigma, wherever the lens stretches the ideal ones.
        let nominal = *camera().pinhole();
        let raw = Vector2::new(15.0, 20.0);
        let seen = Seen::new(0, &raw, &camera(), &nominal, SIGMA_PX).unwrap();
        let moved = Seen::new(
            0,
            &(raw + Vector2::new(1e-3, 0.0)),
            &camera(),
            &nominal,
            SIGMA_PX,
        );
        let shift = moved.unwrap().ideal - seen.ideal;
        assert!(((seen.whiten * shift).norm() * SIGMA_PX / 1e-3 - 1.0).abs() < 1e-4);
        // In ideal pixels it is another length.
        assert!((shift.norm() / 1e-3 - 1.0).abs() > 0.05);
    }
}
