//! Covariance of the camera and of the poses, and the directions that the views leave open.
//!
//! The information of the camera with the poses eliminated is Jc^T (I - Qp Qp^T) Jc, with Jp = Qp R the QR factors of
//! each view's pose columns. It is never formed: squaring it would turn a weak direction into rounding errors. Steps:
//!
//! 1. a view's whitened rows; what Qp explains is projected out of Jc (twice, for the rounding errors of the first
//!    time);
//! 2. columns scaled to the length they had before: a singular value is the share of its information that a combination
//!    keeps although the poses are unknown;
//! 3. the stacked rows reduced to p x p by QR, then SVD, S = A V: covariance of the scaled parameters V S^-2 V^T;
//! 4. all times the variance factor, the sum of squared normalised residuals over the degrees of freedom;
//! 5. a pose: G = V_v^-1 W_v^T = R^-1 Qp^T Jc, covariance (R^T R)^-1 factor + G cov G^T.
//!
//! Degenerate: singular values of rounding size are directions without information; a parameter that takes part in one
//! has an infinite variance, and no pose has a covariance.

use nalgebra::{DMatrix, DVector, Matrix6};

use super::start::UsableView;
use crate::camera::{Camera, ParameterJacobian};
use crate::error::GeometryError;
use crate::linalg::svd;
use crate::robust_loss::RobustLoss;
use crate::se3::Se3;

/// Share of a parameter in a direction without information from which on it counts as open.
const OPEN_SHARE: f64 = 1e-6;

pub(super) struct Uncertainty {
    /// Covariance of the free parameters; see [`super::Calibration::covariance`].
    pub(super) camera: DMatrix<f64>,
    /// Of every pose; `None` if a direction is open.
    pub(super) poses: Vec<Option<Matrix6<f64>>>,
    /// Directions without information, in the parameters' own units.
    pub(super) open: Vec<DVector<f64>>,
    /// Largest over smallest singular value of the scaled reduced Jacobian.
    pub(super) condition: f64,
    pub(super) variance_factor: f64,
    pub(super) degrees_of_freedom: usize,
    /// Largest move of a corner, pixels, by a unit change of each parameter.
    pub(super) reach_px: DVector<f64>,
}

/// Evaluates the uncertainty at a solution. O(corners (p + 6)^2).
///
/// # Errors
/// [`GeometryError::Svd`] if a number is not finite.
pub(super) fn uncertainty(
    views: &[UsableView<'_>],
    free: usize,
    loss: RobustLoss,
    camera: &Camera,
    poses: &[Se3],
) -> Result<Uncertainty, GeometryError> {
    let corners: usize = views.iter().map(|v| v.view.corners.len()).sum();
    let mut stacked = DMatrix::zeros((2 * corners).max(free), free);
    let mut lengths = DVector::zeros(free);
    let mut reach_px = DVector::zeros(free);
    let mut squared = 0.0;
    let mut pose_parts = Vec::with_capacity(views.len());
    let mut row = 0;
    for (view, pose) in views.iter().zip(poses) {
        let count = 2 * view.view.corners.len();
        let mut by_camera = DMatrix::zeros(count, free);
        let mut by_pose = DMatrix::zeros(count, 6);
        for (k, corner) in view.view.corners.iter().enumerate() {
            let point = corner.board_m.push(0.0);
            let Some((pixel, by_point, by_parameters)) =
                camera.project_with_jacobians(&pose.transform_point(&point))
            else {
                continue;
            };
            let error = (corner.pixel - pixel) / corner.sigma_px;
            let weight = loss.at(error.norm_squared()).weight;
            squared += weight * error.norm_squared();
            let scale = weight.sqrt() / corner.sigma_px;
            let block = by_point * pose.point_jacobian(&point) * scale;
            for axis in 0..2 {
                for j in 0..6 {
                    by_pose[(2 * k + axis, j)] = block[(axis, j)];
                }
                for j in 0..free {
                    by_camera[(2 * k + axis, j)] = by_parameters[(axis, j)] * scale;
                }
            }
            for j in 0..free {
                reach_px[j] = f64::max(reach_px[j], column_length(&by_parameters, j));
            }
        }
        for j in 0..free {
            lengths[j] += by_camera.column(j).norm_squared();
        }
        let (q, r) = by_pose.qr().unpack();
        let mut explained = q.transpose() * &by_camera;
        let mut rest = &by_camera - &q * &explained;
        let again = q.transpose() * &rest;
        rest -= &q * &again;
        explained += again;
        stacked.view_mut((row, 0), (count, free)).copy_from(&rest);
        row += count;
        pose_parts.push((r, explained));
    }
    let lengths = lengths.map(f64::sqrt);
    for j in 0..free {
        stacked.column_mut(j).unscale_mut(lengths[j]);
    }
    let decomposition = svd(&stacked)?;
    let rank = decomposition.rank();
    let degrees_of_freedom = (2 * corners).saturating_sub(free + 6 * views.len());
    let variance_factor = squared / degrees_of_freedom.max(1) as f64;
    // Columns of V S^-1, back in the units of the parameters.
    let mut factor = DMatrix::zeros(free, rank);
    for k in 0..rank {
        for j in 0..free {
            factor[(j, k)] =
                decomposition.v[(j, k)] / (decomposition.singular_values[k] * lengths[j]);
        }
    }
    let mut covariance = &factor * factor.transpose() * variance_factor;
    let open: Vec<DVector<f64>> = (rank..free)
        .map(|k| decomposition.v.column(k).component_div(&lengths))
        .collect();
    let pose_covariances = pose_parts
        .iter()
        .map(|(r, explained)| {
            if rank < free {
                return None;
            }
            let inverse = r.solve_upper_triangular(&DMatrix::identity(6, 6))?;
            let gain = r.solve_upper_triangular(explained)?;
            let total = &inverse * inverse.transpose() * variance_factor
                + &gain * &covariance * gain.transpose();
            let total = Matrix6::from_fn(|i, j| 0.5 * (total[(i, j)] + total[(j, i)]));
            total.iter().all(|v| v.is_finite()).then_some(total)
        })
        .collect();
    for j in 0..free {
        if (rank..free).any(|k| decomposition.v[(j, k)].abs() > OPEN_SHARE) {
            covariance.row_mut(j).fill(0.0);
            covariance.column_mut(j).fill(0.0);
            covariance[(j, j)] = f64::INFINITY;
        }
    }
    let values = &decomposition.singular_values;
    let condition = if rank < free {
        f64::INFINITY
    } else {
        values[0] / values[free - 1]
    };
    Ok(Uncertainty {
        camera: covariance,
        poses: pose_covariances,
        open,
        condition,
        variance_factor,
        degrees_of_freedom,
        reach_px,
    })
}

fn column_length(jacobian: &ParameterJacobian, column: usize) -> f64 {
    jacobian[(0, column)].hypot(jacobian[(1, column)])
}
