//! Two views with known poses: their essential and fundamental matrix, a match in them, and its distance from them.

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::camera::Pinhole;
use crate::se3::Se3;
use crate::so3::hat;

/// E = `[t / |t|]x R` of the motion from the first camera to the second; singular values (1, 1, 0).
///
/// `None` without a baseline, or if a number is not finite. O(1).
#[must_use]
pub fn essential(second_from_first: &Se3) -> Option<Matrix3<f64>> {
    let length = second_from_first.translation.norm();
    (length > 0.0 && length.is_finite()).then(|| {
        hat(&(second_from_first.translation / length)) * second_from_first.rotation.matrix()
    })
}

/// F = K^-T E K^-1 for one camera at two poses, ideal pixels. `None` as for [`essential`]. O(1).
#[must_use]
pub fn fundamental(pinhole: &Pinhole, second_from_first: &Se3) -> Option<Matrix3<f64>> {
    let normalized_from_pixel = pinhole.normalized_from_pixel();
    essential(second_from_first)
        .map(|e| normalized_from_pixel.transpose() * e * normalized_from_pixel)
}

/// One point seen in two views. Both in the same units: ideal pixels, or normalised coordinates (X/Z, Y/Z).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correspondence {
    /// Where the first view sees it.
    pub first: Vector2<f64>,
    /// Where the second view sees it.
    pub second: Vector2<f64>,
}

impl Correspondence {
    /// The same match in normalised coordinates, given in ideal pixels.
    #[must_use]
    pub fn normalized(&self, pinhole: &Pinhole) -> Self {
        Self {
            first: pinhole.normalize(&self.first),
            second: pinhole.normalize(&self.second),
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        self.first
            .iter()
            .chain(self.second.iter())
            .all(|v| v.is_finite())
    }
}

/// Signed Sampson distance of a match and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampson {
    /// First-order distance of the match (p1, p2) from the constraint, pixels, signed.
    pub distance_px: f64,
    /// Its standard deviation under the given pixel noise, pixels.
    pub sigma_px: f64,
}

/// Two views of one camera with a baseline between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EpipolarPair {
    fundamental: Matrix3<f64>,
    baseline_m: f64,
}

impl EpipolarPair {
    /// The pair of views at two poses in the world.
    ///
    /// `None` if the baseline is rounding error: at most 16 eps times the distance of the cameras from the world's
    /// origin. O(1).
    #[must_use]
    pub fn new(pinhole: &Pinhole, world_from_first: &Se3, world_from_second: &Se3) -> Option<Self> {
        let baseline_m = (world_from_second.translation - world_from_first.translation).norm();
        let reach = world_from_first
            .translation
            .norm()
            .max(world_from_second.translation.norm());
        // NaN is no baseline either.
        let apart = baseline_m > 16.0 * f64::EPSILON * reach;
        if !apart {
            return None;
        }
        // The difference first: composing the poses would cancel far from the origin.
        let second_from_world = world_from_second.rotation.inverse();
        let second_from_first = Se3::new(
            second_from_world * world_from_first.rotation,
            second_from_world * (world_from_first.translation - world_from_second.translation),
        );
        Some(Self {
            fundamental: fundamental(pinhole, &second_from_first)?,
            baseline_m,
        })
    }

    /// Distance of the two cameras, metres.
    #[must_use]
    pub fn baseline_m(&self) -> f64 {
        self.baseline_m
    }

    /// F of p2^T F p1 = 0.
    #[must_use]
    pub fn fundamental(&self) -> &Matrix3<f64> {
        &self.fundamental
    }

    /// Line (a, b, c) of the second image, a u + b v + c = 0 with a^2 + b^2 = 1, on which a pixel of the first lies;
    /// `None` at the epipole.
    #[must_use]
    pub fn line_in_second(&self, first_px: &Vector2<f64>) -> Option<Vector3<f64>> {
        unit_line(self.fundamental * first_px.push(1.0))
    }

    /// Line of the first image on which a pixel of the second lies; `None` at the epipole.
    #[must_use]
    pub fn line_in_first(&self, second_px: &Vector2<f64>) -> Option<Vector3<f64>> {
        unit_line(self.fundamental.transpose() * second_px.push(1.0))
    }

    /// The paper's measure (Eq. 30): the distances of both pixels from the other's line, added; pixels.
    #[must_use]
    pub fn symmetric_distance_px(
        &self,
        first_px: &Vector2<f64>,
        second_px: &Vector2<f64>,
    ) -> Option<f64> {
        let in_second = self.line_in_second(first_px)?.dot(&second_px.push(1.0));
        let in_first = self.line_in_first(second_px)?.dot(&first_px.push(1.0));
        Some(in_second.abs() + in_first.abs())
    }

    /// Sampson distance of a match whose pixels have standard deviations `sigma_first_px` and `sigma_second_px` in each
    /// coordinate; `None` where both pixels are epipoles. O(1).
    #[must_use]
    pub fn sampson(
        &self,
        first_px: &Vector2<f64>,
        second_px: &Vector2<f64>,
        sigma_first_px: f64,
        sigma_second_px: f64,
    ) -> Option<Sampson> {
        let line_in_second = self.fundamental * first_px.push(1.0);
        let line_in_first = self.fundamental.transpose() * second_px.push(1.0);
        let error = line_in_second.dot(&second_px.push(1.0));
        let by_first = line_in_first.xy().norm_squared();
        let by_second = line_in_second.xy().norm_squared();
        let gradient = (by_first + by_second).sqrt();
        let variance = sigma_first_px * sigma_first_px * by_first
            + sigma_second_px * sigma_second_px * by_second;
        (gradient > 0.0 && gradient.is_finite()).then(|| Sampson {
            distance_px: error / gradient,
            sigma_px: variance.sqrt() / gradient,
        })
    }
}

/// A line scaled so that its dot product with (u, v, 1) is a distance in pixels.
fn unit_line(line: Vector3<f64>) -> Option<Vector3<f64>> {
    let length = line.xy().norm();
    (length > 0.0 && length.is_finite()).then(|| line / length)
}
