//! The paper's camera and how it sits on the robot.
//!
//! Pinhole with Table I: u = `fx` X/Z + `cx`, v = `fy` Y/Z + `cy`; camera axes x right,
//! y down, z forward; pixel (0, 0) is the centre of the top-left pixel.
//! The mount is `theta_cr` = 90 degrees, taken as looking to the robot's left, so
//! that a robot driving forward sees the wall move to the left of the image.
//! `X_cr` and `Z_cr` are read as the camera's offset to the right of and ahead of
//! the turning centre; the height above the floor is ours.

use estimation_base::Se2;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// Table I: focal length along the rows, pixels.
pub(crate) const FX: f64 = 368.82620;
/// Table I: focal length along the columns, pixels.
pub(crate) const FY: f64 = 369.90239;
/// Table I: column of the principal point.
pub(crate) const CX: f64 = 159.67029;
/// Table I: row of the principal point.
pub(crate) const CY: f64 = 121.54136;
/// Image width in pixels.
pub(crate) const WIDTH: usize = 320;
/// Image height in pixels.
pub(crate) const HEIGHT: usize = 240;
/// Camera in the body, metres: `Z_cr` ahead, `X_cr` to the right, 0.9 m up.
pub(crate) const POSITION_IN_BODY: [f64; 3] = [0.100_174_2, -0.002_103_9, 0.9];
/// Rows of the rotation whose columns are the camera's axes in body axes.
pub(crate) const ROTATION_BODY_FROM_CAMERA: [[f64; 3]; 3] =
    [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]];
/// Nearest depth that still projects, metres.
const NEAREST_M: f64 = 1e-6;

/// Pose of the camera in the body.
pub(crate) fn body_from_camera() -> Isometry3<f64> {
    let rows = ROTATION_BODY_FROM_CAMERA;
    let matrix = Matrix3::from_fn(|r, c| rows[r][c]);
    let [x, y, z] = POSITION_IN_BODY;
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix)),
    )
}

/// Height and tilt of the body above its planar pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Attitude {
    /// Height of the body origin, metres.
    pub(crate) height_m: f64,
    /// Turn about the body's forward axis, radians; positive lifts the left side.
    pub(crate) roll_rad: f64,
    /// Turn about the body's left axis, radians; positive lowers the nose.
    pub(crate) pitch_rad: f64,
}

#[cfg(test)]
impl Attitude {
    /// On the floor, upright.
    pub(crate) const LEVEL: Self = Self {
        height_m: 0.0,
        roll_rad: 0.0,
        pitch_rad: 0.0,
    };
}

/// Pose of the camera in the world for a planar pose of the body and its attitude.
///
/// The body's rotation is heading, then pitch, then roll: `Rz(phi) Ry(pitch) Rx(roll)`.
pub(crate) fn world_from_camera(body: &Se2, attitude: &Attitude) -> Isometry3<f64> {
    let heading = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), body.phi);
    let rotation = if attitude.roll_rad == 0.0 && attitude.pitch_rad == 0.0 {
        heading
    } else {
        heading * UnitQuaternion::from_euler_angles(attitude.roll_rad, attitude.pitch_rad, 0.0)
    };
    let world_from_body = Isometry3::from_parts(
        Translation3::new(body.x, body.y, attitude.height_m),
        rotation,
    );
    world_from_body * body_from_camera()
}

/// How directions become pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Lens {
    /// Table I: in proportion to the tangent of the angle off the axis.
    Pinhole,
    /// An equidistant fisheye of this focal length in pixels: in proportion to the angle itself.
    Equidistant(f64),
}

impl Lens {
    /// Pixel of a point in camera axes; `None` when it is not in front.
    pub(crate) fn project(self, point: &Point3<f64>) -> Option<[f64; 2]> {
        (point.z > NEAREST_M).then(|| match self {
            Self::Pinhole => [FX * point.x / point.z + CX, FY * point.y / point.z + CY],
            Self::Equidistant(focal) => {
                let off_axis = point.x.hypot(point.y);
                let ratio = if off_axis > 0.0 {
                    focal * off_axis.atan2(point.z) / off_axis
                } else {
                    0.0
                };
                [ratio * point.x + CX, ratio * point.y + CY]
            }
        })
    }

