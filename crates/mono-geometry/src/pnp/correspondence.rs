//! The input of every pose solver, and the reasons why there is no pose.

use estimation_base::Readable;
use nalgebra::{Vector2, Vector3};

use crate::noise_shape::NoiseShape;

/// A world point and where it is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correspondence {
    /// Position in the world, metres; taken as exact.
    pub point_in_world: Vector3<f64>,
    /// Where it is seen, in ideal (undistorted) pixels.
    pub pixel_ideal: Vector2<f64>,
    /// Standard deviation of each pixel coordinate, pixels, above zero: of the distorted pixel, if `shape` is that of a lens.
    pub sigma_px: f64,
    /// The shape of the noise: [`NoiseShape::ROUND`], or what the lens makes of it
    /// ([`crate::Camera::undistort_with_shape`]).
    pub shape: NoiseShape,
}

/// Why there is no pose.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoPose {
    /// Too few points.
    #[error("{points} points, required: at least {required}")]
    TooFewPoints {
        /// Points given.
        points: usize,
        /// Points required.
        required: usize,
    },
    /// Numbers that cannot be used.
    #[error("correspondence {index} is unusable, required: finite numbers, sigma above 0")]
    BadCorrespondence {
        /// Index of the first such correspondence.
        index: usize,
    },
    /// The start, or the threshold of the loss, is not usable.
    #[error("{name} is not usable, required: {required}")]
    BadOption {
        /// Name of the value.
        name: &'static str,
        /// The values accepted, in words.
        required: &'static str,
    },
    /// A point is behind the camera at the start.
    #[error(
        "point {index} is behind the camera at the start: depth {} m, required: above 0",
        Readable(*.depth_m)
    )]
    BehindCamera {
        /// Index of the first such point.
        index: usize,
        /// Depth, metres.
        depth_m: f64,
    },
    /// The points leave a motion free (collinear, or all but three coincide).
    #[error(
        "the points leave a motion of the camera free: pivot {pivot} of the information is {}, required: above {}",
        Readable(*.value),
        Readable(*.required)
    )]
    Singular {
        /// Index of the first pivot that is rounding error, in the order (rho, omega).
        pivot: usize,
        /// Its value.
        value: f64,
        /// The value it must exceed.
        required: f64,
    },
    /// No triangle of the points gave a pose that sees all of them.
    #[error(
        "none of {candidates} candidate poses from {triangles} triangles sees all points in front"
    )]
    NoCandidate {
        /// Triangles tried.
        triangles: usize,
        /// Poses they gave.
        candidates: usize,
    },
    /// Random sampling found no consensus.
    #[error("best pose has {inliers} inliers, required: at least {required}")]
    NoConsensus {
        /// Inliers of the best pose; 0 without one.
        inliers: usize,
        /// Inliers required.
        required: usize,
    },
}

/// Refuses too few correspondences and numbers that cannot be used.
pub(super) fn check(correspondences: &[Correspondence], required: usize) -> Result<(), NoPose> {
    let points = correspondences.len();
    if points < required {
        return Err(NoPose::TooFewPoints { points, required });
    }
    let usable = |c: &Correspondence| {
        c.point_in_world.iter().all(|v| v.is_finite())
            && c.pixel_ideal.iter().all(|v| v.is_finite())
            && c.sigma_px > 0.0
            && c.sigma_px.is_finite()
    };
    match correspondences.iter().position(|c| !usable(c)) {
        Some(index) => Err(NoPose::BadCorrespondence { index }),
        None => Ok(()),
    }
}
