//! Refinement of a pose on the reprojection error, with covariance.
//!
//! Problem: from a start, the `world_from_camera` of least cost sum rho(s_i), s_i = |p_i - project(X_i)|^2 / sigma_i^2.
//!
//! Equation: with pose = mean exp(delta), delta = (rho, omega) in camera axes, J the whitened Jacobian of all pixels by
//! delta, w = rho'(s) and r the whitened residuals, (J^T w J + mu D) delta = J^T w r.
//!
//! Steps: Gauss-Newton (mu = 0); a step that raises the cost or puts a point behind the camera is taken back, and mu
//! grows (Levenberg 1944, Marquardt 1963; D the diagonal of J^T w J). It ends when the undamped step is below 1e-6 standard
//! deviations of the estimate, or the decrease that it promises is rounding of the cost. The covariance is (J^T w J)^-1 at
//! the end: exact to first order without a loss, and with a loss for data of which few lie beyond its threshold.
//!
//! Degenerate: collinear points leave a turn free, fewer than three points more than that: the information is singular
//! (refused with the pivot).

use nalgebra::{Matrix6, Vector6};

use super::{Correspondence, NoPose, check};
use crate::camera::Pinhole;
use crate::error::GeometryError;
use crate::linalg::{cholesky, symmetrize};
use crate::robust_loss::RobustLoss;
use crate::se3::Se3;

/// How to refine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefineOptions {
    /// Loss of a reprojection error, in standard deviations.
    pub loss: RobustLoss,
    /// Accepted and refused steps allowed.
    pub max_iterations: usize,
}

impl Default for RefineOptions {
    /// Plain least squares, 50 steps.
    fn default() -> Self {
        Self {
            loss: RobustLoss::None,
            max_iterations: 50,
        }
    }
}

/// Why the iteration ended, with what was compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Termination {
    /// The undamped step is short.
    StepSmall {
        /// Its length in standard deviations of the estimate.
        step_sigmas: f64,
        /// The length that counts as settled.
        threshold: f64,
    },
    /// The decrease promised by the step cannot be seen in the cost.
    CostFlat {
        /// Promised decrease of the cost.
        decrease: f64,
        /// Rounding of the cost.
        threshold: f64,
    },
    /// All steps were used.
    StepLimit {
        /// Length of the last undamped step in standard deviations of the estimate.
        step_sigmas: f64,
        /// The length that would have counted as settled.
        threshold: f64,
    },
}

impl Termination {
    /// Whether a minimum was reached.
    #[must_use]
    pub fn converged(&self) -> bool {
        !matches!(self, Self::StepLimit { .. })
    }
}

/// A pose and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseEstimate {
    /// The pose.
    pub world_from_camera: Se3,
    /// Covariance of delta = (rho, omega) in `world_from_camera * exp(delta)`, camera axes; m^2, m rad, rad^2.
    pub covariance: Matrix6<f64>,
    /// Sum of squared reprojection errors over sigma^2, without the loss.
    pub chi_square: f64,
    /// Sum of the losses of the squared errors; `chi_square` without a loss.
    pub robust_chi_square: f64,
    /// 2 n - 6.
    pub degrees_of_freedom: usize,
    /// Steps tried.
    pub iterations: usize,
    /// Why it ended.
    pub termination: Termination,
}

const STEP_TOLERANCE_SIGMAS: f64 = crate::triangulation::STEP_TOLERANCE_SIGMAS;
/// First damping after a failed Gauss-Newton step, relative to the diagonal; below its square it is dropped again.
const FIRST_DAMPING: f64 = 1e-4;

/// The minimum of the reprojection error next to `world_from_camera`, from three points on. O(points) per step.
///
/// # Errors
/// [`NoPose`]: unusable input, a point behind the camera at the start, or points that leave a motion free.
pub fn refine_pose(
    pinhole: &Pinhole,
    world_from_camera: &Se3,
    correspondences: &[Correspondence],
    options: &RefineOptions,
) -> Result<PoseEstimate, NoPose> {
    check(correspondences, 3)?;
    options.loss.check().map_err(|_bad| NoPose::BadOption {
        name: "threshold of the loss",
        required: "finite and above 0",
    })?;
    let start_finite = world_from_camera.translation.iter().all(|v| v.is_finite())
        && world_from_camera
            .rotation
            .matrix()
            .iter()
            .all(|v| v.is_finite());
    if !start_finite {
        return Err(NoPose::BadOption {
            name: "start",
            required: "finite",
        });
    }
    let mut pose = *world_from_camera;
    let evaluate = |pose: &Se3| normal_equations(pinhole, pose, correspondences, &options.loss);
    let mut normal = evaluate(&pose)?;
    let mut damping = 0.0;
    let mut iterations = 0;
    let termination = loop {
        // At a start far away the undamped system may be singular; the end may not.
        let undamped = cholesky(&normal.information);
        let mut step_sigmas = f64::INFINITY;
        if let Ok(factor) = &undamped {
            let decrease = factor
                .solve(&normal.gradient)
                .dot(&normal.gradient)
                .max(0.0);
            step_sigmas = decrease.sqrt();
            if step_sigmas <= STEP_TOLERANCE_SIGMAS {
                break Termination::StepSmall {
                    step_sigmas,
                    threshold: STEP_TOLERANCE_SIGMAS,
                };
            }
            let threshold =
                4.0 * f64::EPSILON * normal.robust_chi_square * correspondences.len() as f64;
            if decrease <= threshold {
                break Termination::CostFlat {
                    decrease,
                    threshold,
                };
            }
        } else if damping == 0.0 {
            damping = FIRST_DAMPING;
        }
        if iterations >= options.max_iterations {
            break Termination::StepLimit {
                step_sigmas,
                threshold: STEP_TOLERANCE_SIGMAS,
            };
        }
        iterations += 1;
        let next = step(&normal, damping).and_then(|delta| {
            let candidate = pose.compose(&Se3::exp(&delta));
            let next = evaluate(&candidate).ok()?;
            (next.robust_chi_square <= normal.robust_chi_square).then_some((candidate, next))
        });
        if let Some(accepted) = next {
            (pose, normal) = accepted;
            damping *= 0.1;
            if damping < FIRST_DAMPING * FIRST_DAMPING {
                damping = 0.0;
            }
        } else {
            damping = (10.0 * damping).max(FIRST_DAMPING);
        }
    };
    let covariance = covariance(&normal.information, correspondences.len())?;
    Ok(PoseEstimate {
        world_from_camera: pose,
        covariance,
        chi_square: normal.chi_square,
        robust_chi_square: normal.robust_chi_square,
        degrees_of_freedom: 2 * correspondences.len() - 6,
        iterations,
        termination,
    })
}

