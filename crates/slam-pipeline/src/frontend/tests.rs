//! Belief in landmarks, and matches of a synthetic scene.

use crate::filter::pixel_noise::PixelNoise;
use estimation_base::Manifold;
use std::collections::BTreeSet;

use crate::filter::landmark::Landmark;
use crate::filter::motion::MotionPrior;
use crate::filter::observation::Sighting;
use crate::filter::particle::Particle;
use crate::frontend::associate::associate;
use crate::frontend::association::{Association, AssociationParams};
use crate::frontend::catalogue::{Catalogue, CatalogueUpdate, NewFeature, SeenAgain, Stage};
use crate::frontend::frame::FrameFeatures;
use crate::frontend::gate::Gate;
use crate::method::DescriptorSearch;
use feature_kdtree::DescriptorIndex as _;
use nalgebra::{Matrix3, Vector2, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use vision_sift::{Features, Keypoint};

use crate::filter::tests::common::*;

pub(super) const SIGMA_PX: f64 = 0.5;

pub(super) const PARAMS: AssociationParams = AssociationParams {
    ratio: 0.7,
    gate: Gate { limit: 13.8 },
    search: DescriptorSearch::InView,
    guided_distance_squared: 220 * 220,
    guided_ratio: 0.8,
    open_depth: 0.15,
    sigma_px: SIGMA_PX,
    iterations: 2,
};

pub(super) fn descriptor(rng: &mut ChaCha8Rng) -> [u8; 128] {
    core::array::from_fn(|_| rng.random_range(0..120_u8))
}

fn sighting(keyframe: u32) -> Sighting {
    Sighting {
        keyframe,
        pixel: Vector2::new(10.0, 20.0),
    }
}

fn prototype() -> Landmark {
    Landmark::from_first_sighting(
        &pinhole(),
        0,
        &Vector2::new(10.0, 20.0),
        &PixelNoise::round(SIGMA_PX),
        OPEN_DEPTH,
    )
}

/// A catalogue with one tentative feature of each descriptor, all seen at keyframe `keyframe`.
fn with_features(descriptors: &[[u8; 128]], keyframe: u32) -> Catalogue {
    let mut catalogue = Catalogue::new(DescriptorSearch::InView).unwrap();
    catalogue.apply(new_features(descriptors, keyframe), None);
    catalogue
}

fn new_features(descriptors: &[[u8; 128]], keyframe: u32) -> CatalogueUpdate {
    CatalogueUpdate {
        new: descriptors
            .iter()
            .map(|descriptor| NewFeature {
                descriptor: *descriptor,
                prototype: prototype(),
                sighting: sighting(keyframe),
            })
            .collect(),
        ..CatalogueUpdate::default()
    }
}

fn seen(id: u32, descriptor: &[u8; 128], keyframe: u32) -> SeenAgain {
    SeenAgain {
        id,
        descriptor: *descriptor,
        sighting: sighting(keyframe),
        direction: Vector3::x(),
    }
}

fn promote(ids: &[u32]) -> CatalogueUpdate {
    CatalogueUpdate {
        promoted: ids.to_vec(),
        ..CatalogueUpdate::default()
    }
}

/// Puts a landmark into the catalogue and into the map of the particle; `id` is the next of the catalogue.
pub(super) fn map_point(
    catalogue: &mut Catalogue,
    particle: &mut Particle,
    id: u32,
    descriptor: [u8; 128],
    landmark: Landmark,
) {
    catalogue.apply(new_features(&[descriptor], 0), None);
    catalogue.apply(promote(&[id]), None);
    let _ = particle.map.insert(id, landmark);
}

#[test]
fn belief_rises_with_sightings_and_falls_with_misses() {
    let mut rng = rng(71);
    let descriptors: [_; 3] = core::array::from_fn(|_| descriptor(&mut rng));
    let newest = descriptor(&mut rng);
    let mut catalogue = with_features(&descriptors, 0);
    assert_eq!(
        (catalogue.get(0).unwrap().stage, catalogue.mapped()),
        (Stage::Tentative, 0)
    );
    catalogue.apply(promote(&[0]), None);
    assert_eq!(catalogue.mapped(), 1);
    let miss = |catalogue: &mut Catalogue, id| {
        catalogue.apply(
            CatalogueUpdate {
                missed: vec![id],
                ..CatalogueUpdate::default()
            },
            None,
        );
        catalogue.get(id).unwrap().existence.is_gone()
    };
    let see = |catalogue: &mut Catalogue, id, keyframe| {
        catalogue.apply(
            CatalogueUpdate {
                seen: vec![seen(id, &newest, keyframe)],
                ..CatalogueUpdate::default()
            },
            None,
        );
    };
    let misses = |c: &mut Catalogue, id| (1..=20).find(|_| miss(c, id));
    // Never seen again: odds of 1 to 20 after four misses of ln(0.4 / 0.95).
    assert_eq!(misses(&mut catalogue, 0), Some(4));

    // Seen often, it survives more misses, but not for ever.
    for k in 1..100 {
        see(&mut catalogue, 1, k);
    }
    let entry = catalogue.get(1).unwrap();
    assert_eq!(
        (
            entry.observations,
            entry.first.keyframe,
            entry.last.keyframe
        ),
        (100, 0, 99)
    );
    assert_eq!(*entry.descriptor, newest);
    // (5 + 3) / 0.865: the ceiling, not 99 sightings, decides.
    assert_eq!(misses(&mut catalogue, 1), Some(10));
    // A sighting between misses gives belief back: ln(0.6 / 0.05) is worth almost three misses.
    for k in 1..50 {
        assert!(!miss(&mut catalogue, 2) && !miss(&mut catalogue, 2));
        see(&mut catalogue, 2, k);
    }
}

#[test]
fn only_tentative_features_are_forgotten() {
    let mut rng = rng(72);
    let mut catalogue = with_features(&[], 0);
    for keyframe in 0..5 {
        catalogue.apply(new_features(&[descriptor(&mut rng)], keyframe), None);
    }
    let again = descriptor(&mut rng);
    catalogue.apply(
        CatalogueUpdate {
            promoted: vec![0],
            seen: vec![seen(1, &again, 4)],
            forget_before: 3,
            ..CatalogueUpdate::default()
        },
        None,
    );
    // 0 is in the map, 1 was seen just now, 2 is too old.
    let left: Vec<u32> = catalogue.iter().map(|(id, _)| id).collect();
    assert_eq!(left, [0, 1, 3, 4]);
    for _ in 0..2 {
        catalogue.apply(
            CatalogueUpdate {
                removed: vec![0],
                ..CatalogueUpdate::default()
            },
            None,
        );
        assert_eq!(catalogue.mapped(), 0);
    }
    // Identities are not used twice.
    catalogue.apply(new_features(&[descriptor(&mut rng)], 4), None);
    assert_eq!(catalogue.iter().last().unwrap().0, 5);
}

#[test]
fn the_forest_of_the_paper_follows_the_catalogue() {
    let mut rng = rng(73);
    let descriptors: [_; 3] = core::array::from_fn(|_| descriptor(&mut rng));
    let mut catalogue = Catalogue::new(DescriptorSearch::WholeMapForest).unwrap();
    let apply = |catalogue: &mut Catalogue, update: CatalogueUpdate| {
        let forest = catalogue.forest_after(&update).unwrap();
        catalogue.apply(update, forest);
    };
    apply(&mut catalogue, new_features(&descriptors, 0));
    let nearest = |catalogue: &Catalogue, query: &[u8; 128]| {
        catalogue
            .forest()
            .unwrap()
            .two_nearest(query)
            .unwrap()
            .first
    };
    for (id, d) in (0_u32..).zip(&descriptors) {
        let first = nearest(&catalogue, d);
        assert_eq!((first.id, first.distance_squared), (id, 0));
    }
    // A small change of the look is not learnt, a large one is.
    let close = descriptors[0].map(|v| v + 1);
    let far = descriptor(&mut rng);
    for (look, expected) in [(close, 128), (far, 0)] {
        apply(
            &mut catalogue,
            CatalogueUpdate {
                seen: vec![seen(0, &look, 1)],
                ..CatalogueUpdate::default()
            },
        );
        let first = nearest(&catalogue, &look);
        assert_eq!((first.id, first.distance_squared), (0, expected));
    }
    apply(
        &mut catalogue,
        CatalogueUpdate {
            removed: vec![1],
            forget_before: 5,
            ..CatalogueUpdate::default()
        },
    );
    assert_eq!(
        catalogue.forest().unwrap().len(),
        0,
        "all gone or forgotten"
    );
}

struct Scene {
    catalogue: Catalogue,
    particle: Particle,
    prior: MotionPrior,
    features: Features,
}

pub(super) fn keypoint(at: &Vector2<f64>) -> Keypoint {
    Keypoint {
        x: at.x as f32,
        y: at.y as f32,
        sigma: 2.0,
        angle: 0.0,
        response: 0.1,
    }
}

/// Forty mapped landmarks, all in view, seen from a pose drawn from the prior. Keypoint i shows landmark i.
fn scene(seed: u64) -> Scene {
    let mut rng = rng(seed);
    let mut catalogue = with_features(&[], 0);
    let mut particle = particle(pose(0.0, 0.0, 0.0));
    let prior = planar_carrier().prior(
        &Vector2::zeros(),
        &particle.departure(),
        &control([0.1, 0.0, 0.0], [5e-3, 2e-3, 0.012]),
    );
    let truth = prior
        .mean
        .retract(&(prior.factor * nalgebra::SVector::from_fn(|_, _| normal(&mut rng))));
    let mut features = Features::default();
    for id in 0..40 {
        let (a, b) = (
            uniform(&mut rng, -0.35, 0.35),
            uniform(&mut rng, -0.25, 0.25),
        );
        let at = ahead(&place(&prior.mean), a, b, uniform(&mut rng, 1.8, 2.2));
        let seen = descriptor(&mut rng);
        map_point(
            &mut catalogue,
            &mut particle,
            id,
            seen,
            point(at, Matrix3::from_diagonal_element(1e-6)),
        );
        let noise = Vector2::from_fn(|_, _| SIGMA_PX * normal(&mut rng));
        features
            .keypoints
            .push(keypoint(&(pixel_of(&place(&truth), &at) + noise)));
        // The same patch seen again: a few units of noise a component.
        features
            .descriptors
            .push(seen.map(|v| v.saturating_add(rng.random_range(0..8))));
    }
    Scene {
        catalogue,
        particle,
        prior,
        features,
    }
}

fn matched(scene: &Scene) -> Association<'_> {
    let frame = FrameFeatures::new(&scene.features, &camera());
    associate(
        &rig(),
        &frame,
        &scene.catalogue,
        &scene.particle,
        &scene.prior,
        &PARAMS,
    )
}