    /// Direction in camera axes seen at a pixel, scaled to unit depth (z = 1).
    pub(crate) fn ray(self, u: f64, v: f64) -> Vector3<f64> {
        match self {
            Self::Pinhole => ray(u, v),
            Self::Equidistant(focal) => {
                let (x, y) = (u - CX, v - CY);
                let radius = x.hypot(y);
                let ratio = if radius > 0.0 {
                    (radius / focal).tan() / radius
                } else {
                    1.0 / focal
                };
                Vector3::new(ratio * x, ratio * y, 1.0)
            }
        }
    }
}

/// Direction in camera axes that the pinhole sees at a pixel, scaled to unit depth (z = 1).
pub(crate) fn ray(u: f64, v: f64) -> Vector3<f64> {
    Vector3::new((u - CX) / FX, (v - CY) / FY, 1.0)
}

/// Whether a pixel position lies on the image.
pub(crate) fn on_image(u: f64, v: f64) -> bool {
    (-0.5..WIDTH as f64 - 0.5).contains(&u) && (-0.5..HEIGHT as f64 - 0.5).contains(&v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_point_lands_where_table_one_says() {
        // 2 m to the left of the camera, 0.5 m ahead of it and 0.25 m above it.
        let body = Se2 {
            x: 0.0,
            y: 0.0,
            phi: 0.0,
        };
        let [x, y, z] = POSITION_IN_BODY;
        let point = Point3::new(x + 0.5, y + 2.0, z + 0.25);
        let [u, v] = Lens::Pinhole
            .project(&(world_from_camera(&body, &Attitude::LEVEL).inverse() * point))
            .unwrap();
        assert!((u - (CX + FX * 0.25)).abs() < 1e-9, "{u}");
        assert!((v - (CY - FY * 0.125)).abs() < 1e-9, "{v}");
    }

    #[test]
    fn camera_looks_left_whatever_the_heading() {
        let body = Se2 {
            x: 3.0,
            y: -1.0,
            phi: 0.7,
        };
        let forward = world_from_camera(&body, &Attitude::LEVEL) * Vector3::z();
        let left = Vector3::new(-(0.7_f64.sin()), 0.7_f64.cos(), 0.0);
        assert!((forward - left).norm() < 1e-12);
    }

    #[test]
    fn a_body_that_lifts_its_left_side_looks_up_and_one_that_lifts_its_nose_moves_the_camera_back()
    {
        let body = Se2 {
            x: 0.0,
            y: 0.0,
            phi: 0.0,
        };
        let at = |roll_rad, pitch_rad| {
            let attitude = Attitude {
                height_m: 0.2,
                roll_rad,
                pitch_rad,
            };
            world_from_camera(&body, &attitude)
        };
        // Left side up: the camera looks up by the same angle.
        let forward = at(0.01, 0.0) * Vector3::z();
        assert!((forward - Vector3::new(0.0, 0.01_f64.cos(), 0.01_f64.sin())).norm() < 1e-12);
        // Nose up: the camera, 0.9 m above the floor, goes back by 0.9 m times the angle.
        let level = at(0.0, 0.0).translation.vector;
        let back = at(0.0, -0.01).translation.vector - level;
        assert!((level.z - 1.1).abs() < 1e-12);
        assert!((back.x + 0.9 * 0.01).abs() < 1e-4 && back.z > 0.0, "{back}");
    }

    #[test]
    fn ray_and_projection_are_inverse() {
        for lens in [Lens::Pinhole, Lens::Equidistant(150.0)] {
            for (u, v) in [(0.0, 0.0), (319.0, 239.0), (12.5, 200.25), (CX, CY)] {
                let [pu, pv] = lens.project(&Point3::from(lens.ray(u, v) * 1.7)).unwrap();
                assert!((pu - u).abs() < 1e-10 && (pv - v).abs() < 1e-10);
            }
            assert!(lens.project(&Point3::new(0.0, 0.0, -1.0)).is_none());
        }
    }

    #[test]
    fn a_fisheye_spends_as_many_pixels_on_every_degree() {
        let lens = Lens::Equidistant(150.0);
        for degrees in [1.0, 30.0, 60.0] {
            let angle = f64::to_radians(degrees);
            let seen = Point3::new(angle.sin(), 0.0, angle.cos());
            let [u, v] = lens.project(&seen).unwrap();
            assert!((u - CX - 150.0 * angle).abs() < 1e-10 && v == CY);
        }
    }
}
