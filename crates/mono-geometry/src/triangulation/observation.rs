//! Sightings of a point, the conditions of its acceptance, and the reasons why there is none.

use estimation_base::Readable;
use nalgebra::{Matrix3, Vector2, Vector3};

use crate::camera::Pinhole;
use crate::noise_shape::NoiseShape;
use crate::se3::Se3;

/// One sighting of the point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Pose of the camera: maps world points to camera points.
    pub camera_from_world: Se3,
    /// Where it is seen, in ideal (undistorted) pixels.
    pub pixel_ideal: Vector2<f64>,
    /// Standard deviation of each pixel coordinate, pixels, above zero: of the distorted pixel, if `shape` is that of a lens.
    pub sigma_px: f64,
    /// The shape of the noise: [`NoiseShape::ROUND`], or what the lens makes of it
    /// ([`crate::Camera::undistort_with_shape`]).
    pub shape: NoiseShape,
}

/// When to accept a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Acceptance {
    /// Smallest parallax, radians.
    pub min_parallax_rad: f64,
    /// Probability with which a point that all views see passes the chi-square test, above 0: 0.99 refuses one in a
    /// hundred, 0.999 one in a thousand, 1 none.
    pub chi_square_probability: f64,
    /// Gauss-Newton steps allowed.
    pub max_iterations: usize,
}

impl Default for Acceptance {
    /// Two degrees, one in a thousand, 25 steps.
    fn default() -> Self {
        Self {
            min_parallax_rad: 2.0_f64.to_radians(),
            chi_square_probability: 0.999,
            max_iterations: 25,
        }
    }
}

/// An accepted point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Triangulated {
    /// Position in the world, metres.
    pub point: Vector3<f64>,
    /// Covariance of the position for exact camera poses, m^2.
    pub covariance: Matrix3<f64>,
    /// Largest angle between two cameras as seen from the point, radians.
    pub parallax_rad: f64,
    /// Sum of squared reprojection errors over sigma^2.
    pub chi_square: f64,
    /// 2 n - 3.
    pub degrees_of_freedom: usize,
    /// Gauss-Newton steps taken.
    pub iterations: usize,
}

/// Why there is no point.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Rejection {
    /// Fewer than two views, or a view with numbers that cannot be used.
    #[error(
        "view {view} of {views} is unusable, required: two views or more, finite pixels and poses, sigma above 0"
    )]
    BadObservation {
        /// Index of the offending view (the number of views if there are too few).
        view: usize,
        /// Views given.
        views: usize,
    },
    /// The solution is behind a camera.
    #[error(
        "the point is behind the camera of view {view}: depth {} m, required: above 0",
        Readable(*.depth_m)
    )]
    BehindCamera {
        /// Index of the first such view.
        view: usize,
        /// Depth in that camera, metres.
        depth_m: f64,
    },
    /// The rays are too nearly parallel, or the cameras too close together.
    #[error(
        "parallax {} rad is too small, required: {} rad",
        Readable(*.parallax_rad),
        Readable(*.required_rad)
    )]
    ParallaxTooSmall {
        /// Largest angle between two views, radians.
        parallax_rad: f64,
        /// The smallest accepted.
        required_rad: f64,
    },
    /// The views do not see one point.
    #[error(
        "chi-square {} is too large, required: at most {}",
        Readable(*.chi_square),
        Readable(*.threshold)
    )]
    ChiSquareTooLarge {
        /// Sum of squared normalised errors.
        chi_square: f64,
        /// The largest accepted.
        threshold: f64,
    },
    /// Gauss-Newton did not settle.
    #[error(
        "not converged after {iterations} steps: last step {} standard deviations, required: {}",
        Readable(*.step_sigmas),
        Readable(*.required_sigmas)
    )]
    NotConverged {
        /// Steps taken.
        iterations: usize,
        /// Length of the last step in standard deviations of the estimate.
        step_sigmas: f64,
        /// The length that counts as settled.
        required_sigmas: f64,
    },
}

/// The parallax, if it is large enough.
pub(super) fn require_parallax(
    parallax_rad: f64,
    acceptance: &Acceptance,
) -> Result<f64, Rejection> {
    if parallax_rad >= acceptance.min_parallax_rad && parallax_rad > 0.0 {
        Ok(parallax_rad)
    } else {
        Err(Rejection::ParallaxTooSmall {
            parallax_rad,
            required_rad: acceptance.min_parallax_rad,
        })
    }
}

/// Largest angle between two rays, radians.
pub(super) fn ray_parallax(pinhole: &Pinhole, observations: &[Observation]) -> f64 {
    let rays: Vec<_> = observations
        .iter()
        .map(|o| o.camera_from_world.rotation.inverse() * pinhole.bearing(&o.pixel_ideal))
        .collect();
    largest_angle(&rays)
}

/// Refuses fewer than two views and numbers that cannot be used.
pub(crate) fn check(observations: &[Observation]) -> Result<(), Rejection> {
    let views = observations.len();
    let bad = |view| Err(Rejection::BadObservation { view, views });
    if views < 2 {
        return bad(views);
    }
    for (view, o) in observations.iter().enumerate() {
        let finite = o.pixel_ideal.iter().all(|v| v.is_finite())
            && o.camera_from_world
                .translation
                .iter()
                .all(|v| v.is_finite())
            && o.camera_from_world
                .rotation
                .matrix()
                .iter()
                .all(|v| v.is_finite());
        if !(finite && o.sigma_px > 0.0 && o.sigma_px.is_finite()) {
            return bad(view);
        }
    }
    Ok(())
}

/// Refuses a point behind one of the cameras.
pub(super) fn require_in_front(
    observations: &[Observation],
    point: &Vector3<f64>,
) -> Result<(), Rejection> {
    for (view, observation) in observations.iter().enumerate() {
        let depth_m = observation.camera_from_world.transform_point(point).z;
        let in_front = depth_m > 0.0;
        if !in_front {
            return Err(Rejection::BehindCamera { view, depth_m });
        }
    }
    Ok(())
}

/// Largest angle between two cameras as seen from the point, radians.
pub(super) fn parallax_at(observations: &[Observation], point: &Vector3<f64>) -> f64 {
    let rays: Vec<_> = observations
        .iter()
        .map(|o| o.camera_from_world.inverse().translation - point)
        .collect();
    largest_angle(&rays)
}

pub(crate) fn largest_angle(vectors: &[Vector3<f64>]) -> f64 {
    let mut largest = 0.0_f64;
    for (i, a) in vectors.iter().enumerate() {
        for b in &vectors[i + 1..] {
            largest = largest.max(a.cross(b).norm().atan2(a.dot(b)));
        }
    }
    largest
}
