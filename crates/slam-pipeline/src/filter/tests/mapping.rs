//! The map of a particle: two-view points, what an update touches.

use crate::filter::landmark::{Landmark, Parametrisation};
use crate::filter::mapping::{Mapping, two_view};
use crate::filter::metric::ScaleNote;
use crate::filter::metric_path::MetricPath;
use crate::filter::observation::{
    FrameObservation, Initialisation, MatchedFeature, Scoring, Sighting,
};
use crate::filter::particle::{Keyframe, Particle};
use crate::filter::pixel_noise::PixelNoise;
use crate::filter::pose::CameraPose;
use crate::method::LandmarkStart;
use crate::rig::Rig;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use rbpf_core::MapUpdate;
use ukf::{SigmaPoints, Verdict, assess_consistency, normalized_error_squared};

use super::common::*;

const SIGMA_PX: f64 = 0.5;

fn keyframe(pose: &CameraPose) -> Keyframe {
    Keyframe {
        pose: *pose,
        camera: place(pose),
        scale: ScaleNote::METRE,
    }
}

fn two_keyframes() -> Particle {
    let (first, second) = (pose(0.0, 0.0, 0.1), pose(0.4, 0.05, 0.15));
    let mut p = particle(second);
    p.path.push(keyframe(&first));
    p.path.push(keyframe(&second));
    p
}

fn mapping(rig: &Rig, start: LandmarkStart) -> Mapping<'_> {
    Mapping {
        rig,
        points: SigmaPoints::default(),
        start,
        frozen: false,
    }
}

fn nothing() -> FrameObservation {
    FrameObservation {
        control: control([0.0; 3], [0.0; 3]),
        matches: Vec::new(),
        initialised: Vec::new(),
        removed: Vec::new(),
    }
}

fn view(p: &Particle, keyframe: usize, at: &Vector3<f64>) -> Vector2<f64> {
    pixel_of(&p.path.get(keyframe).unwrap().camera, at)
}

#[test]
fn two_views_meet_in_the_point() {
    let p = two_keyframes();
    let at = ahead(&p.path.get(0).unwrap().camera, 0.2, -0.1, 2.5);
    let new = Initialisation {
        id: 3,
        first: Sighting {
            keyframe: 0,
            pixel: view(&p, 0, &at),
        },
        second: view(&p, 1, &at),
        noise: [PixelNoise::round(SIGMA_PX); 2],
    };
    let landmark = two_view(&pinhole(), &p, &new).unwrap();
    assert_eq!(landmark.parametrisation, Parametrisation::Point);
    assert!((landmark.mean - at).norm() < 1e-9, "{}", landmark.mean);
    // Rays that part do not meet in front.
    let apart = Initialisation {
        second: new.second + Vector2::new(200.0, 0.0),
        ..new
    };
    assert!(two_view(&pinhole(), &p, &apart).is_none());
    // An anchor that is not in the path.
    assert!(
        two_view(
            &pinhole(),
            &p,
            &Initialisation {
                first: Sighting {
                    keyframe: 7,
                    pixel: new.second,
                },
                ..new
            }
        )
        .is_none()
    );
}

#[test]
fn two_view_errors_are_as_large_as_their_covariance() {
    let mut rng = rng(61);
    let p = two_keyframes();
    let mut values = Vec::new();
    for k in 0..500 {
        let at = ahead(
            &p.path.get(0).unwrap().camera,
            uniform(&mut rng, -0.2, 0.3),
            uniform(&mut rng, -0.2, 0.2),
            uniform(&mut rng, 1.0, 3.0),
        );
        // A lens has stretched the noise of most.
        let roots = [k, k + 1].map(|id| noise_root(SIGMA_PX, id));
        let mut noisy = |pixel: Vector2<f64>, root: &Matrix2<f64>| {
            pixel + root * Vector2::from_fn(|_, _| normal(&mut rng))
        };
        let new = Initialisation {
            id: 0,
            first: Sighting {
                keyframe: 0,
                pixel: noisy(view(&p, 0, &at), &roots[0]),
            },
            second: noisy(view(&p, 1, &at), &roots[1]),
            noise: [noise_of(&roots[0]), noise_of(&roots[1])],
        };
        if let Some(l) = two_view(&pinhole(), &p, &new) {
            values.push(normalized_error_squared(&(l.mean - at), &l.covariance).unwrap());
        }
    }
    assert!(values.len() > 450, "{} accepted", values.len());
    let verdict = assess_consistency(values, 3, 0.999).unwrap();
    assert_eq!(verdict.verdict, Verdict::Consistent, "{verdict:?}");
}

