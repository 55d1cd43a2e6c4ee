//! The noise of a match, in the ideal image where the filter compares it.
//!
//! A keypoint is found in the real image with the same noise in both directions. Taking the lens out stretches the noise, most
//! along the radius: 60 degrees off the axis of an equidistant fisheye the standard deviation along the radius is four times
//! that of the keypoint, across it 1.7 times. One number for both believes the radius too much and the turn about the centre
//! too little.
//!
//! Degenerate: without a lens the noise is one number, and costs no more than one.

use mono_geometry::NoiseShape;
use nalgebra::{Matrix2, SMatrix};
use serde::{Deserialize, Serialize};

/// Gaussian noise of an ideal pixel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct PixelNoise {
    covariance_px2: Matrix2<f64>,
}

/// The map of differences of ideal pixels to such with the same noise in every direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Whitening {
    /// L^-1 of the covariance L L^T; `None` where the noise is round already.
    inverse_root: Option<Matrix2<f64>>,
    /// The variance of each coordinate afterwards.
    pub(crate) variance: f64,
}

impl PixelNoise {
    /// Standard deviation `sigma_px` in every direction.
    #[must_use]
    pub(crate) fn round(sigma_px: f64) -> Self {
        Self {
            covariance_px2: Matrix2::from_diagonal_element(sigma_px * sigma_px),
        }
    }

    /// That of a keypoint of standard deviation `sigma_px` where the lens gives it this shape, to first order.
    #[must_use]
    pub(crate) fn shaped(shape: &NoiseShape, sigma_px: f64) -> Self {
        Self {
            covariance_px2: shape.covariance(sigma_px),
        }
    }

    /// The same with this covariance, pixels squared.
    #[must_use]
    pub(crate) fn of(covariance_px2: Matrix2<f64>) -> Self {
        Self { covariance_px2 }
    }

    /// The covariance, pixels squared.
    #[must_use]
    #[inline]
    pub(crate) fn covariance(&self) -> &Matrix2<f64> {
        &self.covariance_px2
    }

    /// Its standard deviation and shape, for what takes them apart.
    #[must_use]
    pub(crate) fn sigma_and_shape(&self) -> (f64, NoiseShape) {
        let sigma = self.covariance_px2[(0, 0)].sqrt();
        let round = (sigma, NoiseShape::ROUND);
        if self.is_round() {
            return round;
        }
        NoiseShape::from_covariance(&self.covariance_px2).map_or(round, |shape| (1.0, shape))
    }

    /// The map that makes it round.
    #[must_use]
    pub(crate) fn whitening(&self) -> Whitening {
        let c = &self.covariance_px2;
        let round = Whitening {
            inverse_root: None,
            variance: c[(0, 0)],
        };
        if self.is_round() {
            return round;
        }
        c.cholesky()
            .and_then(|factor| factor.l().try_inverse())
            .map_or(round, |inverse| Whitening {
                inverse_root: Some(inverse),
                variance: 1.0,
            })
    }

    fn is_round(&self) -> bool {
        let c = &self.covariance_px2;
        c[(1, 0)] == 0.0 && c[(0, 0)] == c[(1, 1)]
    }
}

impl Whitening {
    /// Differences of pixels, or derivatives of a pixel, column by column. O(C).
    #[must_use]
    #[inline]
    pub(crate) fn rows<const C: usize>(&self, columns: SMatrix<f64, 2, C>) -> SMatrix<f64, 2, C> {
        match &self.inverse_root {
            None => columns,
            Some(inverse) => inverse * columns,
        }
    }
}
