//! A pose among wrong matches: P3P in the driver of [`crate::ransac`].
//!
//! Steps: samples of three give up to four poses by P3P; each is scored by the truncated squared reprojection errors (two
//! degrees of freedom each) of all correspondences, points behind the camera counting as outliers; a new best is refined
//! on its inliers; at the end the pose is refined on all inliers, which are then counted anew. Inliers of a truncated
//! Gaussian: the covariance is that of least squares on them, by the truncation slightly small (at 99 % by 3 %).
//!
//! Degenerate: a sample of collinear points or coincident rays gives no pose and costs a trial. A pose always agrees with
//! its own three points; fewer than `min_inliers` are no evidence and are refused.

use super::correspondence::{Correspondence, NoPose, check};
use super::p3p::p3p;
use super::refine::{PoseEstimate, RefineOptions, refine_pose, squared_error};
use crate::camera::Pinhole;
use crate::ransac::{Msac, Options, Report, Sampler, Solver, Stop, ransac};
use crate::robust_loss::RobustLoss;
use crate::se3::Se3;

/// When to believe a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobustPoseOptions {
    /// Largest squared reprojection error of an inlier, in variances: a chi-square quantile of two degrees of freedom.
    pub threshold: f64,
    /// Smallest number of inliers, at least 4.
    pub min_inliers: usize,
    /// Options of the driver, the seed among them.
    pub ransac: Options,
    /// Options of the refinements.
    pub refine: RefineOptions,
}

impl Default for RobustPoseOptions {
    /// 99 % of the true matches (9.21), six inliers, plain least squares on them.
    fn default() -> Self {
        Self {
            threshold: 9.21,
            min_inliers: 6,
            ransac: Options::default(),
            refine: RefineOptions::default(),
        }
    }
}

/// A pose, what agrees with it, and how it was found.
#[derive(Debug, Clone, PartialEq)]
pub struct RobustPose {
    /// The refined pose; its sums are over the inliers.
    pub estimate: PoseEstimate,
    /// Indices of the correspondences within the threshold of the refined pose, ascending.
    pub inliers: Vec<usize>,
    /// Samples drawn.
    pub trials: usize,
    /// Why the search ended.
    pub stop: Stop,
}

/// P3P as the minimal solver, [`refine_pose`] as the refit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseSolver {
    /// The camera.
    pub pinhole: Pinhole,
    /// Options of the refits.
    pub refine: RefineOptions,
}

impl Solver for PoseSolver {
    type Datum = Correspondence;
    type Model = Se3;

    fn sample_size(&self) -> usize {
        3
    }

    fn fit(&self, data: &[Correspondence], sample: &[usize], models: &mut Vec<Se3>) {
        if let [i, j, k] = *sample {
            let chosen = [data[i], data[j], data[k]];
            let bearings = chosen.map(|c| self.pinhole.bearing(&c.pixel_ideal));
            models.extend_from_slice(p3p(&bearings, &chosen.map(|c| c.point_in_world)).as_slice());
        }
    }

    fn refit(&self, data: &[Correspondence], inliers: &[usize], model: &Se3) -> Option<Se3> {
        // Three points are met exactly already.
        if inliers.len() < 4 {
            return None;
        }
        let chosen: Vec<_> = inliers.iter().map(|index| data[*index]).collect();
        refine_pose(&self.pinhole, model, &chosen, &self.refine)
            .ok()
            .map(|estimate| estimate.world_from_camera)
    }
}

/// The pose that most correspondences agree with, refined on them; deterministic by `options.ransac.seed`.
///
/// The sampler is [`crate::ransac::Uniform`], or [`crate::ransac::Prosac`] for matches with a quality.
///
/// # Errors
/// [`NoPose`]: unusable input, too few inliers, or inliers that leave a motion free.
///
/// ```
/// use mono_geometry::pnp::{Correspondence, RobustPoseOptions, estimate_pose_ransac};
/// use mono_geometry::ransac::Uniform;
/// use mono_geometry::{NoiseShape, Pinhole, Se3, so3};
/// use nalgebra::{Vector2, Vector3};
///
/// let pinhole = Pinhole { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0 };
/// let truth = Se3::new(so3::exp(&Vector3::new(0.05, -0.2, 0.1)), Vector3::new(0.4, -0.1, 0.3));
/// let matches: Vec<_> = (0..60_u32)
///     .map(|i| {
///         let (a, b) = (f64::from(i % 10), f64::from(i / 10));
///         let point_in_world = Vector3::new(0.3 * a - 1.2, 0.3 * b - 0.8, 4.0 + ((a + 2.0 * b) % 3.0));
///         let seen = truth.inverse().transform_point(&point_in_world);
///         // Every third is a wrong match.
///         let off = if i % 3 == 0 { Vector2::new(40.0 - 9.0 * a, 25.0) } else { Vector2::zeros() };
///         let pixel_ideal = pinhole.project(&seen).expect("in front") + off;
///         Correspondence { point_in_world, pixel_ideal, sigma_px: 1.0, shape: NoiseShape::ROUND }
///     })
///     .collect();
/// let found = estimate_pose_ransac(&pinhole, &matches, &mut Uniform::default(), &RobustPoseOptions::default())?;
/// assert_eq!(found.inliers.len(), 40);
/// let error = found.estimate.world_from_camera.inverse().compose(&truth).log();
/// assert!(error.norm() < 1e-6);
/// # Ok::<(), mono_geometry::pnp::NoPose>(())
/// ```
pub fn estimate_pose_ransac<P: Sampler>(
    pinhole: &Pinhole,
    correspondences: &[Correspondence],
    sampler: &mut P,
    options: &RobustPoseOptions,
) -> Result<RobustPose, NoPose> {
    let required = options.min_inliers.max(4);
    check(correspondences, required)?;
    // Local refits inside the search need no more than the basin.
    let solver = PoseSolver {
        pinhole: *pinhole,
        refine: RefineOptions {
            loss: RobustLoss::None,
            max_iterations: 5,
        },
    };
    let scorer = Msac::new(
        |pose: &Se3, c: &Correspondence| squared_error(pinhole, &pose.inverse(), c),
        options.threshold,
    );
    let Report {
        best, trials, stop, ..
    } = ransac(&solver, &scorer, sampler, correspondences, &options.ransac);
    let best = best.ok_or(NoPose::NoConsensus {
        inliers: 0,
        required,
    })?;
    let mut inliers = best.inliers;
    let mut pose = best.model;
    // The set and the pose depend on each other; a handful of rounds settles them, and a cycle is cut there.
    for _ in 0..10 {
        if inliers.len() < required {
            return Err(NoPose::NoConsensus {
                inliers: inliers.len(),
                required,
            });
        }
        let chosen: Vec<_> = inliers
            .iter()
            .map(|index| correspondences[*index])
            .collect();
        let estimate = refine_pose(pinhole, &pose, &chosen, &options.refine)?;
        pose = estimate.world_from_camera;
        let camera_from_world = pose.inverse();
        let now: Vec<usize> = (0..correspondences.len())
            .filter(|i| {
                squared_error(pinhole, &camera_from_world, &correspondences[*i])
                    <= options.threshold
            })
            .collect();
        if now == inliers {
            return Ok(RobustPose {
                estimate,
                inliers,
                trials,
                stop,
            });
        }
        inliers = now;
    }
    let chosen: Vec<_> = inliers
        .iter()
        .map(|index| correspondences[*index])
        .collect();
    let estimate = refine_pose(pinhole, &pose, &chosen, &options.refine)?;
    Ok(RobustPose {
        estimate,
        inliers,
        trials,
        stop,
    })
}
