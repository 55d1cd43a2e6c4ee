//! A point from two or more views with known poses, its covariance, or the reason why not yet (Eq. 22-24).
//!
//! The paper stacks z_c [u v 1]^T = M [X 1]^T of two views and solves by least squares. It prints the same projection
//! matrix M for both; they differ by the pose, M_i = K camera_i_from_world. The linear error is algebraic, not in
//! pixels, so it only starts what decides:
//!
//! 1. the angle between the rays must reach the minimal parallax;
//! 2. start at the point nearest to all rays ([`midpoint`]), or, if that is behind a camera, at the linear solution
//!    ([`linear`]);
//! 3. Gauss-Newton on the reprojection error sum |pixel - project|^2 / sigma^2, steps halved until it falls;
//! 4. covariance (sum J^T J / sigma^2)^-1 at the solution;
//! 5. the point must be in front of every camera, the parallax at the point above the minimum, and the remaining error
//!    below the chi-square quantile of 2 n - 3 degrees of freedom.
//!
//! Degenerate: zero baseline or points far away give a parallax near zero and are refused with the value. The covariance
//! is Gaussian in Cartesian coordinates, which describes depth badly below about 2 degrees of parallax: use
//! [`crate::inverse_depth`] there.

use nalgebra::{DMatrix, Matrix3, Vector2, Vector3};

use crate::camera::Pinhole;
use crate::linalg::{cholesky, null_vector};
use crate::se3::Se3;

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
    /// One-sided normal quantile of the chi-square test: 2.326 refuses one good point in a hundred, 3.09 one in a
    /// thousand.
    pub chi_square_z: f64,
    /// Gauss-Newton steps allowed.
    pub max_iterations: usize,
}