#[test]
fn landmarks_not_measured_stay_where_they_are_in_memory() {
    let mut before = two_keyframes();
    for id in 0..160 {
        let at = ahead(&place(&before.pose), 0.001 * f64::from(id), 0.0, 3.0);
        let _ = before
            .map
            .insert(id, point(at, Matrix3::from_diagonal_element(1e-4)));
    }
    let mut after = before.clone();
    let measured = after.map.get(37).unwrap().mean;
    let observation = FrameObservation {
        matches: vec![MatchedFeature {
            id: 37,
            pixel: pixel_of(&place(&after.pose), &measured),
            noise: PixelNoise::round(SIGMA_PX),
            scoring: Scoring::MapOnly,
            prototype: None,
        }],
        ..nothing()
    };
    let Ok(()) =
        mapping(&rig(), LandmarkStart::SecondSighting).update_map(&mut after, &observation);
    let shared = after.map.shared_leaves_with(&before.map);
    // 160 ids in leaves of 16; one leaf was written.
    assert_eq!((shared.shared, shared.total), (9, 10));
    assert_eq!(after.map.get(36), before.map.get(36));
    let (new, old) = (after.map.get(37).unwrap(), before.map.get(37).unwrap());
    assert!(new.covariance.determinant() < 0.5 * old.covariance.determinant());
    assert_eq!((before.path.len(), after.path.len()), (2, 3));
}

#[test]
fn second_sighting_starts_a_landmark_and_removal_ends_it() {
    let p = two_keyframes();
    let at = ahead(&p.path.get(0).unwrap().camera, 0.1, 0.1, 2.0);
    let prototype = Landmark::from_first_sighting(
        &pinhole(),
        0,
        &view(&p, 0, &at),
        &PixelNoise::round(SIGMA_PX),
        OPEN_DEPTH,
    );
    let observation = FrameObservation {
        matches: vec![MatchedFeature {
            id: 5,
            pixel: view(&p, 1, &at),
            noise: PixelNoise::round(SIGMA_PX),
            scoring: Scoring::AcrossEpipolar,
            prototype: Some(prototype),
        }],
        ..nothing()
    };
    let mut started = p.clone();
    let Ok(()) =
        mapping(&rig(), LandmarkStart::SecondSighting).update_map(&mut started, &observation);
    let landmark = *started.map.get(5).unwrap();
    assert_eq!(landmark.anchor(), Some(0));
    assert!((landmark.mean.z - 0.5).abs() < 4.0 * landmark.covariance[(2, 2)].sqrt());
    assert!(
        landmark.depth_openness() < 0.05,
        "{}",
        landmark.depth_openness()
    );
    // In metres: the scale stretches the world about the start, where it is one from there on.
    let mut stretched = started.path.clone();
    stretched.last_mut().unwrap().scale.mean = 1.1;
    started.path = stretched;
    let world = MetricPath::new(&started, Vector2::zeros(), &[true; 8]);
    let metric = world.point(&started, &landmark, 0).unwrap();
    let unit = landmark.point(&p.geometry(&landmark).unwrap()).unwrap();
    assert!((metric.position - unit.position * 1.1).norm() < 1e-12);
    assert!((metric.covariance - unit.covariance * 1.21).norm() < 1e-12);
    // The delayed methods wait for two views.
    let mut waiting = p;
    let Ok(()) = mapping(&rig(), LandmarkStart::TwoViews { min_parallax: 0.02 })
        .update_map(&mut waiting, &observation);
    assert!(!waiting.map.contains(5));
    let Ok(()) = mapping(&rig(), LandmarkStart::SecondSighting).update_map(
        &mut started,
        &FrameObservation {
            removed: vec![5],
            ..nothing()
        },
    );
    assert!(!started.map.contains(5));
}
