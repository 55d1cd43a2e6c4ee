//! Anchored inverse depth from n views: Gauss-Newton on the reprojection error, with covariance.
//!
//! Minimise sum |pixel_i - project_i(alpha, beta, rho)|^2 / sigma_i^2 for known poses. In these parameters the pixels are
//! nearly linear at any distance, so the Gaussian (sum J^T J / sigma^2)^-1 at the minimum describes the error also where
//! the parallax is a fraction of a degree and a Gaussian in metres does not.
//!
//! Steps:
//! 1. alpha, beta from the ray of the view nearest to the anchor, as if at infinity;
//! 2. rho from the other views: each gives m x (A + rho b) = 0, with m its ray, A the anchor's ray and b the baseline in
//!    its axes; one linear least-squares unknown;
//! 3. Gauss-Newton, damped where a step would raise the error, until a step is below 1e-6 standard deviations.
//!
//! No gate on parallax or chi-square: the result of a gate is no longer the Gaussian that the covariance states. Test
//! [`Refined::chi_square`] and convert with [`InverseDepthPoint::to_euclidean_if_linear`] where needed.
//!
//! Degenerate: cameras at one place leave rho undetermined: refused with the parallax zero. rho <= 0 is an answer, a
//! point not told from infinity.

use nalgebra::{Matrix3, Vector3};

use super::point::InverseDepthPoint;
use crate::camera::Pinhole;
use crate::placed_camera::PlacedCamera;
use crate::structure::{NormalEquations, three_parameters};
use crate::triangulation::{Observation, Rejection, check};

/// An inverse depth point fitted to views.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refined {
    /// The minimum of the reprojection error.
    pub point: InverseDepthPoint,
    /// Covariance of (alpha, beta, rho) for exact camera poses.
    pub covariance: Matrix3<f64>,
    /// Sum of squared reprojection errors over sigma^2.
    pub chi_square: f64,
    /// 2 n - 3.
    pub degrees_of_freedom: usize,
    /// Gauss-Newton steps taken.
    pub iterations: usize,
}

/// The inverse depth point of least reprojection error, anchored in `anchor` (commonly the first view, but it need not
/// be one of the views). O(views) per step.
///
/// # Errors
/// [`Rejection::BadObservation`], [`Rejection::BehindCamera`], [`Rejection::NotConverged`], or
/// [`Rejection::ParallaxTooSmall`] where no baseline makes rho visible.
pub fn refine(
    pinhole: &Pinhole,
    anchor: &PlacedCamera,
    observations: &[Observation],
    max_iterations: usize,
) -> Result<Refined, Rejection> {
    check(observations)?;
    let cameras: Vec<PlacedCamera> = observations
        .iter()
        .map(|o| PlacedCamera::new(&o.camera_from_world.inverse()))
        .collect();
    let start = start(pinhole, anchor, observations, &cameras)?;
    let at = |parameters: &Vector3<f64>| InverseDepthPoint::new(anchor, parameters);
    let found = three_parameters(
        &start.parameters(),
        |parameters| normal_equations(pinhole, observations, &cameras, &at(parameters)),
        |parameters| Rejection::ParallaxTooSmall {
            parallax_rad: parallax(&at(parameters), &cameras),
            required_rad: f64::MIN_POSITIVE,
        },
        max_iterations,
    )?;
    Ok(Refined {
        point: at(&found.parameters),
        covariance: found.covariance,
        chi_square: found.chi_square,
        degrees_of_freedom: 2 * observations.len() - 3,
        iterations: found.iterations,
    })
}

fn normal_equations(
    pinhole: &Pinhole,
    observations: &[Observation],
    cameras: &[PlacedCamera],
    point: &InverseDepthPoint,
) -> Result<NormalEquations, Rejection> {
    let mut normal = NormalEquations {
        information: Matrix3::zeros(),
        gradient: Vector3::zeros(),
        chi_square: 0.0,
    };
    for (view, (observation, camera)) in observations.iter().zip(cameras).enumerate() {
        let prediction = point
            .predict(pinhole, camera)
            .ok_or_else(|| Rejection::BehindCamera {
                view,
                depth_m: depth(point, camera),
            })?;
        let (residual, jacobian) = observation.shape.whitened(
            &observation.pixel_ideal,
            &prediction.pixel_ideal,
            &prediction.by_parameters,
            observation.sigma_px,
        );
        normal.information += jacobian.transpose() * jacobian;
        normal.gradient += jacobian.transpose() * residual;
        normal.chi_square += residual.norm_squared();
    }
    Ok(normal)
}

/// Steps 1 and 2.
fn start(
    pinhole: &Pinhole,
    anchor: &PlacedCamera,
    observations: &[Observation],
    cameras: &[PlacedCamera],
) -> Result<InverseDepthPoint, Rejection> {
    let distance = |camera: &PlacedCamera| (camera.centre - anchor.centre).norm();
    let nearest = (0..cameras.len())
        .min_by(|i, j| distance(&cameras[*i]).total_cmp(&distance(&cameras[*j])))
        .unwrap_or(0);
    let ray_of = |view: usize| {
        let bearing = pinhole.bearing(&observations[view].pixel_ideal);
        cameras[view].camera_from_world.tr_mul(&bearing)
    };
    let ray = anchor.rotate(&ray_of(nearest));
    let in_front = ray.z > 0.0;
    if !in_front {
        return Err(Rejection::BehindCamera {
            view: nearest,
            depth_m: ray.z,
        });
    }
    let direction = anchor.camera_from_world.tr_mul(&(ray / ray.z));
    let (mut numerator, mut denominator) = (0.0, 0.0);
    for view in (0..cameras.len()).filter(|view| *view != nearest) {
        let seen = ray_of(view);
        let baseline = anchor.centre - cameras[view].centre;
        let weight = observations[view].shape.weight(observations[view].sigma_px);
        let across = seen.cross(&baseline);
        numerator -= weight * across.dot(&seen.cross(&direction));
        denominator += weight * across.norm_squared();
    }
    let rho = numerator / denominator;
    let (alpha, beta) = (ray.x / ray.z, ray.y / ray.z);
    let point = InverseDepthPoint::new(anchor, &Vector3::new(alpha, beta, 0.0));
    let near = InverseDepthPoint { rho, ..point };
    let visible = rho.is_finite()
        && cameras
            .iter()
            .all(|camera| near.project(pinhole, camera).is_some());
    Ok(if visible { near } else { point })
}

/// Depth in a view, metres; of the direction, without unit, where the point is at infinity.
fn depth(point: &InverseDepthPoint, camera: &PlacedCamera) -> f64 {
    let scaled = point.direction(camera).z;
    if point.rho == 0.0 {
        scaled
    } else {
        scaled / point.rho
    }
}

/// Largest angle between two cameras as seen from the point, radians.
fn parallax(point: &InverseDepthPoint, cameras: &[PlacedCamera]) -> f64 {
    let rays: Vec<Vector3<f64>> = cameras
        .iter()
        .map(|camera| camera.camera_from_world.tr_mul(&point.direction(camera)))
        .collect();
    crate::triangulation::largest_angle(&rays)
}