fn pairs(association: &Association<'_>) -> Vec<(u32, usize)> {
    association
        .inliers
        .iter()
        .map(|p| (p.feature.id, p.keypoint))
        .collect()
}

#[test]
fn distinct_descriptors_are_all_matched() {
    for seed in 0..5 {
        let scene = scene(seed);
        let association = matched(&scene);
        let expected: Vec<(u32, usize)> = (0..40_u32).map(|i| (i, i as usize)).collect();
        assert_eq!(pairs(&association), expected, "seed {seed}");
        assert_eq!(association.in_view.len(), 40);
        // The heading is known from forty matches better than from the odometry.
        let sigma = association.posterior.pose_covariance(&scene.prior)[(3, 3)].sqrt();
        assert!(sigma < 0.012 / 3.0, "{sigma:e}");
    }
}

#[test]
fn planted_wrong_match_passes_the_gate_and_not_the_consensus() {
    for seed in 0..5 {
        let mut scene = scene(10 + seed);
        let honest = matched(&scene);
        let predicted = honest.in_view.get(7).unwrap().pixel;
        // Two predicted deviations the other way: within the gate of a prior of 0.012 rad (4 px), far from
        // what the others agree on.
        let true_pixel = scene.features.keypoints[7];
        let side = if f64::from(true_pixel.x) > predicted.x {
            -9.0
        } else {
            9.0
        };
        scene.features.keypoints[7] = keypoint(&(predicted + Vector2::new(side, 0.0)));
        let association = matched(&scene);
        let outliers: Vec<u32> = association.outliers.iter().map(|p| p.feature.id).collect();
        assert_eq!(outliers, [7], "seed {seed}");
        assert_eq!(pairs(&association).len(), 39);
        assert!(
            association.outliers[0].nis < 13.8,
            "it passed the gate: {}",
            association.outliers[0].nis
        );
    }
}

