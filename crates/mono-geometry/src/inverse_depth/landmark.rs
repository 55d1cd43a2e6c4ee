//! Three numbers of a landmark and the pixel they predict: anchored inverse depth, or a Euclidean point.
//!
//! Both forms give the direction from a camera centre c to the landmark up to a positive factor, linear in the third
//! parameter:
//!
//! - anchored inverse depth (alpha, beta, rho): R_a^T (alpha, beta, 1)^T + rho (c_a - c), with R_a = anchor_from_world
//!   and c_a the anchor's centre;
//! - Euclidean point X = (X, Y, Z): X - c.
//!
//! [`Ray`] is that direction for any c, so one projection serves both forms, and a landmark at infinity (rho = 0) is no
//! special case. A filter keeps the three numbers and their covariance, and takes from here the prediction
//! ([`Ray::project`]), its Jacobian ([`LandmarkGeometry::parameter_jacobian`]), the place to linearise an open depth
//! ([`LandmarkGeometry::refocus`]), the start ([`first_sighting`]) and the point in the world
//! ([`LandmarkGeometry::to_point`]).
//!
//! Degenerate: a direction within a thousandth of the image plane projects thousands of pixels away and counts as not
//! visible. At the anchor itself rho has no effect on the pixel: its column of the Jacobian is zero.
//!
//! Source: Civera, Davison and Montiel (2008), with the anchor's pose known.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};

use super::pixel::in_front;
use super::view::LandmarkView;
use crate::camera::Pinhole;
use crate::placed_camera::PlacedCamera;

/// How the three numbers of a landmark are read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LandmarkGeometry {
    /// (alpha, beta, rho) in this camera: normalised image coordinates and inverse depth (one over the length unit).
    InverseDepth {
        /// The camera that saw the landmark first.
        anchor: PlacedCamera,
    },
    /// (X, Y, Z) in the world.
    Point,
}

/// The direction to a landmark from any centre c: `base + rate (origin - c)`, world axes, of no particular length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// The part that does not depend on c.
    pub base: Vector3<f64>,
    /// Factor of the baseline.
    pub rate: f64,
    /// Centre from which the baseline is counted.
    pub origin: Vector3<f64>,
}

impl Ray {
    /// Ideal pixel in a camera; `None` behind the camera or within a thousandth of its image plane. O(1).
    #[must_use]
    #[inline]
    pub fn project(&self, pinhole: &Pinhole, camera: &PlacedCamera) -> Option<Vector2<f64>> {
        let in_camera = self.in_camera(camera)?;
        Some(Vector2::new(
            pinhole.fx * in_camera.x / in_camera.z + pinhole.cx,
            pinhole.fy * in_camera.y / in_camera.z + pinhole.cy,
        ))
    }

    /// The direction in the camera's axes, if it is visible.
    #[inline]
    fn in_camera(&self, camera: &PlacedCamera) -> Option<Vector3<f64>> {
        let direction = self.base + (self.origin - camera.centre) * self.rate;
        let in_camera = camera.camera_from_world * direction;
        in_front(&in_camera).then_some(in_camera)
    }
}

impl LandmarkGeometry {
    /// The camera in which the landmark is anchored; `None` for a point.
    #[must_use]
    pub fn anchor(&self) -> Option<&PlacedCamera> {
        match self {
            Self::InverseDepth { anchor } => Some(anchor),
            Self::Point => None,
        }
    }

    /// The ray of three parameters. O(1).
    #[must_use]
    #[inline]
    pub fn ray(&self, parameters: &Vector3<f64>) -> Ray {
        match self {
            Self::InverseDepth { anchor } => Ray {
                base: anchor.camera_from_world.tr_mul(&Vector3::new(
                    parameters.x,
                    parameters.y,
                    1.0,
                )),
                rate: parameters.z,
                origin: anchor.centre,
            },
            Self::Point => Ray {
                base: Vector3::zeros(),
                rate: 1.0,
                origin: *parameters,
            },
        }
    }

    /// The landmarks of this geometry as `camera` sees them. O(1).
    #[must_use]
    #[inline]
    pub fn view(&self, camera: &PlacedCamera) -> LandmarkView {
        match self {
            Self::InverseDepth { anchor } => {
                let camera_from_anchor =
                    camera.camera_from_world * anchor.camera_from_world.transpose();
                let baseline = camera.camera_from_world * (anchor.centre - camera.centre);
                LandmarkView {
                    offset: camera_from_anchor.column(2).into_owned(),
                    by_parameters: Matrix3::from_columns(&[
                        camera_from_anchor.column(0).into_owned(),
                        camera_from_anchor.column(1).into_owned(),
                        baseline,
                    ]),
                }
            }
            Self::Point => LandmarkView {
                offset: -(camera.camera_from_world * camera.centre),
                by_parameters: camera.camera_from_world,
            },
        }
    }