/// The inverse of the information, if every pivot is above the rounding of a sum of 2 n products, 2 n eps of the diagonal,
/// times 32 for what elimination adds.
fn covariance(information: &Matrix6<f64>, points: usize) -> Result<Matrix6<f64>, NoPose> {
    let factor = cholesky(information).map_err(|error| match error {
        GeometryError::NotPositiveDefinite {
            pivot,
            value,
            required,
        } => NoPose::Singular {
            pivot,
            value,
            required,
        },
        _ => NoPose::Singular {
            pivot: 0,
            value: f64::NAN,
            required: 0.0,
        },
    })?;
    for pivot in 0..6 {
        let value = factor.l_dirty()[(pivot, pivot)].powi(2);
        let required = 64.0 * points as f64 * f64::EPSILON * information[(pivot, pivot)];
        if value <= required {
            return Err(NoPose::Singular {
                pivot,
                value,
                required,
            });
        }
    }
    Ok(symmetrize(&factor.inverse()))
}

/// Squared reprojection error over sigma^2; infinite behind the camera.
pub(super) fn squared_error(
    pinhole: &Pinhole,
    camera_from_world: &Se3,
    correspondence: &Correspondence,
) -> f64 {
    pinhole
        .project(&camera_from_world.transform_point(&correspondence.point_in_world))
        .map_or(f64::INFINITY, |pixel| {
            (correspondence.pixel_ideal - pixel).norm_squared() / correspondence.sigma_px.powi(2)
        })
}

struct NormalEquations {
    information: Matrix6<f64>,
    gradient: Vector6<f64>,
    chi_square: f64,
    robust_chi_square: f64,
}

fn step(normal: &NormalEquations, damping: f64) -> Option<Vector6<f64>> {
    let mut damped = normal.information;
    for k in 0..6 {
        damped[(k, k)] *= 1.0 + damping;
    }
    Some(cholesky(&damped).ok()?.solve(&normal.gradient))
}

fn normal_equations(
    pinhole: &Pinhole,
    world_from_camera: &Se3,
    correspondences: &[Correspondence],
    loss: &RobustLoss,
) -> Result<NormalEquations, NoPose> {
    let mut normal = NormalEquations {
        information: Matrix6::zeros(),
        gradient: Vector6::zeros(),
        chi_square: 0.0,
        robust_chi_square: 0.0,
    };
    let camera_from_world = world_from_camera.rotation.inverse();
    for (index, c) in correspondences.iter().enumerate() {
        let in_camera = camera_from_world * (c.point_in_world - world_from_camera.translation);
        let (pixel, by_point) =
            pinhole
                .project_with_jacobian(&in_camera)
                .ok_or(NoPose::BehindCamera {
                    index,
                    depth_m: in_camera.z,
                })?;
        let whitened = by_point / c.sigma_px;
        let residual = (c.pixel_ideal - pixel) / c.sigma_px;
        let squared = residual.norm_squared();
        let loss = loss.at(squared);
        normal.chi_square += squared;
        normal.robust_chi_square += loss.rho;
        // The point moves by -rho + [p]x omega: a row h of the derivative by the point becomes (-h, h x p).
        for k in 0..2 {
            let h = whitened.row(k).transpose();
            let turn = h.cross(&in_camera);
            let row = Vector6::new(-h.x, -h.y, -h.z, turn.x, turn.y, turn.z);
            let weighted = row * loss.weight;
            normal.information.ger(1.0, &weighted, &row, 1.0);
            normal.gradient.axpy(residual[k], &weighted, 1.0);
        }
    }
    let finite =
        normal.robust_chi_square.is_finite() && normal.information.iter().all(|v| v.is_finite());
    if finite {
        Ok(normal)
    } else {
        Err(NoPose::Singular {
            pivot: 0,
            value: f64::INFINITY,
            required: 0.0,
        })
    }
}