impl Default for Acceptance {
    /// Two degrees, one in a thousand, 25 steps.
    fn default() -> Self {
        Self {
            min_parallax_rad: 2.0_f64.to_radians(),
            chi_square_z: 3.09,
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

/// A step this short, in standard deviations of the estimate, changes nothing that matters.
const STEP_TOLERANCE_SIGMAS: f64 = 1e-6;

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
    let rays: Vec<_> = observations
        .iter()
        .map(|o| o.camera_from_world.rotation.inverse() * pinhole.bearing(&o.pixel_ideal))
        .collect();
    let require_parallax = |parallax_rad: f64| {
        if parallax_rad >= acceptance.min_parallax_rad && parallax_rad > 0.0 {
            Ok(parallax_rad)
        } else {
            Err(Rejection::ParallaxTooSmall {
                parallax_rad,
                required_rad: acceptance.min_parallax_rad,
            })
        }
    };
    let ray_parallax_rad = require_parallax(largest_angle(&rays))?;
    let start = start(pinhole, observations).ok_or(Rejection::ParallaxTooSmall {
        parallax_rad: ray_parallax_rad,
        required_rad: acceptance.min_parallax_rad,
    })?;
    require_in_front(observations, &start)?;

    let mut point = start;
    let mut normal = normal_equations(pinhole, observations, &point)?;
    let mut iterations = 0;
    let covariance = loop {
        let factor =
            cholesky(&normal.information).map_err(|_singular| Rejection::ParallaxTooSmall {
                parallax_rad: parallax_at(observations, &point),
                required_rad: acceptance.min_parallax_rad,
            })?;
        let step = factor.solve(&normal.gradient);
        let step_sigmas = step.dot(&normal.gradient).max(0.0).sqrt();
        if step_sigmas <= STEP_TOLERANCE_SIGMAS {
            break factor.inverse();
        }
        let failed = Rejection::NotConverged {
            iterations,
            step_sigmas,
            required_sigmas: STEP_TOLERANCE_SIGMAS,
        };
        if iterations >= acceptance.max_iterations {
            return Err(failed);
        }
        iterations += 1;
        let mut scale = 1.0;
        let accepted = (0..12).find_map(|_| {
            let candidate = point + step * scale;
            scale *= 0.5;
            normal_equations(pinhole, observations, &candidate)
                .ok()
                .filter(|next| next.chi_square <= normal.chi_square * (1.0 + 1e-12))
                .map(|next| (candidate, next))
        });
        (point, normal) = accepted.ok_or(failed)?;
    };

    let parallax_rad = require_parallax(parallax_at(observations, &point))?;
    let degrees_of_freedom = 2 * observations.len() - 3;
    let threshold = chi_square_quantile(degrees_of_freedom, acceptance.chi_square_z);
    if normal.chi_square > threshold {
        return Err(Rejection::ChiSquareTooLarge {
            chi_square: normal.chi_square,
            threshold,
        });
    }
    Ok(Triangulated {
        point,
        covariance: crate::linalg::symmetrize(&covariance),
        parallax_rad,
        chi_square: normal.chi_square,
        degrees_of_freedom,
        iterations,
    })
}

/// The point nearest to all rays, in metres: (sum (I - d d^T)) X = sum (I - d d^T) c.
///
/// `None` if the rays are parallel. O(views).
#[must_use]
pub fn midpoint(pinhole: &Pinhole, observations: &[Observation]) -> Option<Vector3<f64>> {
    let mut matrix = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for observation in observations {
        let world_from_camera = observation.camera_from_world.inverse();
        let ray = world_from_camera.rotation * pinhole.bearing(&observation.pixel_ideal);
        let across = Matrix3::identity() - ray * ray.transpose();
        matrix += across;
        right += across * world_from_camera.translation;
    }
    let point = cholesky(&matrix).ok()?.solve(&right);
    point.iter().all(|v| v.is_finite()).then_some(point)
}

/// The linear solution of Eq. 22-24 with each view's own projection matrix (direct linear transformation).
///
/// `None` for a point at infinity or views that fix no point. O(views).
#[must_use]
pub fn linear(pinhole: &Pinhole, observations: &[Observation]) -> Option<Vector3<f64>> {
    if observations.len() < 2 {
        return None;
    }
    // Origin at the first camera: far from the world's origin the homogeneous scale would drown.
    let origin = observations[0].camera_from_world.inverse().translation;
    let mut rows = DMatrix::zeros(2 * observations.len(), 4);
    for (view, observation) in observations.iter().enumerate() {
        let normalized = pinhole.normalize(&observation.pixel_ideal);
        let rotation = observation.camera_from_world.rotation.matrix();
        let translation = observation.camera_from_world.transform_point(&origin);
        for axis in 0..2 {
            let row = 2 * view + axis;
            for column in 0..3 {
                rows[(row, column)] =
                    normalized[axis] * rotation[(2, column)] - rotation[(axis, column)];
            }
            rows[(row, 3)] = normalized[axis] * translation.z - translation[axis];
        }
    }
    let null = null_vector(&rows).ok()?;
    if null.rank < 3 {
        return None;
    }
    let scale = null.vector[3];
    let point = null.vector.fixed_rows::<3>(0) / scale + origin;
    point.iter().all(|v| v.is_finite()).then_some(point)
}

/// Quantile of the chi-square distribution at the normal quantile z, by Wilson and Hilferty (1931).
///
/// Within 3.5 % for one degree of freedom at z = 3.09, 2.5 % for two, 2 % for three; within 1 % at z = 2.33 and below. `degrees_of_freedom` of zero gives zero.
#[must_use]
pub fn chi_square_quantile(degrees_of_freedom: usize, z: f64) -> f64 {
    if degrees_of_freedom == 0 {
        return 0.0;
    }
    let k = degrees_of_freedom as f64;
    let spread = 2.0 / (9.0 * k);
    let root = (1.0 - spread + z * spread.sqrt()).max(0.0);
    k * root * root * root
}

struct NormalEquations {
    information: Matrix3<f64>,
    /// J^T r, with r = observed - predicted: the step solves information * step = gradient.
    gradient: Vector3<f64>,
    chi_square: f64,
}

fn normal_equations(
    pinhole: &Pinhole,
    observations: &[Observation],
    point: &Vector3<f64>,
) -> Result<NormalEquations, Rejection> {
    let mut information = Matrix3::zeros();
    let mut gradient = Vector3::zeros();
    let mut chi_square = 0.0;
    for (view, observation) in observations.iter().enumerate() {
        let in_camera = observation.camera_from_world.transform_point(point);
        let (pixel, by_point) =
            pinhole
                .project_with_jacobian(&in_camera)
                .ok_or(Rejection::BehindCamera {
                    view,
                    depth_m: in_camera.z,
                })?;
        let jacobian =
            by_point * observation.camera_from_world.rotation.matrix() / observation.sigma_px;
        let residual = (observation.pixel_ideal - pixel) / observation.sigma_px;
        information += jacobian.transpose() * jacobian;
        gradient += jacobian.transpose() * residual;
        chi_square += residual.norm_squared();
    }
    Ok(NormalEquations {
        information,
        gradient,
        chi_square,
    })
}

fn check(observations: &[Observation]) -> Result<(), Rejection> {
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

/// The midpoint if it is in front of every camera, else the linear solution, else whichever exists.
fn start(pinhole: &Pinhole, observations: &[Observation]) -> Option<Vector3<f64>> {
    let near = midpoint(pinhole, observations);
    if near.is_some_and(|point| require_in_front(observations, &point).is_ok()) {
        return near;
    }
    let algebraic = linear(pinhole, observations);
    if algebraic.is_some_and(|point| require_in_front(observations, &point).is_ok()) {
        return algebraic;
    }
    near.or(algebraic)
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

fn largest_angle(vectors: &[Vector3<f64>]) -> f64 {
    let mut largest = 0.0_f64;
    for (i, a) in vectors.iter().enumerate() {
        for b in &vectors[i + 1..] {
            largest = largest.max(a.cross(b).norm().atan2(a.dot(b)));
        }
    }
    largest
}
