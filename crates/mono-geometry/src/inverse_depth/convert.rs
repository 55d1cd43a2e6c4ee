//! From anchored inverse depth to a Euclidean point: when a Gaussian may follow, and when not yet.
//!
//! Problem: with r = sigma_rho / rho, the depth 1 / rho of a Gaussian rho is skewed. Its mean is too far by the fraction
//! r^2, so r standard deviations, and the squared error over the variance reported at the estimate has mean 1 + 3 r^2
//! instead of 1. A covariance in metres is honest only for small r.
//!
//! Equation: the linearity index of Civera, Davison and Montiel (2008), L = 4 sigma_d |cos a| / d, with sigma_d the
//! standard deviation of the distance on the anchor ray, d the distance of the view from the point and a the parallax. It
//! is about 4 r for a view near the anchor.
//!
//! Steps: refuse rho <= 0 (no point); refuse L above the limit; else map mean and covariance to first order.
//!
//! Degenerate: at a parallax of 90 degrees L is zero however uncertain the depth: the index asks only what that view
//! sees. Take the view in which the point is to be used.

use estimation_base::Readable;
use nalgebra::{Matrix3, Vector3};

use super::point::InverseDepthPoint;
use crate::placed_camera::PlacedCamera;

/// Largest linearity index at which Civera, Davison and Montiel convert: a bias of at most 1/40 of a standard deviation.
pub const CONVERSION_LINEARITY_INDEX: f64 = 0.1;

/// Why a point has no Euclidean Gaussian yet.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NotYet {
    /// The point is at infinity or beyond.
    #[error(
        "inverse depth {} 1/m has no finite point (standard deviation {} 1/m), required: above 0",
        Readable(*.rho),
        Readable(*.sigma_rho)
    )]
    AtInfinity {
        /// Inverse depth, 1/m.
        rho: f64,
        /// Its standard deviation, 1/m.
        sigma_rho: f64,
    },
    /// The depth is too uncertain for a Gaussian in metres.
    #[error(
        "linearity index {} is too large, required: at most {}",
        Readable(*.linearity_index),
        Readable(*.required)
    )]
    NotLinear {
        /// The index of [`InverseDepthPoint::linearity_index`]; infinite for an unusable variance.
        linearity_index: f64,
        /// The largest accepted.
        required: f64,
    },
}

impl InverseDepthPoint {
    /// Position in the world, metres; `None` for rho <= 0, a point at infinity. O(1).
    #[must_use]
    pub fn point_in_world(&self) -> Option<Vector3<f64>> {
        self.to_euclidean(&Matrix3::zeros()).map(|(point, _)| point)
    }

    /// Position and covariance in the world (m, m^2) of a point with the given covariance of (alpha, beta, rho), to first
    /// order. Good where [`Self::linearity_index`] is small. O(1).
    #[must_use]
    pub fn to_euclidean(&self, covariance: &Matrix3<f64>) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let (point, world) = self.geometry().to_point(&self.parameters(), covariance)?;
        let finite = point.iter().all(|v| v.is_finite());
        finite.then(|| (point, estimation_base::symmetric(&world)))
    }

    /// How far a Gaussian in Euclidean coordinates would be from the truth, seen from a view: the index of Civera et al.,
    /// L = 4 sigma_d |cos a| / d, with sigma_d the standard deviation of the distance on the anchor ray, d the distance
    /// of the view from the point and a the parallax. They convert below 0.1. Infinite for rho <= 0. O(1).
    #[must_use]
    pub fn linearity_index(&self, sigma_rho: f64, view: &PlacedCamera) -> f64 {
        let Some(point) = self.point_in_world() else {
            return f64::INFINITY;
        };
        let ray = self.anchor_ray();
        let sigma_distance = ray.norm() * sigma_rho / (self.rho * self.rho);
        let from_anchor = self.anchor.camera_from_world.tr_mul(&ray.normalize());
        let from_view = point - view.centre;
        let distance = from_view.norm();
        4.0 * sigma_distance * (from_anchor.dot(&from_view) / distance).abs() / distance
    }

    /// [`Self::to_euclidean`] if the linearity index in `view` is at most `max_linearity_index`
    /// ([`CONVERSION_LINEARITY_INDEX`] is the usual one). O(1).
    ///
    /// # Errors
    /// [`NotYet`] with the value measured and the one required.
    pub fn to_euclidean_if_linear(
        &self,
        covariance: &Matrix3<f64>,
        view: &PlacedCamera,
        max_linearity_index: f64,
    ) -> Result<(Vector3<f64>, Matrix3<f64>), NotYet> {
        let sigma_rho = covariance[(2, 2)].max(0.0).sqrt();
        let at_infinity = NotYet::AtInfinity {
            rho: self.rho,
            sigma_rho,
        };
        let (point, euclidean) = self.to_euclidean(covariance).ok_or(at_infinity)?;
        let index = self.linearity_index(sigma_rho, view);
        let usable = index.is_finite()
            && covariance[(2, 2)] >= 0.0
            && euclidean.iter().all(|v| v.is_finite());
        let linearity_index = if usable { index } else { f64::INFINITY };
        if usable && linearity_index <= max_linearity_index {
            Ok((point, euclidean))
        } else {
            Err(NotYet::NotLinear {
                linearity_index,
                required: max_linearity_index,
            })
        }
    }
}
