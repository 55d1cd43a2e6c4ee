//! Gauss-Newton on the reprojection error of a point in n views.
//!
//! Minimise sum |pixel_i - project(T_i X)|^2 / sigma_i^2 over X. With the whitened Jacobian J of all pixels and residual
//! r the step solves (J^T J) step = J^T r; it is halved until the sum does not grow. The length of a step is measured in
//! standard deviations of the estimate, sqrt(step^T J^T J step), so one tolerance serves near and far points. At the
//! solution (J^T J)^-1 is the covariance.
//!
//! Degenerate: rays without parallax make J^T J singular (refused by Cholesky with the parallax); a step behind a camera
//! is halved like one that raises the error.

use nalgebra::{Matrix3, Vector3};

use super::{Acceptance, Observation, Rejection, parallax_at};
use crate::camera::Pinhole;
use crate::linalg::cholesky;

/// A step this short, in standard deviations of the estimate, changes nothing that matters.
pub(crate) const STEP_TOLERANCE_SIGMAS: f64 = 1e-6;

/// The minimum of the reprojection error.
pub(super) struct Minimum {
    pub(super) point: Vector3<f64>,
    pub(super) covariance: Matrix3<f64>,
    pub(super) chi_square: f64,
    pub(super) iterations: usize,
}

/// Iterates from `start` until the step is below [`STEP_TOLERANCE_SIGMAS`]. O(views) per step.
pub(super) fn refine(
    pinhole: &Pinhole,
    observations: &[Observation],
    start: &Vector3<f64>,
    acceptance: &Acceptance,
) -> Result<Minimum, Rejection> {
    let mut point = *start;
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
    Ok(Minimum {
        point,
        covariance: crate::linalg::symmetrize(&covariance),
        chi_square: normal.chi_square,
        iterations,
    })
}

pub(super) struct NormalEquations {
    pub(super) information: Matrix3<f64>,
    /// J^T r, with r = observed - predicted: the step solves information * step = gradient.
    pub(super) gradient: Vector3<f64>,
    pub(super) chi_square: f64,
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
