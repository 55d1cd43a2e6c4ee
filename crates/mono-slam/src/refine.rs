//! A camera, its mount and the wheels refined over recorded runs: one batch over all of them with their constants freed.

use nalgebra::{Matrix3, Rotation3, Vector3};
use slam_batch::{BatchError, Constant, Constants, LearnedConstant, Model, solve};
use slam_io::{CameraFile, SigmaFile};
use thiserror::Error;

use crate::recorded::RecordedRun;

/// Why nothing was refined.
#[derive(Debug, Error)]
pub enum RefineError {
    /// No run was given.
    #[error("expected at least one run, found none")]
    NoRuns,
    /// The runs were made with different cameras.
    #[error("expected runs of one camera, run {index} has another camera.toml than the first")]
    OtherCamera {
        /// Index of the run.
        index: usize,
    },
    /// The batch has no solution.
    #[error("no batch solution: {0}")]
    Batch(#[from] BatchError),
    /// The batch has not converged.
    #[error("the batch has not converged after {iterations} iterations")]
    NotConverged {
        /// Iterations made.
        iterations: usize,
    },
}

/// A refined camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Refinement {
    /// The camera of the runs.
    pub before: CameraFile,
    /// The refined camera with its standard deviations.
    pub after: CameraFile,
    /// All constants that were free.
    pub constants: Vec<LearnedConstant>,
    /// Sightings used.
    pub sightings: usize,
    /// Keyframes of all runs.
    pub keyframes: usize,
}

/// Standard deviations before the runs: those of the camera file where it has them, else focal length 1 %, principal
/// point 2 px, k1 0.01, mount yaw 10 mrad, lever arm 2 cm; wheels and carrier as a run has them.
#[must_use]
pub fn priors(run: &RecordedRun) -> Constants {
    let known = &run.camera.sigma;
    let mut priors = Model::of(&run.config)
        .constants
        .with(Constant::WheelScale, run.config.odometry.scale_bias)
        .with(Constant::MountYaw, 0.01)
        .with(Constant::LeverX, 0.02)
        .with(Constant::LeverY, 0.02)
        .with(Constant::FocalScale, 0.01)
        .with(Constant::PrincipalX, 2.0)
        .with(Constant::PrincipalY, 2.0)
        .with(Constant::Lens, 0.01);
    for (constant, sigma) in [
        (Constant::FocalScale, known.fx.map(|s| s / run.camera.fx)),
        (Constant::PrincipalX, known.cx),
        (Constant::PrincipalY, known.cy),
        (Constant::Lens, known.k1),
        (Constant::MountYaw, known.mount_yaw),
        (Constant::LeverX, known.lever_x),
        (Constant::LeverY, known.lever_y),
    ] {
        if let Some(sigma) = sigma {
            priors[constant] = sigma;
        }
    }
    priors
}

/// Refines the camera of `runs`, whose noise is that of the first run's configuration.
///
/// # Errors
/// [`RefineError`].
pub fn refine(runs: &[RecordedRun], priors: &Constants) -> Result<Refinement, RefineError> {
    let first = runs.first().ok_or(RefineError::NoRuns)?;
    let mut model = Model::of(&first.config);
    model.constants = *priors;
    model.scale_bias = 0.0;
    let mut problem = first.problem(model.clone());
    for (index, run) in runs.iter().enumerate().skip(1) {
        if run.camera != first.camera {
            return Err(RefineError::OtherCamera { index });
        }
        problem.append(run.problem(model.clone()));
    }
    let solution = solve(&problem)?;
    if !solution.converged {
        return Err(RefineError::NotConverged {
            iterations: solution.iterations,
        });
    }
    let learned = |constant: Constant| solution.learned(constant);
    let mut after = first.camera.clone();
    let mut sigma = SigmaFile::default();
    if let Some(c) = learned(Constant::FocalScale) {
        sigma.fx = Some(after.fx * c.sigma);
        sigma.fy = Some(after.fy * c.sigma);
        after.fx *= 1.0 + c.value;
        after.fy *= 1.0 + c.value;
    }
    if let Some(c) = learned(Constant::PrincipalX) {
        after.cx += c.value;
        sigma.cx = Some(c.sigma);
    }
    if let Some(c) = learned(Constant::PrincipalY) {
        after.cy += c.value;
        sigma.cy = Some(c.sigma);
    }
    if let Some(c) = learned(Constant::Lens) {
        let mut coefficients = after.distortion.parameters();
        if let Some(k1) = coefficients.first_mut() {
            *k1 += c.value;
        }
        if let Ok(lens) = after.distortion.with_parameters(&coefficients) {
            after.distortion = lens;
            sigma.k1 = Some(c.sigma);
        }
    }
    if let Some(c) = learned(Constant::MountYaw) {
        let rows = after.mount.rotation_body_from_camera;
        let nominal = Matrix3::from_fn(|i, j| rows[i][j]);
        let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), c.value).matrix() * nominal;
        after.mount.rotation_body_from_camera =
            std::array::from_fn(|i| std::array::from_fn(|j| turned[(i, j)]));
        sigma.mount_yaw = Some(c.sigma);
    }
    for (axis, constant) in [Constant::LeverX, Constant::LeverY].into_iter().enumerate() {
        if let Some(c) = learned(constant) {
            after.mount.position_in_body[axis] += c.value;
            let known = if axis == 0 {
                &mut sigma.lever_x
            } else {
                &mut sigma.lever_y
            };
            *known = Some(c.sigma);
        }
    }
    after.sigma = sigma;
    Ok(Refinement {
        before: first.camera.clone(),
        after,
        sightings: solution.fit.sightings,
        keyframes: solution.poses.len(),
        constants: solution.constants,
    })
}
