//! The consensus of the matches of a frame.
//!
//! A robust pose posterior is formed from all matches; then each match is gated by what the posterior leaves of its
//! innovation covariance. This is repeated once without the outliers.

use super::association::{Association, AssociationParams, Pair};
use super::frame::FrameFeatures;
use super::prediction::InView;
use crate::filter::likelihood::mahalanobis_2d;
use crate::filter::linearised::{PoseLinearisation, PosePosterior, pose_posterior};
use crate::filter::motion::MotionPrior;
use crate::filter::observation::{MatchedFeature, Prepared, Scoring};
use crate::filter::pixel_noise::PixelNoise;
use crate::rig::Rig;

/// Judges the pairs of landmark (its place in view) and keypoint by a robust pose posterior of all of them.
#[must_use]
pub(crate) fn consensus<'a>(
    rig: &Rig,
    frame: &FrameFeatures<'_>,
    pairs: &[(usize, usize)],
    in_view: InView<'a>,
    prior: &MotionPrior,
    params: &AssociationParams,
) -> Association<'a> {
    let mut candidates: Vec<(Pair, Prepared)> = Vec::with_capacity(pairs.len());
    for &(position, k) in pairs {
        let Some(pixel) = frame.ideal[k] else {
            continue;
        };
        let (id, predicted) = &in_view.landmarks()[position];
        let mut prepared = predicted.prepared;
        prepared.pixel = pixel;
        prepared.noise = PixelNoise::shaped(&frame.shape[k], params.gate_sigma_px());
        prepared.scoring = scoring(rig, &prepared, prior, params);
        let nis = mahalanobis_2d(&(pixel - predicted.pixel), &predicted.covariance);
        let feature = MatchedFeature {
            id: *id,
            pixel,
            noise: frame.noise(k, params.sigma_px),
            scoring: prepared.scoring,
            prototype: predicted.prototype,
        };
        candidates.push((
            Pair {
                keypoint: k,
                feature,
                predicted: predicted.pixel,
                nis,
            },
            prepared,
        ));
    }
    let mut keep = vec![true; candidates.len()];
    let mut posterior = PosePosterior::prior();
    for _ in 0..2 {
        let used: Vec<Option<Prepared>> = candidates
            .iter()
            .zip(&keep)
            .map(|((_, p), k)| k.then_some(*p))
            .collect();
        posterior = pose_posterior(rig, prior, &used, params.iterations);
        let linearisation = PoseLinearisation::new(rig, prior, &posterior);
        for ((_, prepared), keep) in candidates.iter().zip(&mut keep) {
            *keep = linearisation.linearise(prepared).is_some_and(|line| {
                let error = prepared.pixel - line.mean;
                params.gate.admits(&error, &line.innovation())
            });
        }
    }
    let (mut inliers, mut outliers) = (Vec::new(), Vec::new());
    for ((pair, _), keep) in candidates.into_iter().zip(keep) {
        if keep {
            inliers.push(pair);
        } else {
            outliers.push(pair);
        }
    }
    Association {
        inliers,
        outliers,
        in_view,
        camera: posterior.mean_pose(prior).place(rig),
        posterior,
    }
}

/// Open depth is scored across the epipolar line, but only where depth moves
/// the pixel by more than its noise: otherwise both coordinates tell of the pose.
fn scoring(
    rig: &Rig,
    prepared: &Prepared,
    prior: &MotionPrior,
    params: &AssociationParams,
) -> Scoring {
    let Some(sigma_rho) = prepared.open_sigma(params.open_depth) else {
        return Scoring::Full;
    };
    let camera = prior.mean.place(rig);
    match prepared
        .geometry
        .parameter_jacobian(rig.pinhole(), &camera, &prepared.mean)
    {
        Some(j)
            if mahalanobis_2d(&(j.column(2) * sigma_rho), prepared.noise.covariance()) > 1.0 =>
        {
            Scoring::AcrossEpipolar
        }
        _ => Scoring::Full,
    }
}
