//! A landmark as one camera sees it.
//!
//! Both forms of a landmark give the direction from a camera, in the camera's axes, as an affine function of the three
//! parameters m: q = o + B m, with
//!
//! - anchored inverse depth: o = R_ka e_z and B = (R_ka e_x, R_ka e_y, R_k (c_a - c_k)), where R_ka = R_k R_a^T;
//! - Euclidean point: o = -R_k c_k and B = R_k.
//!
//! All landmarks of an anchor share o and B, and every sigma point, slope and search along the epipolar line of one of them
//! costs no more than the division of the pixel.

use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};

use super::pixel::{in_front, pixel_by_direction};
use crate::camera::Pinhole;

/// Squared length, (pixels per inverse depth)^2, below which depth moves no pixel: there is no baseline.
const NO_PARALLAX: f64 = 1e-18;

/// The direction to a landmark in the axes of one camera, affine in its three parameters; of no particular length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LandmarkView {
    /// The part that does not depend on the parameters.
    pub offset: Vector3<f64>,
    /// Derivative by the three parameters.
    pub by_parameters: Matrix3<f64>,
}

impl LandmarkView {
    /// The direction of three parameters, in camera axes. O(1).
    #[must_use]
    #[inline]
    pub fn direction(&self, parameters: &Vector3<f64>) -> Vector3<f64> {
        self.offset + self.by_parameters * parameters
    }

    /// Ideal pixel; `None` behind the camera or within a thousandth of its image plane. O(1).
    #[must_use]
    #[inline]
    pub fn project(&self, pinhole: &Pinhole, parameters: &Vector3<f64>) -> Option<Vector2<f64>> {
        let q = self.direction(parameters);
        in_front(&q).then(|| {
            Vector2::new(
                pinhole.fx * q.x / q.z + pinhole.cx,
                pinhole.fy * q.y / q.z + pinhole.cy,
            )
        })
    }

    /// Derivative of the ideal pixel with respect to the three parameters; `None` where there is no pixel. O(1).
    #[must_use]
    #[inline]
    pub fn jacobian(&self, pinhole: &Pinhole, parameters: &Vector3<f64>) -> Option<Matrix2x3<f64>> {
        let q = self.direction(parameters);
        in_front(&q).then(|| pixel_by_direction(pinhole, &q) * self.by_parameters)
    }

    /// `parameters` with the third one at which the landmark projects nearest to `pixel` along its epipolar line, kept
    /// within [0, `highest`]: see [`LandmarkGeometry::refocus`](super::LandmarkGeometry::refocus). Without a baseline they are returned as they are. O(1).
    #[must_use]
    pub fn refocus(
        &self,
        pinhole: &Pinhole,
        parameters: &Vector3<f64>,
        pixel: &Vector2<f64>,
        highest: f64,
    ) -> Vector3<f64> {
        let Some(jacobian) = self.jacobian(pinhole, parameters) else {
            return *parameters;
        };
        let along = jacobian.column(2).into_owned();
        if along.norm_squared() < NO_PARALLAX {
            return *parameters;
        }
        let at = |rho: f64| Vector3::new(parameters.x, parameters.y, rho);
        let b = self.direction(&at(0.0));
        let t = self.by_parameters.column(2);
        let weighted = along.component_mul(&Vector2::new(pinhole.fx, pinhole.fy));
        let s = along.dot(&(pixel - Vector2::new(pinhole.cx, pinhole.cy)));
        let denominator = weighted.dot(&t.xy()) - s * t.z;
        let rho = (s * b.z - weighted.dot(&b.xy())) / denominator;
        if !rho.is_finite() {
            return *parameters;
        }
        let highest = highest.max(0.0);
        if (0.0..=highest).contains(&rho) && self.project(pinhole, &at(rho)).is_some() {
            return at(rho);
        }
        // Beyond an end of the line the nearest is an end, but not always that of the nearer rho: past the epipole rho
        // comes round from the other side of infinity.
        [at(0.0), at(highest)]
            .into_iter()
            .filter_map(|m| Some(((self.project(pinhole, &m)? - pixel).norm_squared(), m)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            // Never behind the camera.
            .map_or(*parameters, |(_, m)| m)
    }
}
