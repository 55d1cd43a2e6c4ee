//! Which keypoint shows which landmark (III.B, III.E).
//!
//! 1. Predict every landmark in the reference particle, with the innovation
//!    covariance S of pose prior, landmark and pixel noise; keep those in view.
//! 2. Landmarks with a narrow gate take the nearest descriptor in it.
//! 3. Descriptors: for every keypoint left, the two nearest landmarks in view,
//!    exactly, ratio test (Eq. 21), gate by S, one keypoint a landmark.
//! 4. Landmarks still without a keypoint look into their gates, however wide.
//! 5. Consensus: robust pose posterior from all matches, then each match is
//!    gated by what is left of S; repeated once without the outliers.
//!
//! The outcome is the same for all particles, so that their weights compare.

use std::collections::BTreeMap;

use feature_kdtree::{Descriptor, DescriptorIndex as _, ExactScan, distance_squared};
use nalgebra::{Matrix2, Vector2, Vector3};
use rayon::prelude::*;

use super::catalogue::{Catalogue, Stage};
use super::frame::FrameFeatures;
use crate::filter::landmark::{Landmark, Lens};
use crate::filter::likelihood::{Likelihood, mahalanobis_2d};
use crate::filter::linearised::{PoseLinearisation, PosePosterior, pose_posterior};
use crate::filter::motion::MotionPrior;
use crate::filter::observation::{MatchedFeature, Prepared, Scoring};
use crate::filter::particle::Particle;
use crate::filter::pose::PlacedCamera;

/// Settings of the association.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AssociationParams {
    /// Ratio of Eq. 21.
    pub ratio: f32,
    /// Gate on d^T S^-1 d, 2 degrees of freedom.
    pub gate: f64,
    /// Largest squared descriptor distance a predicted landmark accepts.
    pub guided_distance_squared: u32,
    /// Ratio of the guided search, within the gate.
    pub guided_ratio: f32,
    /// Depth is open when sigma_rho / rho exceeds this.
    pub open_depth: f64,
    /// Pixel noise, standard deviation.
    pub sigma_px: f64,
    /// Linearisations of the consensus.
    pub iterations: usize,
    /// Image size in pixels.
    pub image_size: Vector2<f64>,
}

/// A landmark predicted in view.
#[derive(Debug, Clone, Copy)]
pub struct Predicted {
    /// Predicted ideal pixel.
    pub pixel: Vector2<f64>,
    /// Innovation covariance.
    pub covariance: Matrix2<f64>,
    /// Direction from the camera, world axes, unit length.
    pub direction: Vector3<f64>,
    prepared: Prepared,
    prototype: Option<Landmark>,
}

impl Predicted {
    /// The landmark in the reference particle with the measurement of `feature`.
    #[must_use]
    pub fn measured(&self, feature: &MatchedFeature) -> Prepared {
        Prepared {
            pixel: feature.pixel,
            scoring: feature.scoring,
            ..self.prepared
        }
    }

    /// Angle between the rays of the first sighting and of `pixel`, radians, as
    /// far as the pose explains it: the rotation is taken out.
    #[must_use]
    pub fn parallax(&self, pixel: &Vector2<f64>, lens: &Lens, camera: &PlacedCamera) -> f64 {
        let n = lens.normalise(pixel);
        let seen = camera
            .camera_from_world
            .tr_mul(&Vector3::new(n.x, n.y, 1.0));
        self.prepared
            .geometry
            .ray(&self.prepared.mean)
            .base
            .angle(&seen)
    }
}

/// A keypoint matched to a landmark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Index of the keypoint.
    pub keypoint: usize,
    /// The match as the filter sees it.
    pub feature: MatchedFeature,
    /// Where the landmark was predicted, ideal pixel.
    pub predicted: Vector2<f64>,
    /// d^T S^-1 d against the prediction.
    pub nis: f64,
}

/// Outcome of the association of a frame.
#[derive(Debug)]
pub struct Association {
    /// Accepted matches in order of landmark id.
    pub inliers: Vec<Pair>,
    /// Matches the consensus rejected.
    pub outliers: Vec<Pair>,
    /// Landmarks predicted in view.
    pub in_view: BTreeMap<u32, Predicted>,
    /// Camera of the reference particle given the inliers.
    pub camera: PlacedCamera,
    /// Pose of the reference particle given the inliers.
    pub posterior: PosePosterior,
}

/// Associates `frame` with the catalogue, seen from `reference` under `prior`.
#[must_use]
pub fn associate(
    frame: &FrameFeatures<'_>,
    catalogue: &Catalogue,
    reference: &Particle,
    prior: &MotionPrior,
    likelihood: &Likelihood,
    params: &AssociationParams,
) -> Association {
    let in_view = predict(catalogue, reference, prior, likelihood, params);
    let pairs = match_descriptors(frame, catalogue, &in_view, params);
    consensus(frame, pairs, in_view, prior, likelihood, params)
}

