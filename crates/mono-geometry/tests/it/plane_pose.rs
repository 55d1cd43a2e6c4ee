//! Homographies between two views: motion and plane recovered, robust runs, degenerate motions.

use crate::common::{config, gauss};
use mono_geometry::epipolar::{Correspondence, FourPoint, HomographyScorer, plane_poses};
use mono_geometry::ransac::{Options, Uniform, ransac};
use mono_geometry::{Se3, so3};
use nalgebra::{Matrix3, Vector2, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Matches of points of the plane normal . X = distance.
fn scene(
    rng: &mut ChaCha8Rng,
    pose: &Se3,
    normal: &Vector3<f64>,
    distance: f64,
    count: usize,
) -> Vec<Correspondence> {
    let mut matches = Vec::new();
    for _ in 0..100 * count {
        let ray = Vector3::new(
            rng.random_range(-0.5..0.5),
            rng.random_range(-0.5..0.5),
            1.0,
        );
        let moved = pose.transform_point(&(ray * (distance / normal.dot(&ray))));
        if moved.z > 0.2 * distance && matches.len() < count {
            matches.push(Correspondence {
                first: ray.xy(),
                second: (moved / moved.z).xy(),
            });
        }
    }
    matches
}

fn random_case(rng: &mut ChaCha8Rng) -> (Se3, Vector3<f64>, f64) {
    let mut vector = || Vector3::new(gauss(rng), gauss(rng), gauss(rng)).normalize();
    let pose = Se3::new(so3::exp(&(vector() * 0.3)), vector() * 0.5);
    let normal = (vector() * 0.4 + Vector3::z()).normalize();
    (pose, normal, 2.5)
}

proptest! {
    #![proptest_config(config(300))]

    #[test]
    fn motion_and_plane_come_back(seed in 0_u64..1_000_000, scale in prop::sample::select(vec![1.0, -3.0, 1e-6])) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (pose, normal, distance) = random_case(&mut rng);
        let matches = scene(&mut rng, &pose, &normal, distance, 10);
        prop_assert_eq!(matches.len(), 10);
        let h = pose.rotation.matrix() + pose.translation * normal.transpose() / distance;
        let poses = plane_poses(&(h * scale), &matches, 0.0);
        prop_assert_eq!(poses.len(), 2);
        for p in &poses {
            // Both are decompositions.
            let again = p.rotation.matrix() + p.translation_over_distance * p.normal.transpose();
            prop_assert!((again - h).amax() < 1e-9);
        }
        let found = poses.iter().any(|p| {
            (p.rotation.matrix() - pose.rotation.matrix()).amax() < 1e-7
                && (p.normal - normal).amax() < 1e-7
                && (p.translation_over_distance - pose.translation / distance).amax() < 1e-7
                && p.in_front == 10
        });
        prop_assert!(found);
    }
}

#[test]
fn a_turn_has_no_plane_and_nonsense_no_pose() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (pose, normal, distance) = random_case(&mut rng);
    let turned = Se3::new(pose.rotation, Vector3::zeros());
    let matches = scene(&mut rng, &turned, &normal, distance, 10);
    let poses = plane_poses(&(turned.rotation.matrix() * -2.0), &matches, 0.0);
    assert_eq!(poses.len(), 1);
    assert!((poses[0].rotation.matrix() - pose.rotation.matrix()).amax() < 1e-14);
    assert_eq!(poses[0].translation_over_distance, Vector3::zeros());
    assert!(plane_poses(&Matrix3::zeros(), &matches, 0.0).is_empty());
    assert!(plane_poses(&Matrix3::repeat(f64::NAN), &matches, 0.0).is_empty());
    assert!(plane_poses(&Matrix3::identity(), &[], 0.0).is_empty());
}

#[test]
fn a_plane_is_found_among_half_outliers() {
    let sigma = 0.5e-3;
    for seed in 0..20 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (pose, normal, distance) = random_case(&mut rng);
        let mut matches = scene(&mut rng, &pose, &normal, distance, 200);
        for m in &mut matches[..100] {
            for p in [&mut m.first, &mut m.second] {
                *p += Vector2::new(gauss(&mut rng), gauss(&mut rng)) * sigma;
            }
        }
        for m in &mut matches[100..] {
            m.second = Vector2::new(rng.random_range(-0.5..0.5), rng.random_range(-0.5..0.5));
        }
        let options = Options {
            seed,
            ..Options::default()
        };
        let scorer = HomographyScorer::new(sigma);
        let run = || {
            ransac(
                &FourPoint,
                &scorer,
                &mut Uniform::default(),
                &matches,
                &options,
            )
        };
        let report = run();
        assert_eq!(report, run());
        let best = report.best.unwrap();
        let good = best.inliers.iter().filter(|i| **i < 100).count();
        // 95 of 100 expected, sqrt(4.75) the standard deviation; wrong ones hardly ever hit a point.
        assert!(
            good >= 84 && best.inliers.len() <= good + 3,
            "{seed}: {good}"
        );
        let poses = plane_poses(best.model.matrix(), &matches[..100], 0.0);
        assert!(
            poses
                .iter()
                .any(|p| (p.rotation.inverse() * pose.rotation).angle() < 0.02)
        );
    }
    // Three of four collinear: no model.
    let line: Vec<_> = (0..20)
        .map(|k| f64::from(k) * 0.05)
        .map(|x| Correspondence {
            first: Vector2::new(x, 2.0 * x),
            second: Vector2::new(x, x),
        })
        .collect();
    let options = Options {
        max_trials: 50,
        ..Options::default()
    };
    let report = ransac(
        &FourPoint,
        &HomographyScorer::new(sigma),
        &mut Uniform::default(),
        &line,
        &options,
    );
    assert!(report.best.is_none() && report.samples_without_model == 50);
}
