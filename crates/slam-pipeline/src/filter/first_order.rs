//! The pose posterior of an extended Kalman filter, as FastSLAM 2.0 draws from it: one linearisation at the mean of the
//! prior, no sigma points.
//!
//! The first-order linearisation is the limit of the statistical one for a spread that goes to zero, so the sigma points
//! of a prior shrunk by [`SHRINK`] give its Jacobians as central differences; mean and noise corrections vanish with the
//! square of it. The update is that of [`pose_posterior`](super::linearised::pose_posterior) without its iteration.

use super::linearised::{PoseLinearisation, PosePosterior};
use super::motion::MotionPrior;
use super::observation::{Prepared, Scoring};
use super::pose::{PoseMatrix, PoseStep};
use crate::rig::Rig;

/// Share of the prior's spread at which the derivatives are taken: the error of the difference falls with its square,
/// and rounding grows with its inverse.
const SHRINK: f64 = 1e-3;

/// Posterior of the pose given `matches` after one first-order update.
#[must_use]
pub(crate) fn first_order_posterior(
    rig: &Rig,
    prior: &MotionPrior,
    matches: &[Option<Prepared>],
) -> PosePosterior {
    let mut near = prior.clone();
    near.factor *= SHRINK;
    let linearisation = PoseLinearisation::new(rig, &near, &PosePosterior::prior());
    let mut information = PoseMatrix::identity();
    let mut vector = PoseStep::zeros();
    for prepared in matches.iter().flatten() {
        let Some(line) = linearisation.linearise(prepared) else {
            continue;
        };
        let slope = line.slope / SHRINK;
        let residual = prepared.pixel - line.mean;
        match prepared.scoring {
            Scoring::Full => {
                let Some(chol) = line.noise.cholesky() else {
                    continue;
                };
                let weighted = chol.solve(&slope);
                information += slope.transpose() * weighted;
                vector += weighted.transpose() * residual;
            }
            Scoring::AcrossEpipolar => {
                let normal = line.across;
                let variance = (normal.transpose() * line.noise * normal)[(0, 0)];
                let row = slope.tr_mul(&normal);
                information += row * row.transpose() / variance;
                vector += row * (normal.dot(&residual) / variance);
            }
            Scoring::MapOnly => {}
        }
    }
    let Some(chol) = information.cholesky() else {
        return PosePosterior::prior();
    };
    let Some(factor) = chol.inverse().cholesky().map(|c| c.l()) else {
        return PosePosterior::prior();
    };
    PosePosterior {
        mean: chol.solve(&vector),
        factor,
        log_det_factor: factor.diagonal().iter().map(|d| d.ln()).sum(),
    }
}