fn predict(
    catalogue: &Catalogue,
    reference: &Particle,
    prior: &MotionPrior,
    likelihood: &Likelihood,
    params: &AssociationParams,
) -> BTreeMap<u32, Predicted> {
    let linearisation =
        PoseLinearisation::new(prior, &PosePosterior::prior(), &likelihood.body_from_camera);
    let mut in_view = BTreeMap::new();
    for (id, entry) in catalogue.iter() {
        let landmark = match entry.stage {
            Stage::Mapped => reference.map.get(id),
            Stage::Tentative => Some(&entry.prototype),
        };
        let Some(landmark) = landmark else { continue };
        let Some(geometry) = reference.geometry(landmark) else {
            continue;
        };
        let landmark = &match entry.stage {
            Stage::Mapped => *landmark,
            Stage::Tentative => landmark.in_front_of(&geometry, &prior.mean.centre),
        };
        let prepared = Prepared {
            geometry,
            mean: landmark.mean,
            covariance: landmark.covariance,
            pixel: Vector2::zeros(),
            variance_px2: params.sigma_px * params.sigma_px,
            scoring: Scoring::Full,
        };
        let Some(line) = linearisation.linearise(&likelihood.lens, &prepared) else {
            continue;
        };
        let p = line.mean;
        // Half a pixel beyond the image is still its edge.
        if p.x < -0.5
            || p.y < -0.5
            || p.x > params.image_size.x - 0.5
            || p.y > params.image_size.y - 0.5
        {
            let reach = (line.innovation()[(0, 0)] + line.innovation()[(1, 1)]).sqrt();
            let outside = Vector2::new(
                (-p.x).max(p.x - params.image_size.x).max(0.0),
                (-p.y).max(p.y - params.image_size.y).max(0.0),
            );
            if entry.stage == Stage::Mapped || outside.norm() > 3.0 * reach {
                continue;
            }
        }
        let ray = geometry.ray(&landmark.mean);
        let direction = ray.base + (ray.origin - prior.mean.centre) * ray.rate;
        in_view.insert(
            id,
            Predicted {
                pixel: p,
                covariance: line.innovation(),
                direction: direction / direction.norm().max(f64::MIN_POSITIVE),
                prepared,
                prototype: (entry.stage == Stage::Tentative).then_some(*landmark),
            },
        );
    }
    in_view
}

/// Gates no wider than this are searched before the descriptors decide, pixels.
const NARROW_GATE_PX: f64 = 12.0;

/// Steps 2 to 4: keypoint of each landmark, by landmark id.
fn match_descriptors(
    frame: &FrameFeatures<'_>,
    catalogue: &Catalogue,
    in_view: &BTreeMap<u32, Predicted>,
    params: &AssociationParams,
) -> BTreeMap<u32, usize> {
    let mut pairs = BTreeMap::new();
    let mut used = vec![false; frame.ideal.len()];
    guided(
        frame,
        catalogue,
        in_view,
        params,
        NARROW_GATE_PX,
        &mut pairs,
        &mut used,
    );
    by_index(frame, catalogue, in_view, params, &mut pairs, &mut used);
    guided(
        frame,
        catalogue,
        in_view,
        params,
        f64::INFINITY,
        &mut pairs,
        &mut used,
    );
    pairs
}

/// The two nearest landmarks in view of every keypoint not used yet, ratio test, gate.
fn by_index(
    frame: &FrameFeatures<'_>,
    catalogue: &Catalogue,
    in_view: &BTreeMap<u32, Predicted>,
    params: &AssociationParams,
    pairs: &mut BTreeMap<u32, usize>,
    used: &mut [bool],
) {
    let ratio_squared = f64::from(params.ratio * params.ratio);
    // The part of the map in view is small: a scan of a copy is exact and cheaper than a filtered search of all.
    let visible = ExactScan::gathered(catalogue.index(), in_view.keys().copied());
    let open: Vec<(usize, Vector2<f64>)> = (0..frame.ideal.len())
        .filter(|&k| !used[k])
        .filter_map(|k| Some((k, frame.ideal[k]?)))
        .collect();
    let queries: Vec<Descriptor> = open
        .iter()
        .map(|(k, _)| frame.features.descriptors[*k])
        .collect();
    let mut nearest = Vec::new();
    visible.two_nearest_batch(&queries, &mut nearest);
    let mut best: BTreeMap<u32, (u32, usize)> = BTreeMap::new();
    for ((k, pixel), nearest) in open.into_iter().zip(nearest) {
        let Some(nearest) = nearest else { continue };
        let first = nearest.first;
        let distinct = nearest.second.is_none_or(|second| {
            f64::from(first.distance_squared) < ratio_squared * f64::from(second.distance_squared)
        });
        let predicted = &in_view[&first.id];
        let gated =
            mahalanobis_2d(&(pixel - predicted.pixel), &predicted.covariance) <= params.gate;
        if distinct && gated && !pairs.contains_key(&first.id) {
            let candidate = (first.distance_squared, k);
            best.entry(first.id)
                .and_modify(|b| *b = (*b).min(candidate))
                .or_insert(candidate);
        }
    }
    for (id, (_, k)) in best {
        pairs.insert(id, k);
        used[k] = true;
    }
}