    /// Derivative of the ideal pixel with respect to the three parameters (2x3, pixels per unit of each); `None` where
    /// [`Ray::project`] has no pixel. O(1).
    #[must_use]
    #[inline]
    pub fn parameter_jacobian(
        &self,
        pinhole: &Pinhole,
        camera: &PlacedCamera,
        parameters: &Vector3<f64>,
    ) -> Option<Matrix2x3<f64>> {
        self.view(camera).jacobian(pinhole, parameters)
    }

    /// `parameters` with the inverse depth at which the landmark projects nearest to `pixel` along its epipolar line,
    /// kept within [0, `highest`]. A point, or a landmark without a baseline, is returned as it is. O(1).
    ///
    /// A slope taken at a prior depth is wrong by the distance along the line times its rotation, so an open depth is
    /// linearised where it was seen. With q(rho) = b + rho t in camera axes, e along the line and s = e^T (z - c):
    /// rho = (s b_z - e^T f b) / (e^T f t - s t_z).
    #[must_use]
    pub fn refocus(
        &self,
        pinhole: &Pinhole,
        camera: &PlacedCamera,
        parameters: &Vector3<f64>,
        pixel: &Vector2<f64>,
        highest: f64,
    ) -> Vector3<f64> {
        if self.anchor().is_none() {
            return *parameters;
        }
        self.view(camera)
            .refocus(pinhole, parameters, pixel, highest)
    }

    /// Point in the world and its covariance (length unit, squared) by first-order propagation; `None` unless the
    /// depth is positive. O(1).
    ///
    /// The Gaussian in the world is honest only for a small uncertainty of the depth; see
    /// [`super::InverseDepthPoint::linearity_index`].
    #[must_use]
    pub fn to_point(
        &self,
        parameters: &Vector3<f64>,
        covariance: &Matrix3<f64>,
    ) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let Self::InverseDepth { anchor } = self else {
            return Some((*parameters, *covariance));
        };
        let rho = parameters.z;
        if rho <= 0.0 {
            return None;
        }
        let world_from_anchor = anchor.camera_from_world.transpose();
        let ray = Vector3::new(parameters.x, parameters.y, 1.0);
        let jacobian = world_from_anchor
            * Matrix3::from_columns(&[Vector3::x() / rho, Vector3::y() / rho, -ray / (rho * rho)]);
        Some((
            anchor.centre + world_from_anchor * ray / rho,
            jacobian * covariance * jacobian.transpose(),
        ))
    }
}

/// Mean and covariance of (alpha, beta, rho) after one sighting at an ideal pixel: pixel noise on the ray, a prior of
/// mean `rho` and standard deviation `sigma_rho` (one over the length unit) on the inverse depth. O(1).
#[must_use]
pub fn first_sighting(
    pinhole: &Pinhole,
    pixel_ideal: &Vector2<f64>,
    sigma_px: f64,
    rho: f64,
    sigma_rho: f64,
) -> (Vector3<f64>, Matrix3<f64>) {
    let normalized = pinhole.normalize(pixel_ideal);
    let (x, y) = (sigma_px / pinhole.fx, sigma_px / pinhole.fy);
    (
        Vector3::new(normalized.x, normalized.y, rho),
        Matrix3::from_diagonal(&Vector3::new(x * x, y * y, sigma_rho * sigma_rho)),
    )
}

/// [`first_sighting`] at a pixel of any covariance (2x2, pixels squared), such as one behind a lens has
/// ([`crate::Camera::undistort_with_covariance`]); of one that is round, the same bit for bit. O(1).
#[must_use]
pub fn first_sighting_with_covariance(
    pinhole: &Pinhole,
    pixel_ideal: &Vector2<f64>,
    covariance_px2: &Matrix2<f64>,
    rho: f64,
    sigma_rho: f64,
) -> (Vector3<f64>, Matrix3<f64>) {
    let (mean, mut covariance) = first_sighting(pinhole, pixel_ideal, 0.0, rho, sigma_rho);
    let x = covariance_px2[(0, 0)].sqrt() / pinhole.fx;
    let y = covariance_px2[(1, 1)].sqrt() / pinhole.fy;
    let across = covariance_px2[(1, 0)] / (pinhole.fx * pinhole.fy);
    covariance
        .fixed_view_mut::<2, 2>(0, 0)
        .copy_from(&Matrix2::new(x * x, across, across, y * y));
    (mean, covariance)
}

#[cfg(test)]
mod tests;
