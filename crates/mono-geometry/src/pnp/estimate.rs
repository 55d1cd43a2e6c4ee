//! A pose from four or more points without a start.
//!
//! Steps: [`TRIANGLES`] wide triangles of the image, each from a first vertex, the point farthest from it, and the one
//! that spans the largest area with both; P3P on each; all poses ranked by the sum of squared errors of all points; the
//! best [`STARTS`] that differ are refined, the lowest is kept.
//!
//! Degenerate: every triangle collinear, or no pose with all points in front: [`NoPose::NoCandidate`]. With wrong matches
//! among the points use [`super::estimate_pose_ransac`].

use super::correspondence::{Correspondence, NoPose, check};
use super::p3p::p3p;
use super::refine::{PoseEstimate, RefineOptions, refine_pose, squared_error};
use crate::camera::Pinhole;
use crate::se3::Se3;
use crate::so3;

/// A pose and the next best minimum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseFit {
    /// The lowest minimum found.
    pub estimate: PoseEstimate,
    /// Robust chi-square of the next minimum, if another was found: close to the first, the pose is ambiguous.
    pub runner_up_chi_square: Option<f64>,
}

/// First vertices tried.
pub(super) const TRIANGLES: usize = 6;
/// Poses refined.
pub(super) const STARTS: usize = 4;

/// The pose of least reprojection error of at least four points, all of them true matches. O(points) per candidate.
///
/// # Errors
/// [`NoPose`].
pub fn estimate_pose(
    pinhole: &Pinhole,
    correspondences: &[Correspondence],
    options: &RefineOptions,
) -> Result<PoseFit, NoPose> {
    check(correspondences, 4)?;
    let count = correspondences.len();
    let triangles = TRIANGLES.min(count);
    let mut candidates: Vec<(f64, Se3)> = Vec::new();
    let mut poses = 0;
    for k in 0..triangles {
        let sample = triangle(correspondences, k * count / triangles);
        let bearings = sample.map(|i| pinhole.bearing(&correspondences[i].pixel_ideal));
        let points = sample.map(|i| correspondences[i].point_in_world);
        for pose in p3p(&bearings, &points).as_slice() {
            poses += 1;
            let camera_from_world = pose.inverse();
            let cost: f64 = correspondences
                .iter()
                .map(|c| {
                    options
                        .loss
                        .at(squared_error(pinhole, &camera_from_world, c))
                        .rho
                })
                .sum();
            if cost.is_finite() {
                candidates.push((cost, *pose));
            }
        }
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut minima: Vec<PoseEstimate> = Vec::new();
    let mut failure = NoPose::NoCandidate {
        triangles,
        candidates: poses,
    };
    let mut starts: Vec<Se3> = Vec::new();
    for (_, pose) in candidates {
        if starts.len() >= STARTS {
            break;
        }
        // Triangles agree on the true pose up to noise: poses within a tenth of a radian lead to one minimum.
        let turned =
            |other: &Se3| so3::log(&(other.rotation.inverse() * pose.rotation)).norm() > 0.1;
        if !starts.iter().all(turned) {
            continue;
        }
        starts.push(pose);
        match refine_pose(pinhole, &pose, correspondences, options) {
            Ok(estimate) => minima.push(estimate),
            Err(error) => {
                if minima.is_empty() {
                    failure = error;
                }
            }
        }
    }
    minima.sort_by(|a, b| a.robust_chi_square.total_cmp(&b.robust_chi_square));
    let estimate = *minima.first().ok_or(failure)?;
    let runner_up_chi_square = minima
        .iter()
        .skip(1)
        .find(|other| {
            let apart = estimate
                .world_from_camera
                .inverse()
                .compose(&other.world_from_camera);
            let delta = apart.log();
            // The same minimum again is within a fraction of its own standard deviations.
            (0..6).any(|k| delta[k].abs() > 1e-3 * estimate.covariance[(k, k)].sqrt())
        })
        .map(|other| other.robust_chi_square);
    Ok(PoseFit {
        estimate,
        runner_up_chi_square,
    })
}

/// A wide triangle with the given first vertex.
fn triangle(correspondences: &[Correspondence], first: usize) -> [usize; 3] {
    let pixel = |i: usize| correspondences[i].pixel_ideal;
    let largest = |measure: &dyn Fn(usize) -> f64| {
        (0..correspondences.len()).fold((0, f64::NEG_INFINITY), |best, i| {
            let value = measure(i);
            if value > best.1 { (i, value) } else { best }
        })
    };
    let from_first = |i: usize| pixel(i) - pixel(first);
    let (second, _) = largest(&|i| from_first(i).norm_squared());
    let along = from_first(second);
    let (third, _) = largest(&|i| along.perp(&from_first(i)).abs());
    [first, second, third]
}
