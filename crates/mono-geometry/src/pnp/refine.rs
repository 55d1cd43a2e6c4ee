//! Refinement of a pose on the reprojection error, with covariance.
//!
//! Problem: from a start, the `world_from_camera` of least cost sum rho(s_i), s_i = |p_i - project(X_i)|^2 / sigma_i^2
//! (behind a lens, of the residual that [`crate::NoiseShape`] whitens).
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

use super::correspondence::{Correspondence, NoPose, check};
use crate::camera::Pinhole;
use crate::error::GeometryError;
use crate::least_squares::{Control, Model, Problem, Termination, Trial, minimise};
use crate::linalg::{self, cholesky};
use crate::robust_loss::RobustLoss;
use crate::se3::Se3;
use crate::structure::STEP_TOLERANCE_SIGMAS;

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

/// First damping after a failed Gauss-Newton step, relative to the diagonal.
const FIRST_DAMPING: f64 = 1e-4;
/// Share of the cost that the rounding of the pixels can hide, in a decrease that was promised and did not come.
const ROUNDING_TOLERANCE: f64 = 1e-11;

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
    let mut problem = Reprojection {
        pinhole,
        correspondences,
        loss: &options.loss,
        pose: *world_from_camera,
        normal: normal_equations(pinhole, world_from_camera, correspondences, &options.loss)?,
        delta: Vector6::zeros(),
        undamped_decrease: f64::INFINITY,
        candidate: None,
    };
    let control = Control {
        damping: 0.0,
        first_damping: FIRST_DAMPING,
        max_iterations: options.max_iterations,
    };
    let (termination, iterations) = minimise(&mut problem, &control)?;
    let Reprojection { pose, normal, .. } = problem;
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
    let singular = |error| match error {
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
    };
    let factor = cholesky(information).map_err(singular)?;
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
    linalg::covariance(&factor).map_err(singular)
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
            let c = correspondence;
            c.shape
                .residual(&c.pixel_ideal, &pixel, c.sigma_px)
                .norm_squared()
        })
}

/// The pose being refined.
struct Reprojection<'a> {
    pinhole: &'a Pinhole,
    correspondences: &'a [Correspondence],
    loss: &'a RobustLoss,
    pose: Se3,
    normal: NormalEquations,
    delta: Vector6<f64>,
    /// Decrease of the sum of losses that the undamped step promises; infinite if there is none.
    undamped_decrease: f64,
    candidate: Option<(Se3, NormalEquations)>,
}

impl Problem for Reprojection<'_> {
    type Error = NoPose;

    fn cost(&self) -> f64 {
        self.normal.robust_chi_square
    }

    fn solve(&mut self, damping: f64) -> Result<Option<Model>, NoPose> {
        let NormalEquations {
            information,
            gradient,
            ..
        } = &self.normal;
        // At a start far away the undamped system may be singular; the end may not.
        let undamped = cholesky(information).map(|factor| factor.solve(gradient));
        self.undamped_decrease = match &undamped {
            Ok(step) => step.dot(gradient).max(0.0),
            Err(_) => f64::INFINITY,
        };
        let step = if damping > 0.0 {
            let mut damped = *information;
            for k in 0..6 {
                damped[(k, k)] *= 1.0 + damping;
            }
            cholesky(&damped).map(|factor| factor.solve(gradient))
        } else {
            undamped
        };
        let Ok(delta) = step else {
            return Ok(None);
        };
        self.delta = delta;
        let scaled = information.diagonal().component_mul(&delta);
        Ok(Some(Model {
            decrease: delta.dot(gradient) + damping * scaled.dot(&delta),
            length: self.undamped_decrease.sqrt(),
        }))
    }

    fn evaluate(&mut self, _model: &Model) -> Option<Trial> {
        let pose = self.pose.compose(&Se3::exp(&self.delta));
        let normal = normal_equations(self.pinhole, &pose, self.correspondences, self.loss).ok()?;
        let trial = Trial::new(normal.robust_chi_square);
        self.candidate = Some((pose, normal));
        Some(trial)
    }

    fn accept(&mut self) -> Result<(), NoPose> {
        if let Some((pose, normal)) = self.candidate.take() {
            (self.pose, self.normal) = (pose, normal);
        }
        Ok(())
    }

    fn before_step(&self, model: &Model, _damping: f64) -> Option<Termination> {
        if model.length <= STEP_TOLERANCE_SIGMAS {
            return Some(Termination::Step {
                length: model.length,
                threshold: STEP_TOLERANCE_SIGMAS,
            });
        }
        let rounding = 4.0 * f64::EPSILON * self.cost() * self.correspondences.len() as f64;
        (self.undamped_decrease <= rounding).then_some(Termination::PredictedDecrease {
            decrease: self.undamped_decrease,
            threshold: rounding,
        })
    }

    fn after_refusal(&self, _model: &Model) -> Option<Termination> {
        let threshold = ROUNDING_TOLERANCE * self.cost();
        (self.undamped_decrease <= threshold).then_some(Termination::PredictedDecrease {
            decrease: self.undamped_decrease,
            threshold,
        })
    }
}

struct NormalEquations {
    information: Matrix6<f64>,
    gradient: Vector6<f64>,
    chi_square: f64,
    robust_chi_square: f64,
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
        let (residual, whitened) = c
            .shape
            .whitened(&c.pixel_ideal, &pixel, &by_point, c.sigma_px);
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
