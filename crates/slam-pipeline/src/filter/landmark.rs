//! A landmark as one particle knows it: a Gaussian over three numbers.
//!
//! The three numbers are an anchored inverse depth (Civera, Davison, Montiel 2008), (alpha, beta, rho) in the camera
//! that first saw the landmark, or the coordinates of a point in the particle's world, as in the paper. The anchor is a
//! pose of the particle's own path, which an RBPF knows exactly, so three numbers are enough. Their geometry is that of
//! [`mono_geometry::inverse_depth`].

use mono_geometry::Pinhole;
use mono_geometry::inverse_depth::{LandmarkGeometry, first_sighting_with_covariance};
use nalgebra::{Matrix2, Matrix2x3, Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::pixel_noise::PixelNoise;

/// How the three numbers of a landmark are read.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum Parametrisation {
    /// (alpha, beta, rho) in the camera of this keyframe of the particle's path.
    InverseDepth {
        /// Keyframe index of the anchor.
        anchor: u32,
    },
    /// (X, Y, Z) in the particle's world.
    Point,
}

impl Parametrisation {
    /// Keyframe of the anchor; `None` for a point.
    #[must_use]
    pub(crate) fn anchor(self) -> Option<u32> {
        match self {
            Self::InverseDepth { anchor } => Some(anchor),
            Self::Point => None,
        }
    }
}

/// Gaussian estimate of one landmark in one particle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Landmark {
    /// How `mean` is read.
    pub(crate) parametrisation: Parametrisation,
    /// Mean of the three numbers.
    pub(crate) mean: Vector3<f64>,
    /// Covariance of the three numbers.
    pub(crate) covariance: Matrix3<f64>,
}

/// A point in the world with its covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PointEstimate {
    /// Position.
    pub(crate) position: Vector3<f64>,
    /// Covariance of the position.
    pub(crate) covariance: Matrix3<f64>,
}

/// Gaussian prior of the inverse depth of a landmark that was seen once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct InverseDepthPrior {
    /// Mean, one over the particle's unit.
    pub(crate) mean: f64,
    /// Standard deviation.
    pub(crate) sigma: f64,
}

impl InverseDepthPrior {
    /// The prior whose two-sigma interval is (0, 1 / `min_depth`).
    #[must_use]
    pub(crate) fn beyond(min_depth: f64) -> Self {
        let mean = 0.5 / min_depth;
        Self {
            mean,
            sigma: 0.5 * mean,
        }
    }
}

impl Landmark {
    /// A landmark of unknown depth, seen at `pixel` in keyframe `anchor` with this noise.
    #[must_use]
    pub(crate) fn from_first_sighting(
        pinhole: &Pinhole,
        anchor: u32,
        pixel: &Vector2<f64>,
        noise: &PixelNoise,
        depth: InverseDepthPrior,
    ) -> Self {
        let (mean, covariance) = first_sighting_with_covariance(
            pinhole,
            pixel,
            noise.covariance(),
            depth.mean,
            depth.sigma,
        );
        Self {
            parametrisation: Parametrisation::InverseDepth { anchor },
            mean,
            covariance,
        }
    }

    /// The same landmark with a prior of its depth that lies beyond the distance the camera has driven towards it since
    /// the anchor: a landmark that is seen again was not passed.
    ///
    /// This is only for a landmark whose depth was never measured. The prior of the inverse depth keeps its shape, with
    /// its mean two standard deviations above zero.
    #[must_use]
    pub(crate) fn in_front_of(&self, geometry: &LandmarkGeometry, centre: &Vector3<f64>) -> Self {
        /// Share of the prior mean depth the camera may have driven.
        const REACH: f64 = 0.3;
        let mut landmark = *self;
        let Some(anchor) = geometry.anchor() else {
            return landmark;
        };
        let forward = (anchor.camera_from_world * (centre - anchor.centre)).z;
        if forward > 0.0 && landmark.mean.z * forward > REACH {
            let shrink = REACH / (forward * landmark.mean.z);
            landmark.mean.z *= shrink;
            landmark.covariance[(2, 2)] *= shrink * shrink;
        }
        landmark
    }

    /// Keyframe of the anchor; `None` for a point.
    #[must_use]
    pub(crate) fn anchor(&self) -> Option<u32> {
        self.parametrisation.anchor()
    }

    /// The ratio sigma_rho / rho of an inverse-depth landmark, which says how open its depth still is; zero for a point.
    #[must_use]
    pub(crate) fn depth_openness(&self) -> f64 {
        match self.parametrisation {
            Parametrisation::InverseDepth { .. } => {
                self.covariance[(2, 2)].sqrt() / self.mean.z.abs().max(1e-12)
            }
            Parametrisation::Point => 0.0,
        }
    }

    /// World point and its covariance by first-order propagation, in the
    /// particle's length unit; `None` when the depth is not positive.
    #[must_use]
    pub(crate) fn point(&self, geometry: &LandmarkGeometry) -> Option<PointEstimate> {
        let (position, covariance) = geometry.to_point(&self.mean, &self.covariance)?;
        Some(PointEstimate {
            position,
            covariance,
        })
    }
}

/// The pixel covariance J Sigma J^T that the uncertainty of the landmark causes.
#[must_use]
pub(crate) fn projected_covariance(
    jacobian: &Matrix2x3<f64>,
    covariance: &Matrix3<f64>,
) -> Matrix2<f64> {
    jacobian * covariance * jacobian.transpose()
}
