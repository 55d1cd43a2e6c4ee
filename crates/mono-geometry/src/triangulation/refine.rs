//! Gauss-Newton on the reprojection error of a point in n views.
//!
//! Minimise sum |pixel_i - project(T_i X)|^2 / sigma_i^2 over X. With the whitened Jacobian J of all pixels and residual
//! r the step solves (J^T J) step = J^T r; a step that would raise the sum is damped. The length of a step is measured in
//! standard deviations of the estimate, sqrt(step^T J^T J step), so one tolerance serves near and far points. At the
//! solution (J^T J)^-1 is the covariance.
//!
//! Degenerate: rays without parallax make J^T J singular (refused by Cholesky with the parallax); a step behind a camera
//! is damped like one that raises the error.

use nalgebra::{Matrix3, Vector3};

use super::observation::{Acceptance, Observation, Rejection, parallax_at};
use crate::camera::Pinhole;
use crate::structure::{NormalEquations, three_parameters};

/// The minimum of the reprojection error.
pub(super) struct Minimum {
    pub(super) point: Vector3<f64>,
    pub(super) covariance: Matrix3<f64>,
    pub(super) chi_square: f64,
    pub(super) iterations: usize,
}

/// Iterates from `start` until the step is below 1e-6 standard deviations. O(views) per step.
pub(super) fn refine(
    pinhole: &Pinhole,
    observations: &[Observation],
    start: &Vector3<f64>,
    acceptance: &Acceptance,
) -> Result<Minimum, Rejection> {
    let normal_at = |point: &Vector3<f64>| normal_equations(pinhole, observations, point);
    let singular = |point: &Vector3<f64>| Rejection::ParallaxTooSmall {
        parallax_rad: parallax_at(observations, point),
        required_rad: acceptance.min_parallax_rad,
    };
    let found = three_parameters(start, normal_at, singular, acceptance.max_iterations)?;
    Ok(Minimum {
        point: found.parameters,
        covariance: found.covariance,
        chi_square: found.chi_square,
        iterations: found.iterations,
    })
}

pub(super) fn normal_equations(
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
        let by_point = by_point * observation.camera_from_world.rotation.matrix();
        let (residual, jacobian) = observation.shape.whitened(
            &observation.pixel_ideal,
            &pixel,
            &by_point,
            observation.sigma_px,
        );
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
