//! A point from two or more views with known poses, its covariance, or the reason why not yet (Eq. 22-24).
//!
//! The paper stacks z_c [u v 1]^T = M [X 1]^T of two views and solves by least squares. It prints the same projection
//! matrix M for both; they differ by the pose, M_i = K camera_i_from_world. The linear error is algebraic, not in
//! pixels, so it only starts what decides:
//!
//! 1. the angle between the rays must reach the minimal parallax;
//! 2. start at the point nearest to all rays ([`midpoint`]), or, if that is behind a camera, at the linear solution
//!    ([`linear`]);
//! 3. Gauss-Newton on the reprojection error sum |pixel - project|^2 / sigma^2, damped where it would rise;
//! 4. covariance (sum J^T J / sigma^2)^-1 at the solution;
//! 5. the point must be in front of every camera, the parallax at the point above the minimum, and the remaining error
//!    below the chi-square quantile of 2 n - 3 degrees of freedom.
//!
//! Two views have a solution without Gauss-Newton in space: move both pixels by the least so that their rays meet
//! ([`correct_match`], [`triangulate_two_views`]).
//!
//! Degenerate: zero baseline or points far away give a parallax near zero and are refused with the value. The covariance
//! is Gaussian in Cartesian coordinates, which describes depth badly below about 2 degrees of parallax: use
//! [`crate::inverse_depth`] there.

mod refine;
mod start;
mod two_view;

pub use start::{linear, midpoint};
pub use two_view::{Correction, NoCorrection, correct_match, triangulate_two_views};

use estimation_base::{chi_square_cdf, chi_square_quantile};
use nalgebra::{Matrix3, Vector2, Vector3};

use crate::camera::Pinhole;
use crate::se3::Se3;
use refine::Minimum;

/// One sighting of the point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Pose of the camera: maps world points to camera points.
    pub camera_from_world: Se3,
    /// Where it is seen, in ideal (undistorted) pixels.
    pub pixel_ideal: Vector2<f64>,
    /// Standard deviation of each pixel coordinate, pixels, above zero.
    pub sigma_px: f64,
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
    #[error("the point is behind the camera of view {view}: depth {depth_m} m, required: above 0")]
    BehindCamera {
        /// Index of the first such view.
        view: usize,
        /// Depth in that camera, metres.
        depth_m: f64,
    },
    /// The rays are too nearly parallel, or the cameras too close together.
    #[error("parallax {parallax_rad} rad is too small, required: {required_rad} rad")]
    ParallaxTooSmall {
        /// Largest angle between two views, radians.
        parallax_rad: f64,
        /// The smallest accepted.
        required_rad: f64,
    },
    /// The views do not see one point.
    #[error("chi-square {chi_square} is too large, required: at most {threshold}")]
    ChiSquareTooLarge {
        /// Sum of squared normalised errors.
        chi_square: f64,
        /// The largest accepted.
        threshold: f64,
    },
    /// Gauss-Newton did not settle.
    #[error(
        "not converged after {iterations} steps: last step {step_sigmas} standard deviations, required: {required_sigmas}"
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

/// The point that minimises the reprojection error, if it is to be believed. O(views^2) for the parallax, O(views) per
/// step.
///
/// # Errors
/// The [`Rejection`] with the measured value and the one required.
pub fn triangulate(
    pinhole: &Pinhole,
    observations: &[Observation],
    acceptance: &Acceptance,
) -> Result<Triangulated, Rejection> {
    check(observations)?;
    let ray_parallax_rad = require_parallax(ray_parallax(pinhole, observations), acceptance)?;
    let start = start::start(pinhole, observations).ok_or(Rejection::ParallaxTooSmall {
        parallax_rad: ray_parallax_rad,
        required_rad: acceptance.min_parallax_rad,
    })?;
    require_in_front(observations, &start)?;
    let minimum = refine::refine(pinhole, observations, &start, acceptance)?;
    accept(observations, &minimum, acceptance)
}

/// The tests of step 5 on a minimum of the reprojection error.
fn accept(
    observations: &[Observation],
    minimum: &Minimum,
    acceptance: &Acceptance,
) -> Result<Triangulated, Rejection> {
    let parallax_rad = require_parallax(parallax_at(observations, &minimum.point), acceptance)?;
    let degrees_of_freedom = 2 * observations.len() - 3;
    // The quantile is a bisection: for a point that passes, one value of the distribution decides.
    let probability = acceptance.chi_square_probability;
    let passed = chi_square_cdf(degrees_of_freedom as f64, minimum.chi_square) <= probability;
    if !passed {
        return Err(Rejection::ChiSquareTooLarge {
            chi_square: minimum.chi_square,
            threshold: chi_square_quantile(degrees_of_freedom as f64, probability).unwrap_or(0.0),
        });
    }
    Ok(Triangulated {
        point: minimum.point,
        covariance: minimum.covariance,
        parallax_rad,
        chi_square: minimum.chi_square,
        degrees_of_freedom,
        iterations: minimum.iterations,
    })
}

fn require_parallax(parallax_rad: f64, acceptance: &Acceptance) -> Result<f64, Rejection> {
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
fn ray_parallax(pinhole: &Pinhole, observations: &[Observation]) -> f64 {
    let rays: Vec<_> = observations
        .iter()
        .map(|o| o.camera_from_world.rotation.inverse() * pinhole.bearing(&o.pixel_ideal))
        .collect();
    largest_angle(&rays)
}

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

fn require_in_front(observations: &[Observation], point: &Vector3<f64>) -> Result<(), Rejection> {
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
fn parallax_at(observations: &[Observation], point: &Vector3<f64>) -> f64 {
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
