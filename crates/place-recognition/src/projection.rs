//! How well a pose explains a match, with the uncertainty of the landmark projected into the image.
//!
//! Equation: with e the reprojection error and J the 2 x 3 Jacobian of the pixel by the landmark, both in units of the pixel's
//! noise ([`NoiseShape`]: what a lens makes of it), P the covariance of the landmark, S = I + J P J^T, the score of a match is
//! e^T S^-1 e + ln(det S): minus twice the log likelihood, up to a constant, against that of an exact landmark met exactly.
//!
//! The determinant matters. Without it a pose close to badly known landmarks explains every keypoint, because there each of
//! them could be anywhere. With it a landmark whose projection is known to about ten sigma in both directions is no
//! evidence, however well it fits.
//!
//! Once the pose is found, e^T S^-1 e alone decides about an inlier, so that their sum is a chi-square; a landmark whose
//! determinant alone is above the threshold stays out.
//!
//! J is taken at the estimate of the landmark (first order): good while the depth is known to about a third.

use mono_geometry::{Pinhole, Se3};
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

use crate::point_match::PointMatch;

/// A reprojection error with its covariance, in units of the noise of the pixel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Residual {
    /// Pixel seen minus pixel projected.
    pub(crate) error: Vector2<f64>,
    /// S.
    pub(crate) covariance: Matrix2<f64>,
    /// Derivative of the projection by the point in camera axes.
    pub(crate) by_camera_point: Matrix2x3<f64>,
    /// The pixel projected, in ideal pixels.
    pub(crate) projected: Vector2<f64>,
}

impl Residual {
    /// e^T S^-1 e and ln(det S).
    pub(crate) fn terms(&self) -> (f64, f64) {
        let s = &self.covariance;
        let determinant = s[(0, 0)] * s[(1, 1)] - s[(0, 1)] * s[(0, 1)];
        let e = &self.error;
        let square = (s[(1, 1)] * e.x * e.x - 2.0 * s[(0, 1)] * e.x * e.y + s[(0, 0)] * e.y * e.y)
            / determinant;
        (square, determinant.ln().max(0.0))
    }
}

/// The error of a match under a pose, `None` behind the camera, where numbers overflow, and where the error is so large
/// that its square is above `most` whatever the covariance is.
pub(crate) fn residual(
    pinhole: &Pinhole,
    camera_from_world: &Se3,
    m: &PointMatch,
    most: f64,
) -> Option<Residual> {
    let rotation = camera_from_world.rotation.matrix();
    let p: Vector3<f64> = rotation * m.point_in_world + camera_from_world.translation;
    // NaN is not in front either.
    let in_front = p.z > 0.0;
    if !in_front {
        return None;
    }
    let inverse = 1.0 / p.z;
    let (x, y) = (p.x * inverse, p.y * inverse);
    let projected = Vector2::new(pinhole.fx * x + pinhole.cx, pinhole.fy * y + pinhole.cy);
    let (gx, gy) = (pinhole.fx * inverse, pinhole.fy * inverse);
    let by_camera_point = Matrix2x3::new(gx, 0.0, -gx * x, 0.0, gy, -gy * y);
    let (error, by_camera_point) =
        m.shape
            .whitened(&m.pixel_ideal, &projected, &by_camera_point, m.sigma_px);
    // The largest eigenvalue of J P J^T is at most trace(P) |J|^2.
    let spread = m.point_covariance.trace();
    let largest = 1.0 + spread * by_camera_point.norm_squared();
    let within = error.norm_squared() <= most * largest;
    if !within {
        return None;
    }
    let mut covariance = Matrix2::identity();
    if spread > 0.0 {
        let by_point = by_camera_point * rotation;
        covariance += by_point * m.point_covariance * by_point.transpose();
        let cross = 0.5 * (covariance[(0, 1)] + covariance[(1, 0)]);
        covariance[(0, 1)] = cross;
        covariance[(1, 0)] = cross;
    }
    let usable = covariance.iter().all(|v| v.is_finite()) && covariance.determinant() > 0.0;
    usable.then_some(Residual {
        error,
        covariance,
        by_camera_point,
        projected,
    })
}

/// The score of a match under a pose; infinite where it is surely above `threshold`.
pub(crate) fn score(
    pinhole: &Pinhole,
    camera_from_world: &Se3,
    m: &PointMatch,
    threshold: f64,
) -> f64 {
    residual(pinhole, camera_from_world, m, threshold).map_or(f64::INFINITY, |r| {
        let (square, spread) = r.terms();
        square + spread
    })
}

/// e^T S^-1 e of a match under a pose; infinite where it, or the determinant term, is surely above `threshold`.
pub(crate) fn square(
    pinhole: &Pinhole,
    camera_from_world: &Se3,
    m: &PointMatch,
    threshold: f64,
) -> f64 {
    residual(pinhole, camera_from_world, m, threshold)
        .map(|r| r.terms())
        .filter(|(_, spread)| *spread <= threshold)
        .map_or(f64::INFINITY, |(square, _)| square)
}
