//! Belief in landmarks, and matches of a synthetic scene.

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Vector2, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use slam_pipeline::filter::landmark::Landmark;
use slam_pipeline::filter::likelihood::Likelihood;
use slam_pipeline::filter::motion::MotionPrior;
use slam_pipeline::filter::particle::Particle;
use slam_pipeline::frontend::association::{Association, AssociationParams, associate};
use slam_pipeline::frontend::catalogue::{Catalogue, Sighting, Stage};
use slam_pipeline::frontend::frame::FrameFeatures;
use vision_sift::{Features, Keypoint};

use crate::common::*;

const SIGMA_PX: f64 = 0.5;

fn descriptor(rng: &mut ChaCha8Rng) -> [u8; 128] {
    core::array::from_fn(|_| rng.random_range(0..120_u8))
}

fn sighting(keyframe: u32) -> Sighting {
    Sighting { keyframe, pixel: Vector2::new(10.0, 20.0) }
}

fn prototype() -> Landmark {
    Landmark::from_first_sighting(&lens(), 0, &Vector2::new(10.0, 20.0), SIGMA_PX, (1.25, 0.625))
}

#[test]
fn belief_rises_with_sightings_and_falls_with_misses() {
    let mut rng = rng(71);
    let mut catalogue = Catalogue::new().unwrap();
    let id = catalogue.add(&descriptor(&mut rng), prototype(), sighting(0)).unwrap();
    assert_eq!((catalogue.get(id).unwrap().stage, catalogue.mapped()), (Stage::Tentative, 0));
    catalogue.promote(id);
    assert_eq!(catalogue.mapped(), 1);
    // Never seen again: odds of 1 to 20 after four misses of ln(0.4 / 0.95).
    let misses = |c: &mut Catalogue, id| (1..=20).find(|_| c.record_miss(id));
    assert_eq!(misses(&mut catalogue, id), Some(4));

    // Seen often, it survives more misses, but not for ever.
    let id = catalogue.add(&descriptor(&mut rng), prototype(), sighting(0)).unwrap();
    let newest = descriptor(&mut rng);
    for k in 1..100 {
        catalogue.record_sighting(id, &newest, sighting(k), Vector3::x()).unwrap();
    }
    let entry = catalogue.get(id).unwrap();
    assert_eq!((entry.observations, entry.first.keyframe, entry.last.keyframe), (100, 0, 99));
    assert_eq!(*entry.descriptor, newest);
    // (5 + 3) / 0.865: the ceiling, not 99 sightings, decides.
    assert_eq!(misses(&mut catalogue, id), Some(10));
    // A sighting between misses gives belief back: ln(0.6 / 0.05) is worth almost three misses.
    let id = catalogue.add(&descriptor(&mut rng), prototype(), sighting(0)).unwrap();
    for k in 1..50 {
        assert!(!catalogue.record_miss(id) && !catalogue.record_miss(id));
        catalogue.record_sighting(id, &newest, sighting(k), Vector3::x()).unwrap();
    }
}

#[test]
fn only_tentative_features_are_forgotten() {
    let mut rng = rng(72);
    let mut catalogue = Catalogue::new().unwrap();
    let ids: Vec<u32> = (0..4)
        .map(|k| catalogue.add(&descriptor(&mut rng), prototype(), sighting(k)).unwrap())
        .collect();
    catalogue.promote(ids[0]);
    catalogue.forget_tentative_before(2);
    let left: Vec<u32> = catalogue.iter().map(|(id, _)| id).collect();
    assert_eq!(left, [ids[0], ids[2], ids[3]]);
    catalogue.remove(ids[0]);
    catalogue.remove(ids[0]);
    assert_eq!(catalogue.mapped(), 0);
    // Identities are not used twice.
    let next = catalogue.add(&descriptor(&mut rng), prototype(), sighting(4)).unwrap();
    assert_eq!(next, 4);
}

struct Scene {
    catalogue: Catalogue,
    particle: Particle,
    prior: MotionPrior,
    features: Features,
}

fn keypoint(at: &Vector2<f64>) -> Keypoint {
    Keypoint { x: at.x as f32, y: at.y as f32, sigma: 2.0, angle: 0.0, response: 0.1 }
}

