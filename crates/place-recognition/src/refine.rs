//! The pose of least squared error on its inliers, each weighed by its own 2 x 2 covariance.
//!
//! Problem: minimise sum e_i^T S_i^-1 e_i over the pose, S_i from [`crate::projection`]. S depends on the pose, too; it is
//! held within a step and taken anew after it (Gauss-Newton on weights that follow), since how it changes says little.
//!
//! Steps: solve H delta = g, H = sum J^T S^-1 J; damp by Levenberg's rule where the cost grows; stop when a step is below
//! 1e-4 standard deviations. The covariance is H^-1: of independent errors of the pixels and of the landmarks. What
//! landmarks have in common (a map that drifted as a whole) is not in it.
//!
//! Degenerate: collinear points, or all in one place, leave H singular: `None`.

use mono_geometry::{Pinhole, Se3};
use nalgebra::{Matrix6, Vector6};

use crate::point_match::PointMatch;
use crate::projection::residual;

/// Squared length of the last step, in variances.
const STEP_TOLERANCE: f64 = 1e-8;
/// Attempts at one step, each damped ten times more.
const ATTEMPTS: usize = 6;
/// Smallest share of the diagonal of H that a pivot may keep: sums of some hundred products carry 1e-14.
const PIVOT_TOLERANCE: f64 = 1e-12;

/// A pose with its covariance.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Refined {
    pub(crate) world_from_camera: Se3,
    pub(crate) covariance: Matrix6<f64>,
    pub(crate) chi_square: f64,
}

struct Normal {
    information: Matrix6<f64>,
    gradient: Vector6<f64>,
    cost: f64,
}

/// The minimum next to `start`; `None` where the matches leave a motion free or one falls behind the camera.
pub(crate) fn refine(
    pinhole: &Pinhole,
    start: &Se3,
    matches: &[PointMatch],
    chosen: &[usize],
    iterations: usize,
) -> Option<Refined> {
    let mut pose = *start;
    let mut normal = normal_equations(pinhole, &pose, matches, chosen)?;
    for _ in 0..iterations {
        let mut damping = 0.0;
        let mut moved = None;
        for _ in 0..ATTEMPTS {
            let mut damped = normal.information;
            for k in 0..6 {
                damped[(k, k)] *= 1.0 + damping;
            }
            if let Some(factor) = damped.cholesky() {
                let delta = factor.solve(&normal.gradient);
                let candidate = pose.compose(&Se3::exp(&delta));
                let next = normal_equations(pinhole, &candidate, matches, chosen);
                // A little uphill is the weights', not the pose's.
                if let Some(next) = next.filter(|n| n.cost <= normal.cost * 1.001 + 1e-9) {
                    moved = Some((candidate, next, delta.dot(&(normal.information * delta))));
                    break;
                }
            }
            damping = if damping > 0.0 { 10.0 * damping } else { 1e-3 };
        }
        let Some((candidate, next, length)) = moved else {
            break;
        };
        (pose, normal) = (candidate, next);
        if length < STEP_TOLERANCE {
            break;
        }
    }
    let factor = normal.information.cholesky()?;
    let pivots = factor.l_dirty().diagonal();
    let determined =
        (0..6).all(|k| pivots[k] * pivots[k] > PIVOT_TOLERANCE * normal.information[(k, k)]);
    if !determined {
        return None;
    }
    let inverse = factor.inverse();
    let covariance = 0.5 * (inverse + inverse.transpose());
    covariance.iter().all(|v| v.is_finite()).then_some(Refined {
        world_from_camera: pose,
        covariance,
        chi_square: normal.cost,
    })
}

/// H, g and the cost at a pose perturbed at the right, (rho, omega) in camera axes.
fn normal_equations(
    pinhole: &Pinhole,
    world_from_camera: &Se3,
    matches: &[PointMatch],
    chosen: &[usize],
) -> Option<Normal> {
    let camera_from_world = world_from_camera.inverse();
    let mut normal = Normal {
        information: Matrix6::zeros(),
        gradient: Vector6::zeros(),
        cost: 0.0,
    };
    for m in chosen.iter().map(|index| &matches[*index]) {
        let r = residual(pinhole, &camera_from_world, m, f64::INFINITY)?;
        let weight = r.covariance.try_inverse()?;
        let jacobian =
            r.by_camera_point * world_from_camera.inverse_point_jacobian(&m.point_in_world);
        let weighted = jacobian.transpose() * weight;
        normal.information += weighted * jacobian;
        normal.gradient += weighted * r.error;
        normal.cost += r.error.dot(&(weight * r.error));
    }
    normal.cost.is_finite().then_some(normal)
}
