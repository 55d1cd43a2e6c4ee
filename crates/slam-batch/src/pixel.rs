//! The factor of a sighting: the pixel of a landmark in a camera, compared where the keypoint was found.
//!
//! A landmark is (u, v, rho) in the camera of its first sighting, its *anchor*: the direction (u, v, 1) and the inverse
//! depth. In another camera at centre c with rotation R it is, up to a factor that no pixel sees,
//!
//! > q = R (m + rho (o - c)),  m = R_anchor^T (u, v, 1),
//!
//! with o the centre of the anchor: regular for landmarks at any distance, and beyond.
//!
//! The noise is that of the raw pixel, so the residual is project(q; theta) - raw over sigma, the lens inside. Its
//! derivative by the calibration theta is taken at the *predicted* pixel. At the measured one it would carry the very
//! noise of the residual; their product does not average out, and the focal length comes out by per cents too large.

use mono_geometry::inverse_depth::turned_camera;
use mono_geometry::{Camera, tilted_body_axes};
use nalgebra::{Matrix2x3, Matrix3, SMatrix, Vector2, Vector3};
use slam_pipeline::keypoint_sigma_px;

use crate::constants::{Constant, Constants};
use crate::error::BatchError;
use crate::problem::Sighting;
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
    axes: Matrix3<f64>,
}

impl View {
    pub(crate) fn new(state: &CameraState, body_from_camera: &Matrix3<f64>) -> Self {
        let body_from_world = state.world_from_body().transpose();
        let camera_from_body = body_from_camera.transpose();
        let camera_from_world = camera_from_body * body_from_world;
        Self {
            centre: state.centre,
            camera_from_world,
            axes: camera_from_world * tilted_body_axes(state.phi, state.pitch),
        }
    }

    /// Derivatives of q = R (m + rho (o - c)) by the pose.
    pub(crate) fn point_by_pose(&self, q: &Vector3<f64>, rho: f64) -> SMatrix<f64, 3, POSE> {
        let mut by = SMatrix::<f64, 3, POSE>::zeros();
        by.fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(self.camera_from_world * -rho));
        by.fixed_view_mut::<3, 3>(0, 3)
            .copy_from(&turned_camera(q, &self.axes));
        by
    }
}

/// A sighting.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen {
    /// Keyframe.
    pub(crate) keyframe: usize,
    /// Where the keypoint was found.
    raw: Vector2<f64>,
    /// The noise of the smallest keypoints over its own.
    precision: f64,
    /// Its direction (X/Z, Y/Z) by the nominal camera, for the start of the landmark.
    pub(crate) direction: Vector2<f64>,
}

impl Seen {
    /// `None` outside the field of the nominal lens.
    pub(crate) fn new(sighting: &Sighting, nominal: &Camera) -> Option<Self> {
        Some(Self {
            keyframe: sighting.keyframe,
            raw: sighting.pixel,
            precision: 1.0 / keypoint_sigma_px(1.0, sighting.size_px),
            direction: nominal.undistort(&sighting.pixel).ok()?,
        })
    }
}

/// The camera as a state calibrates it, with the noise of its pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sensor {
    /// Camera.
    pub(crate) camera: Camera,
    /// Focal lengths of the rig.
    nominal_focal: Vector2<f64>,
    inverse_sigma: f64,
}

impl Sensor {
    /// The sensor of `nominal` under the constants of the calibration.
    ///
    /// # Errors
    /// As [`Camera::with_parameters`].
    pub(crate) fn new(
        nominal: &Camera,
        constants: &Constants,
        sigma_px: f64,
    ) -> Result<Self, BatchError> {
        let pinhole = nominal.pinhole();
        Ok(Self {
            camera: calibrated(nominal, constants)?,
            nominal_focal: Vector2::new(pinhole.fx, pinhole.fy),
            inverse_sigma: 1.0 / sigma_px,
        })
    }

    /// Whitened residual of a point in camera axes; `None` where the camera has no pixel for it.
    #[inline]
    pub(crate) fn residual(&self, seen: &Seen, q: &Vector3<f64>) -> Option<Vector2<f64>> {
        let pixel = self.camera.project(&in_front(q)?)?;
        Some((pixel - seen.raw) * self.inverse_sigma(seen))
    }

    /// [`Self::residual`] with its derivative by the point.
    #[inline]
    pub(crate) fn linearise(
        &self,
        seen: &Seen,
        q: &Vector3<f64>,
    ) -> Option<(Vector2<f64>, Matrix2x3<f64>)> {
        let (pixel, by_point) = self.camera.project_with_jacobian(&in_front(q)?)?;
        let inverse_sigma = self.inverse_sigma(seen);
        Some(((pixel - seen.raw) * inverse_sigma, by_point * inverse_sigma))
    }

