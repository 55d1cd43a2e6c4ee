//! From keypoints to matched landmarks (III.B, III.E).
//!
//! 1. [`predict`]: every landmark in the reference particle, with the innovation covariance S of pose prior, landmark
//!    and pixel noise.
//! 2. [`Matcher`]: the keypoint of each landmark, by gates and descriptors.
//! 3. [`consensus`]: matches that do not fit a pose posterior of all of them are outliers.
//!
//! The outcome is the same for all particles, so that their weights compare.

use super::association::{Association, AssociationParams};
use super::catalogue::Catalogue;
use super::consensus::consensus;
use super::frame::FrameFeatures;
use super::matching::Matcher;
use super::prediction::predict;
use crate::filter::motion::MotionPrior;
use crate::filter::particle::Particle;
use crate::rig::Rig;

/// Associates `frame` with the catalogue, seen from `reference` under `prior`.
#[must_use]
pub(crate) fn associate<'a>(
    rig: &Rig,
    frame: &FrameFeatures<'_>,
    catalogue: &'a Catalogue,
    reference: &Particle,
    prior: &MotionPrior,
    params: &AssociationParams,
) -> Association<'a> {
    let in_view = predict(rig, catalogue, reference, prior, params.gate_sigma_px());
    let pairs = Matcher {
        frame,
        catalogue,
        in_view: &in_view,
        params,
    }
    .keypoints();
    consensus(rig, frame, &pairs, in_view, prior, params)
}
