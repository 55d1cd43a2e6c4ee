//! Homographies between two views for [`crate::ransac`]: samples of four matches, Sampson's distance as the score.
//!
//! second ~ H first for points of a plane, or for any points if the camera only turned. The mathematics is in
//! [`crate::homography`]; the motion behind H in [`super::plane_pose`].
//!
//! The squared Sampson distance is chi-square with two degrees of freedom for equal noise of all four coordinates:
//! inliers are below its 95 % quantile. Refits minimise the transfer error in the second image, exact for a first
//! image without noise and within a few per cent of the maximum-likelihood cost for motions of moderate scale.
//!
//! Degenerate, no model: coinciding points or three collinear ones in either image. Samples of which the triangles
//! turn differently in the two images are refused before fitting: points in front of both cameras never do that.

use super::pair::Correspondence;
use crate::homography::{Homography, fit, keeps_orientation};
use crate::ransac::{Scorer, Solver};

/// 95 % of a chi-square distribution of two degrees of freedom.
const CHI_SQUARE_95_TWO: f64 = 5.991_464_547_107_979;

/// The four-point solver; data in pixels or normalised coordinates.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct FourPoint;

impl Solver for FourPoint {
    type Datum = Correspondence;
    type Model = Homography;

    fn sample_size(&self) -> usize {
        4
    }

    fn fit(&self, data: &[Correspondence], sample: &[usize], models: &mut Vec<Homography>) {
        let [a, b, c, d] = *sample else {
            return;
        };
        let four = [data[a], data[b], data[c], data[d]];
        let (first, second) = (four.map(|m| m.first), four.map(|m| m.second));
        if keeps_orientation(&first, &second) {
            models.extend(Homography::from_four_points(&first, &second));
        }
    }

    fn refit(
        &self,
        data: &[Correspondence],
        inliers: &[usize],
        _model: &Homography,
    ) -> Option<Homography> {
        let first: Vec<_> = inliers.iter().map(|i| data[*i].first).collect();
        let second: Vec<_> = inliers.iter().map(|i| data[*i].second).collect();
        fit(&first, &second).ok().map(|f| f.homography)
    }
}

/// Truncated squared Sampson distance from a homography.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HomographyScorer {
    /// Variance of every coordinate, in the squared units of the matches.
    pub variance: f64,
    /// Largest squared distance of an inlier, in variances.
    pub threshold: f64,
}

impl HomographyScorer {
    /// For noise of standard deviation `sigma` in each coordinate, in the units of the matches; inliers are 95 % of the
    /// right ones.
    #[must_use]
    pub fn new(sigma: f64) -> Self {
        Self {
            variance: sigma * sigma,
            threshold: CHI_SQUARE_95_TWO,
        }
    }
}

impl Scorer<Correspondence, Homography> for HomographyScorer {
    fn squared_residual(&self, model: &Homography, datum: &Correspondence) -> f64 {
        model
            .sampson_squared(&datum.first, &datum.second)
            .map_or(f64::INFINITY, |squared| squared / self.variance)
    }

    fn threshold(&self) -> f64 {
        self.threshold
    }
}