    #[inline]
    fn inverse_sigma(&self, seen: &Seen) -> f64 {
        self.inverse_sigma * seen.precision
    }

    /// Derivative of the whitened residual by focal scale, principal point and lens.
    pub(crate) fn by_calibration(
        &self,
        seen: &Seen,
        q: &Vector3<f64>,
    ) -> SMatrix<f64, 2, CALIBRATION> {
        let mut by = SMatrix::<f64, 2, CALIBRATION>::zeros();
        if let Some((_, _, by_parameters)) =
            in_front(q).and_then(|q| self.camera.project_with_jacobians(&q))
        {
            let focal = by_parameters.column(0) * self.nominal_focal.x
                + by_parameters.column(1) * self.nominal_focal.y;
            by.set_column(0, &focal);
            for column in 1..CALIBRATION {
                by.set_column(column, &by_parameters.column(column + 1));
            }
        }
        by * self.inverse_sigma(seen)
    }
}

/// q comes with the length of a direction, about one: what is nearer to the plane of the camera is not seen.
#[inline]
fn in_front(q: &Vector3<f64>) -> Option<Vector3<f64>> {
    (q.z > 1e-3).then_some(*q)
}

/// The camera under the constants of the calibration.
///
/// # Errors
/// As [`Camera::with_parameters`].
fn calibrated(camera: &Camera, constants: &Constants) -> Result<Camera, BatchError> {
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
    use mono_geometry::{Distortion, Mount, Pinhole};

    const SIGMA_PX: f64 = 0.4;
    const RHO: f64 = 0.3;
    const RAW: Vector2<f64> = Vector2::new(120.0, 100.0);

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

    fn point(state: &CameraState) -> (View, Vector3<f64>) {
        let view = View::new(state, Mount::forward().body_from_camera.rotation.matrix());
        let (m, rho) = (Vector3::new(0.8, 0.5, 0.2), RHO);
        let q = view.camera_from_world * (m + (Vector3::new(0.0, 0.1, 0.3) - view.centre) * rho);
        (view, q)
    }

    fn seen() -> Seen {
        let sighting = Sighting {
            keyframe: 0,
            pixel: RAW,
            size_px: 3.0,
        };
        Seen::new(&sighting, &camera()).unwrap()
    }

    fn residual(state: &CameraState, constants: &Constants) -> Vector2<f64> {
        let sensor = Sensor::new(&camera(), constants, SIGMA_PX).unwrap();
        let seen = seen();
        sensor.residual(&seen, &point(state).1).unwrap()
    }

    #[test]
    fn derivatives_are_those_of_finite_differences() {
        let sensor = Sensor::new(&camera(), &Constants::ZERO, SIGMA_PX).unwrap();
        let seen = seen();
        let (view, q) = point(&state());
        let (_, by_point) = sensor.linearise(&seen, &q).unwrap();
        let by_pose = by_point * view.point_by_pose(&q, RHO);
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
                residual(&s, &Constants::ZERO)
            };
            let slope = (at(h) - at(-h)) / (2.0 * h);
            let error = (by_pose.column(axis) - slope).norm();
            assert!(error < 1e-6 * slope.norm().max(1.0), "{axis}: {error}");
        }
        let by_calibration = sensor.by_calibration(&seen, &q);
        for column in 0..CALIBRATION {
            let constant = Constant::ALL[Constant::OF_MOTION + column];
            let at = |h: f64| residual(&state(), &Constants::ZERO.with(constant, h));
            let slope = (at(h) - at(-h)) / (2.0 * h);
            let error = (by_calibration.column(column) - slope).norm();
            assert!(
                error < 1e-6 * slope.norm().max(1.0),
                "{constant:?}: {error}"
            );
        }
    }

    #[test]
    fn the_calibration_is_differentiated_at_the_predicted_pixel() {
        // The wrong form, at the measured one, differs by the residual itself: for the focal length, one to one.
        let sensor = Sensor::new(&camera(), &Constants::ZERO, SIGMA_PX).unwrap();
        let (_, q) = point(&state());
        let seen = seen();
        let n = seen.direction;
        let predicted = sensor.by_calibration(&seen, &q);
        let measured = sensor.by_calibration(&seen, &Vector3::new(n.x, n.y, 1.0));
        let residual = residual(&state(), &Constants::ZERO);
        assert!(residual.norm() > 10.0, "the case is one with a residual");
        let difference = predicted.column(0) - measured.column(0);
        assert!((difference - residual).norm() < 1e-9 * residual.norm());
    }
}