/// Landmarks without a keypoint look into their own gates of at most
/// `radius_limit` pixels; the best pairs are served first.
fn guided(
    frame: &FrameFeatures<'_>,
    catalogue: &Catalogue,
    in_view: &BTreeMap<u32, Predicted>,
    params: &AssociationParams,
    radius_limit: f64,
    pairs: &mut BTreeMap<u32, usize>,
    used: &mut [bool],
) {
    let ratio_squared = f64::from(params.guided_ratio * params.guided_ratio);
    let open: Vec<(u32, &Predicted)> = in_view
        .iter()
        .filter(|(id, _)| !pairs.contains_key(id))
        .map(|(id, p)| (*id, p))
        .collect();
    let mut found: Vec<(u32, u32, usize)> = open
        .into_par_iter()
        .filter_map(|(id, predicted)| {
            let entry = catalogue.get(id)?;
            let radius = (params.gate * largest_eigenvalue(&predicted.covariance)).sqrt();
            if radius > radius_limit {
                return None;
            }
            let mut first = (u32::MAX, usize::MAX);
            let mut second = u32::MAX;
            for k in frame.near(&predicted.pixel, radius) {
                let Some(pixel) = frame.ideal[k] else {
                    continue;
                };
                if mahalanobis_2d(&(pixel - predicted.pixel), &predicted.covariance) > params.gate {
                    continue;
                }
                let d = distance_squared(&entry.descriptor, &frame.features.descriptors[k]);
                if d < first.0 {
                    second = first.0;
                    first = (d, k);
                } else {
                    second = second.min(d);
                }
            }
            (first.0 <= params.guided_distance_squared
                && f64::from(first.0) < ratio_squared * f64::from(second))
            .then_some((first.0, id, first.1))
        })
        .collect();
    found.sort_unstable();
    for (_, id, k) in found {
        if !used[k] {
            used[k] = true;
            pairs.insert(id, k);
        }
    }
}

/// Larger eigenvalue of a symmetric 2 x 2, closed form.
fn largest_eigenvalue(m: &Matrix2<f64>) -> f64 {
    let half = 0.5 * (m[(0, 0)] + m[(1, 1)]);
    let difference = 0.5 * (m[(0, 0)] - m[(1, 1)]);
    half + difference.hypot(m[(0, 1)])
}

/// Step 5.
fn consensus(
    frame: &FrameFeatures<'_>,
    pairs: BTreeMap<u32, usize>,
    in_view: BTreeMap<u32, Predicted>,
    prior: &MotionPrior,
    likelihood: &Likelihood,
    params: &AssociationParams,
) -> Association {
    let mut candidates: Vec<(Pair, Prepared)> = Vec::with_capacity(pairs.len());
    for (id, k) in pairs {
        let (Some(pixel), Some(predicted)) = (frame.ideal[k], in_view.get(&id)) else {
            continue;
        };
        let mut prepared = predicted.prepared;
        prepared.pixel = pixel;
        prepared.scoring = scoring(&prepared, prior, likelihood, params);
        let nis = mahalanobis_2d(&(pixel - predicted.pixel), &predicted.covariance);
        let feature = MatchedFeature {
            id,
            pixel,
            variance_px2: prepared.variance_px2,
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
        posterior = pose_posterior(
            &likelihood.lens,
            &likelihood.body_from_camera,
            prior,
            &used,
            params.iterations,
        );
        let linearisation = PoseLinearisation::new(prior, &posterior, &likelihood.body_from_camera);
        for ((_, prepared), keep) in candidates.iter().zip(&mut keep) {
            *keep = linearisation
                .linearise(&likelihood.lens, prepared)
                .is_some_and(|line| {
                    mahalanobis_2d(&(prepared.pixel - line.mean), &line.innovation()) <= params.gate
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
        camera: PlacedCamera::new(&posterior.mean_pose(prior), &likelihood.body_from_camera),
        posterior,
    }
}

/// Open depth is scored across the epipolar line, but only where depth moves
/// the pixel by more than its noise: otherwise both coordinates tell of the pose.
fn scoring(
    prepared: &Prepared,
    prior: &MotionPrior,
    likelihood: &Likelihood,
    params: &AssociationParams,
) -> Scoring {
    let Some(sigma_rho) = prepared.open_sigma(params.open_depth) else {
        return Scoring::Full;
    };
    let camera = PlacedCamera::new(&prior.mean, &likelihood.body_from_camera);
    match likelihood
        .lens
        .parameter_jacobian(&camera, &prepared.geometry, &prepared.mean)
    {
        Some(j) if j.column(2).norm() * sigma_rho > params.sigma_px => Scoring::AcrossEpipolar,
        _ => Scoring::Full,
    }
}