#[test]
fn swapped_descriptors_do_not_match_far_away() {
    let mut scene = scene(20);
    scene.features.descriptors.swap(0, 1);
    let association = matched(&scene);
    let ids: BTreeSet<u32> = association.inliers.iter().map(|p| p.feature.id).collect();
    assert_eq!(ids, (2..40).collect());
}

#[test]
fn a_landmark_has_one_keypoint_and_a_keypoint_one_landmark() {
    let mut scene = scene(30);
    // Every keypoint twice, half a pixel apart (SIFT gives one per orientation).
    for i in 0..40 {
        let k = scene.features.keypoints[i];
        scene
            .features
            .keypoints
            .push(Keypoint { x: k.x + 0.5, ..k });
        let twin = scene.features.descriptors[i].map(|v| v.saturating_add(6));
        scene.features.descriptors.push(twin);
    }
    let association = matched(&scene);
    let found = pairs(&association);
    let ids: BTreeSet<u32> = found.iter().map(|p| p.0).collect();
    let keypoints: BTreeSet<usize> = found.iter().map(|p| p.1).collect();
    assert_eq!((ids.len(), keypoints.len()), (40, 40));
    // The nearer descriptor wins.
    assert!(keypoints.iter().all(|k| *k < 40), "{keypoints:?}");
}

#[test]
fn landmarks_out_of_view_are_not_candidates() {
    let mut scene = scene(40);
    let behind = scene.particle.pose.centre - Vector3::y() * 3.0;
    let _ = scene
        .particle
        .map
        .insert(4, point(behind, Matrix3::from_diagonal_element(1e-6)));
    let _ = scene.particle.map.remove(5);
    let association = matched(&scene);
    assert!(association.in_view.get(4).is_none() && association.in_view.get(5).is_none());
    assert_eq!(association.inliers.len(), 38);
}

#[test]
fn nothing_seen_leaves_the_prior() {
    let mut scene = scene(50);
    scene.features = Features::default();
    let association = matched(&scene);
    assert!(association.inliers.is_empty() && association.outliers.is_empty());
    assert!(association.posterior.mean.iter().all(|v| *v == 0.0));
    assert_eq!(association.in_view.len(), 40);
}
