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

use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};

use crate::camera::Pinhole;
use crate::placed_camera::PlacedCamera;

/// Smallest depth of a direction that is visible, as a share of its largest coordinate.
const HORIZON: f64 = 1e-3;

/// Squared length, (pixels per inverse depth)^2, below which depth moves no pixel: there is no baseline.
const NO_PARALLAX: f64 = 1e-18;

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
        if in_camera.z <= HORIZON * direction.amax() {
            return None;
        }
        Some(in_camera)
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
        let in_camera = self.ray(parameters).in_camera(camera)?;
        let by_parameters = match self {
            Self::InverseDepth { anchor } => {
                let camera_from_anchor =
                    camera.camera_from_world * anchor.camera_from_world.transpose();
                let baseline = camera.camera_from_world * (anchor.centre - camera.centre);
                Matrix3::from_columns(&[
                    camera_from_anchor.column(0).into_owned(),
                    camera_from_anchor.column(1).into_owned(),
                    baseline,
                ])
            }
            Self::Point => camera.camera_from_world,
        };
        Some(pixel_by_direction(pinhole, &in_camera) * by_parameters)
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
        let Some(jacobian) = self.parameter_jacobian(pinhole, camera, parameters) else {
            return *parameters;
        };
        let along = jacobian.column(2).into_owned();
        if along.norm_squared() < NO_PARALLAX {
            return *parameters;
        }
        let ray = self.ray(parameters);
        let b = camera.camera_from_world * ray.base;
        let t = camera.camera_from_world * (ray.origin - camera.centre);
        let weighted = along.component_mul(&Vector2::new(pinhole.fx, pinhole.fy));
        let s = along.dot(&(pixel - Vector2::new(pinhole.cx, pinhole.cy)));
        let denominator = weighted.dot(&t.xy()) - s * t.z;
        let rho = (s * b.z - weighted.dot(&b.xy())) / denominator;
        if !rho.is_finite() {
            return *parameters;
        }
        let highest = highest.max(0.0);
        let at = |rho: f64| Vector3::new(parameters.x, parameters.y, rho);
        let seen = |m: &Vector3<f64>| self.ray(m).project(pinhole, camera);
        if (0.0..=highest).contains(&rho) && seen(&at(rho)).is_some() {
            return at(rho);
        }
        // Beyond an end of the line the nearest is an end, but not always that of the nearer rho: past the epipole rho
        // comes round from the other side of infinity.
        [at(0.0), at(highest)]
            .into_iter()
            .filter_map(|m| Some(((seen(&m)? - pixel).norm_squared(), m)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            // Never behind the camera.
            .map_or(*parameters, |(_, m)| m)
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

/// Derivative of the ideal pixel with respect to a direction in camera axes (2x3).
#[inline]
pub(super) fn pixel_by_direction(pinhole: &Pinhole, in_camera: &Vector3<f64>) -> Matrix2x3<f64> {
    let inverse = 1.0 / in_camera.z;
    Matrix2x3::new(
        pinhole.fx * inverse,
        0.0,
        -pinhole.fx * in_camera.x * inverse * inverse,
        0.0,
        pinhole.fy * inverse,
        -pinhole.fy * in_camera.y * inverse * inverse,
    )
}

#[cfg(test)]
mod tests;