/// Forty mapped landmarks, all in view, seen from a pose drawn from the prior. Keypoint i shows landmark i.
fn scene(seed: u64) -> Scene {
    let mut rng = rng(seed);
    let mut catalogue = Catalogue::new().unwrap();
    let mut particle = particle(pose(0.0, 0.0, 0.0));
    let prior = planar_carrier(Vector2::zeros())
        .prior(&particle, &control([0.1, 0.0, 0.0], [5e-3, 2e-3, 0.012]));
    let truth = prior.mean.retract(&(prior.factor * nalgebra::SVector::from_fn(|_, _| normal(&mut rng))));
    let mut features = Features::default();
    for _ in 0..40 {
        let (a, b) = (uniform(&mut rng, -0.35, 0.35), uniform(&mut rng, -0.25, 0.25));
        let at = ahead(&place(&prior.mean), a, b, uniform(&mut rng, 1.8, 2.2));
        let seen = descriptor(&mut rng);
        let id = catalogue.add(&seen, prototype(), sighting(0)).unwrap();
        catalogue.promote(id);
        let _ = particle.map.insert(id, point(at, Matrix3::from_diagonal_element(1e-6)));
        let noise = Vector2::from_fn(|_, _| SIGMA_PX * normal(&mut rng));
        features.keypoints.push(keypoint(&(pixel_of(&place(&truth), &at) + noise)));
        // The same patch seen again: a few units of noise a component.
        features.descriptors.push(seen.map(|v| v.saturating_add(rng.random_range(0..8))));
    }
    Scene { catalogue, particle, prior, features }
}

fn matched(scene: &Scene) -> Association {
    let likelihood = Likelihood {
        lens: lens(),
        body_from_camera: sideways(),
        outlier_share: 0.05,
        image_area_px2: 320.0 * 240.0,
        as_printed: false,
    };
    let params = AssociationParams {
        ratio: 0.7,
        gate: 13.8,
        guided_distance_squared: 220 * 220,
        guided_ratio: 0.8,
        open_depth: 0.15,
        sigma_px: SIGMA_PX,
        iterations: 2,
        image_size: Vector2::new(320.0, 240.0),
    };
    let frame = FrameFeatures::new(&scene.features, &camera());
    associate(&frame, &scene.catalogue, &scene.particle, &scene.prior, &likelihood, &params)
}

fn pairs(association: &Association) -> Vec<(u32, usize)> {
    association.inliers.iter().map(|p| (p.feature.id, p.keypoint)).collect()
}

#[test]
fn distinct_descriptors_are_all_matched() {
    for seed in 0..5 {
        let association = matched(&scene(seed));
        let expected: Vec<(u32, usize)> = (0..40_u32).map(|i| (i, i as usize)).collect();
        assert_eq!(pairs(&association), expected, "seed {seed}");
        assert_eq!(association.in_view.len(), 40);
        // The heading is known from forty matches better than from the odometry.
        let sigma = association.posterior.pose_covariance(&scene(seed).prior)[(3, 3)].sqrt();
        assert!(sigma < 0.012 / 3.0, "{sigma:e}");
    }
}

#[test]
fn planted_wrong_match_passes_the_gate_and_not_the_consensus() {
    for seed in 0..5 {
        let mut scene = scene(10 + seed);
        let honest = matched(&scene);
        let predicted = honest.in_view[&7].pixel;
        // Two predicted deviations the other way: within the gate of a prior of 0.012 rad (4 px), far from
        // what the others agree on.
        let true_pixel = scene.features.keypoints[7];
        let side = if f64::from(true_pixel.x) > predicted.x { -9.0 } else { 9.0 };
        scene.features.keypoints[7] = keypoint(&(predicted + Vector2::new(side, 0.0)));
        let association = matched(&scene);
        let outliers: Vec<u32> = association.outliers.iter().map(|p| p.feature.id).collect();
        assert_eq!(outliers, [7], "seed {seed}");
        assert_eq!(pairs(&association).len(), 39);
        assert!(association.outliers[0].nis < 13.8, "it passed the gate: {}", association.outliers[0].nis);
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
        scene.features.keypoints.push(Keypoint { x: k.x + 0.5, ..k });
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
    let _ = scene.particle.map.insert(4, point(behind, Matrix3::from_diagonal_element(1e-6)));
    let _ = scene.particle.map.remove(5);
    let association = matched(&scene);
    assert!(!association.in_view.contains_key(&4) && !association.in_view.contains_key(&5));
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
