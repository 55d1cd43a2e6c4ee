//! Matches scored by their Sampson distance from an epipolar model, for [`crate::ransac`].
//!
//! r = p2^T F p1 / sqrt(var(p2^T F p1)) with the variance propagated to first order from independent noise of the four
//! coordinates (Sampson 1982; Hartley and Zisserman 11.4.3): standard normal for a right match. Normalised coordinates
//! with per-axis standard deviations sigma / fx and sigma / fy give the very same number as pixels.
//!
//! Degenerate: where both points are epipoles every r is possible; such a match is no inlier.

use nalgebra::{Matrix3, Vector2};

use super::pair::Correspondence;
use crate::camera::Pinhole;
use crate::ransac::Scorer;

/// 95 % of a chi-square distribution of one degree of freedom.
const CHI_SQUARE_95_ONE: f64 = 3.841_458_820_694_124;

/// A model with a fundamental or essential matrix F, p2^T F p1 = 0.
pub trait EpipolarModel {
    /// The matrix, of any scale.
    fn matrix(&self) -> &Matrix3<f64>;
}

impl EpipolarModel for Matrix3<f64> {
    fn matrix(&self) -> &Matrix3<f64> {
        self
    }
}

/// Truncated squared Sampson distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampsonScorer {
    /// Variance of a coordinate along x and y, in the squared units of the matches.
    pub variance: Vector2<f64>,
    /// Largest squared distance of an inlier, in variances.
    pub threshold: f64,
}

impl SampsonScorer {
    /// For matches in ideal pixels with noise `sigma_px` in each coordinate; inliers are 95 % of the right ones.
    #[must_use]
    pub fn pixels(sigma_px: f64) -> Self {
        Self {
            variance: Vector2::repeat(sigma_px * sigma_px),
            threshold: CHI_SQUARE_95_ONE,
        }
    }

    /// For matches in normalised coordinates, the noise given in pixels.
    #[must_use]
    pub fn normalized(pinhole: &Pinhole, sigma_px: f64) -> Self {
        let sigma = Vector2::new(sigma_px / pinhole.fx, sigma_px / pinhole.fy);
        Self {
            variance: sigma.component_mul(&sigma),
            threshold: CHI_SQUARE_95_ONE,
        }
    }
}

impl<M: EpipolarModel> Scorer<Correspondence, M> for SampsonScorer {
    #[inline]
    fn squared_residual(&self, model: &M, datum: &Correspondence) -> f64 {
        let f = model.matrix();
        let (p, q) = (&datum.first, &datum.second);
        let in_second = [
            f[(0, 0)] * p.x + f[(0, 1)] * p.y + f[(0, 2)],
            f[(1, 0)] * p.x + f[(1, 1)] * p.y + f[(1, 2)],
            f[(2, 0)] * p.x + f[(2, 1)] * p.y + f[(2, 2)],
        ];
        let in_first = [
            f[(0, 0)] * q.x + f[(1, 0)] * q.y + f[(2, 0)],
            f[(0, 1)] * q.x + f[(1, 1)] * q.y + f[(2, 1)],
        ];
        let error = in_second[0] * q.x + in_second[1] * q.y + in_second[2];
        let variance = self.variance.x * (in_second[0] * in_second[0] + in_first[0] * in_first[0])
            + self.variance.y * (in_second[1] * in_second[1] + in_first[1] * in_first[1]);
        // 0 / 0 at a pair of epipoles is NaN, which a scorer counts as infinite.
        error * error / variance
    }

    fn threshold(&self) -> f64 {
        self.threshold
    }
}
