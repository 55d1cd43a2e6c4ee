//! The input of the pose search: a keypoint and a landmark that it may show.

use mono_geometry::NoiseShape;
use nalgebra::{Matrix3, Vector2, Vector3};

/// A keypoint, a landmark that it may show, and how well either is known.
///
/// One keypoint may come with several landmarks and one landmark with several keypoints: within a pose each counts once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointMatch {
    /// Identity of the keypoint in its image.
    pub keypoint: usize,
    /// Identity of the landmark.
    pub landmark: u32,
    /// Position of the landmark, metres.
    pub point_in_world: Vector3<f64>,
    /// Covariance of the position in world axes, m^2; zeros for a point taken as exact. Depth is usually the worst known:
    /// `mono_geometry::inverse_depth` gives point and covariance of a landmark in inverse depth.
    pub point_covariance: Matrix3<f64>,
    /// Position of a camera that saw the landmark (of its anchor keyframe), metres. Landmarks that were seen from near one
    /// another may be in view together. The same value for all puts the whole map in one region.
    pub seen_from: Vector3<f64>,
    /// Where the keypoint is, in ideal (undistorted) pixels.
    pub pixel_ideal: Vector2<f64>,
    /// Standard deviation of each of its coordinates, pixels, above zero: of the distorted pixel, if `shape` is that of a lens.
    pub sigma_px: f64,
    /// The shape of its noise: [`NoiseShape::ROUND`], or what the lens makes of it
    /// ([`mono_geometry::Camera::undistort_with_shape`]).
    pub shape: NoiseShape,
    /// How good the match is, 0 to 1 (see [`crate::Candidate::quality`]): better ones are tried first.
    pub quality: f64,
}

impl PointMatch {
    /// Whether all numbers can be used.
    pub(crate) fn is_usable(&self) -> bool {
        let finite = self.point_in_world.iter().all(|v| v.is_finite())
            && self.point_covariance.iter().all(|v| v.is_finite())
            && self.seen_from.iter().all(|v| v.is_finite())
            && self.pixel_ideal.iter().all(|v| v.is_finite());
        finite
            && (0..3).all(|k| self.point_covariance[(k, k)] >= 0.0)
            && self.sigma_px > 0.0
            && self.sigma_px.is_finite()
            && (self.sigma_px * self.sigma_px).is_normal()
            && !self.quality.is_nan()
    }

    /// Distance of the landmark from the camera that saw it, metres.
    pub(crate) fn depth_m(&self) -> f64 {
        (self.point_in_world - self.seen_from).norm()
    }

    /// Standard deviation along the ray on which it was seen, as a share of the depth; 0 where the depth is.
    pub(crate) fn relative_depth_sigma(&self) -> f64 {
        let ray = self.point_in_world - self.seen_from;
        let squared = ray.norm_squared();
        if squared > 0.0 {
            let variance = (ray.transpose() * self.point_covariance * ray)[0] / squared;
            (variance.max(0.0) / squared).sqrt()
        } else {
            0.0
        }
    }
}
