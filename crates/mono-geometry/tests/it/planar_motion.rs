//! Planar motion of a mounted camera: two points, one point on an arc, degenerate motions, derivatives.

use crate::common::{config, gauss};
use estimation_base::wrap;
use mono_geometry::epipolar::{
    ArcOnePoint, Correspondence, EpipolarModel, Freedom, PlanarMotion, PlanarTwoPoint,
    SampsonScorer, arc_from_one, essential, in_front, planar_from_two, refine,
};
use mono_geometry::ransac::{Options, Uniform, ransac};
use mono_geometry::{Mount, Se2, Se3, so3};
use nalgebra::{Matrix3, SVector, Vector2, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The paper's mount: 90 degrees to the left of travel, level, with a lever arm.
fn sideways() -> Mount {
    // Columns: camera x = body x (right of a camera that looks left), y = down, z = left.
    let axes = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0);
    Mount::new(&axes, &Vector3::new(0.1, 0.15, 0.4)).expect("a rotation")
}

fn tilted(rng: &mut ChaCha8Rng) -> Mount {
    let vector = Vector3::new(gauss(rng), gauss(rng), gauss(rng));
    let rotation = sideways().body_from_camera.rotation * so3::exp(&vector);
    Mount::new(
        rotation.matrix(),
        &Vector3::new(gauss(rng), gauss(rng), gauss(rng)),
    )
    .expect("a rotation")
}

/// Motion of the camera when the body moves to `pose`.
fn camera_motion(mount: &Mount, pose: &Se2) -> Se3 {
    let camera = |body: &Se2| mount.world_from_camera(body, 0.0, 0.0, 0.0);
    camera(pose).inverse().compose(&camera(&Se2::identity()))
}

/// Direction in which the camera travels, in the first body axes.
fn travel(mount: &Mount, pose: &Se2) -> f64 {
    let arm = mount.body_from_camera.translation;
    let (sine, cosine) = pose.phi.sin_cos();
    let x = pose.x + cosine * arm.x - sine * arm.y - arm.x;
    let y = pose.y + sine * arm.x + cosine * arm.y - arm.y;
    y.atan2(x)
}

fn scene(rng: &mut ChaCha8Rng, pose: &Se3, count: usize) -> Vec<Correspondence> {
    let mut matches = Vec::new();
    let baseline = pose.translation.norm();
    let unit = if baseline > 0.0 { baseline } else { 1.0 };
    while matches.len() < count {
        let depth = rng.random_range(3.0..12.0) * unit;
        let ray = Vector3::new(
            rng.random_range(-0.5..0.5),
            rng.random_range(-0.4..0.4),
            1.0,
        );
        let moved = pose.transform_point(&(ray * depth));
        if moved.z > 0.2 * unit {
            matches.push(Correspondence {
                first: ray.xy(),
                second: (moved / moved.z).xy(),
            });
        }
    }
    matches
}

fn two(mount: &Mount, matches: &[Correspondence]) -> Vec<PlanarMotion> {
    let mut motions = Vec::new();
    planar_from_two(mount, &[matches[0], matches[1]], &mut motions);
    motions
}

proptest! {
    #![proptest_config(config(500))]

    #[test]
    fn two_points_recover_turn_and_direction(
        seed in 0_u64..1_000_000, phi in -0.6..0.6_f64, heading in -3.1..3.1_f64, step in 0.3..1.0_f64, level in any::<bool>(),
    ) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mount = if level { sideways() } else { tilted(&mut rng) };
        let pose = Se2::new(step * heading.cos(), step * heading.sin(), phi);
        let motion = camera_motion(&mount, &pose);
        prop_assume!(motion.translation.norm() > 0.05);
        let matches = scene(&mut rng, &motion, 30);
        let truth = essential(&motion).unwrap();
        let motions = two(&mount, &matches);
        prop_assert!(motions.len() <= 2);
        // A pair near the horizon or of one direction is badly conditioned, however exact: the best of fifteen pairs.
        let mut best = f64::INFINITY;
        for pair in matches.chunks(2) {
            for found in two(&mount, pair) {
                let error = (found.matrix() - truth).norm().min((found.matrix() + truth).norm());
                if error < best {
                    best = error;
                    let all: Vec<usize> = (0..30).collect();
                    let found = found.oriented(&matches, &all, 0.0);
                    prop_assert!(error > 1e-6 || wrap(found.turn_rad - phi).abs() < 1e-5);
                    prop_assert!(error > 1e-6 || wrap(found.direction_rad - travel(&mount, &pose)).abs() < 1e-5);
                    prop_assert!(error > 1e-6 || in_front(&found.second_from_first(), &matches, &all, 0.0).0 == 30);
                }
                // Every motion explains its two matches.
                for m in pair {
                    prop_assert!(m.second.push(1.0).dot(&(found.matrix() * m.first.push(1.0))).abs() < 1e-12);
                }
            }
        }
        prop_assert!(best < 1e-10, "{}", best);
    }

    #[test]
    fn one_point_on_an_arc_recovers_the_turn(
        seed in 0_u64..1_000_000, turn in -1.0..1.0_f64, radius in 1.0..20.0_f64, side in -0.4..0.4_f64, back in any::<bool>(),
    ) {
        prop_assume!(turn.abs() > 1e-3);
        // The arm points sideways only, along the axle: the camera drives an arc of its own.
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let arm = Vector3::new(0.0, side, 0.7);
        let mount = Mount::new(sideways().body_from_camera.rotation.matrix(), &arm).unwrap();
        let sign = if back { -1.0 } else { 1.0 };
        let chord = sign * 2.0 * radius * (0.5 * turn.abs()).sin();
        let pose = Se2::new(chord * (0.5 * turn).cos(), chord * (0.5 * turn).sin(), turn);
        let motion = camera_motion(&mount, &pose);
        let matches = scene(&mut rng, &motion, 10);
        let all: Vec<usize> = (0..10).collect();
        for m in &matches {
            // A match on the horizon has no weight.
            if m.first.y.abs() < 1e-3 {
                continue;
            }
            let found = arc_from_one(&mount, m).unwrap().oriented(&matches, &all, 0.0);
            prop_assert!((found.turn_rad - turn).abs() < 1e-8, "{} {}", found.turn_rad, turn);
            let reverse = if back { std::f64::consts::PI } else { 0.0 };
            prop_assert!(wrap(found.direction_rad - 0.5 * turn - reverse).abs() < 1e-8);
        }
    }

    #[test]
    fn tangents_are_derivatives(seed in 0_u64..10_000, turn in -3.0..3.0_f64, direction in -3.0..3.0_f64) {
        let mount = tilted(&mut ChaCha8Rng::seed_from_u64(seed));
        let motion = PlanarMotion::new(&mount, turn, direction);
        prop_assert!((motion.matrix() - essential(&motion.second_from_first()).unwrap()).amax() < 1e-14);
        let h = 1e-6;
        for (k, tangent) in motion.tangents().iter().enumerate() {
            let mut delta = SVector::<f64, 2>::zeros();
            delta[k] = h;
            let numeric = (motion.moved(&delta).matrix() - motion.moved(&-delta).matrix()) / (2.0 * h);
            prop_assert!((numeric - tangent).amax() < 1e-9);
        }
    }
}

#[test]
fn closed_forms_of_the_sideways_camera() {
    // Straight on by a tenth of the depth: a point moves against the travel, to the left in a camera that looks left of it.
    let mount = sideways();
    let ahead = camera_motion(&mount, &Se2::new(0.2, 0.0, 0.0));
    assert!((ahead.translation - Vector3::new(-0.2, 0.0, 0.0)).amax() < 1e-15);
    let m = Correspondence {
        first: Vector2::new(0.1, 0.3),
        second: Vector2::new(0.0, 0.3),
    };
    let found = arc_from_one(&mount, &m).unwrap();
    assert!(found.turn_rad.abs() < 1e-15 && found.direction_rad.abs() < 1e-15);
    // E is that of a step along the image rows.
    let row = found.matrix() / found.matrix()[(1, 2)].abs();
    assert!((row.abs() - Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0)).amax() < 1e-15);
    // A forward arm is neglected: over a chord s it turns the direction by about turn * arm / s.
    let arm = 0.1;
    let mount = Mount::new(
        mount.body_from_camera.rotation.matrix(),
        &Vector3::new(arm, 0.0, 0.0),
    )
    .unwrap();
    let (turn, chord) = (0.02_f64, 0.5);
    let pose = Se2::new(chord * (0.5 * turn).cos(), chord * (0.5 * turn).sin(), turn);
    let error = travel(&mount, &pose) - 0.5 * turn;
    assert!(
        (error - turn * arm / chord).abs() < 1e-5 && error > 0.003,
        "{error}"
    );
}

#[test]
fn degenerate_motions_and_samples_give_no_model() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for _ in 0..200 {
        let mount = tilted(&mut rng);
        let still = scene(&mut rng, &Se3::identity(), 2);
        assert!(two(&mount, &still).is_empty());
        // On the spot: the camera itself stands on the axis.
        let rotation = mount.body_from_camera.rotation.matrix();
        let centred = Mount::new(rotation, &Vector3::new(0.0, 0.0, 0.5)).unwrap();
        let turned = camera_motion(&centred, &Se2::new(0.0, 0.0, 0.4));
        assert!(two(&centred, &scene(&mut rng, &turned, 2)).is_empty());
        // The same match again.
        let moved = camera_motion(&mount, &Se2::new(0.5, 0.1, 0.2));
        let matches = scene(&mut rng, &moved, 1);
        assert!(two(&mount, &[matches[0], matches[0]]).is_empty());
    }
    // On the horizon of a level camera, the middle row.
    let horizon = |x: f64, moved: f64| Correspondence {
        first: Vector2::new(x, 0.0),
        second: Vector2::new(moved, 0.0),
    };
    let mount = sideways();
    assert!(two(&mount, &[horizon(0.1, 0.05), horizon(-0.2, -0.3)]).is_empty());
    assert!(arc_from_one(&mount, &horizon(0.1, 0.05)).is_none());
    let nan = Correspondence {
        first: Vector2::new(f64::NAN, 0.1),
        second: Vector2::new(0.1, 0.1),
    };
    assert!(arc_from_one(&mount, &nan).is_none());
    assert!(two(&mount, &[nan, nan]).is_empty());
    // One match that did not move is a standstill for the arc solver: no turn, any step; told by cheirality only.
    let still = Correspondence {
        first: Vector2::new(0.1, 0.3),
        second: Vector2::new(0.1, 0.3),
    };
    let motion = arc_from_one(&mount, &still).unwrap();
    assert_eq!(
        in_front(&motion.second_from_first(), &[still], &[0], 0.0),
        (0, 1)
    );
}

#[test]
fn robust_runs_need_few_trials_and_the_covariance_is_honest() {
    let mount = sideways();
    let camera = crate::common::pinhole();
    let sigma_px = 0.5;
    let sigma = Vector2::new(sigma_px / camera.fx, sigma_px / camera.fy);
    let scorer = SampsonScorer::normalized(&camera, sigma_px);
    let (mut nees, mut runs, mut trials) = (0.0, 0_u32, 0);
    for seed in 0..200 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let pose = Se2::new(0.4, 0.05 * gauss(&mut rng), 0.1 * gauss(&mut rng));
        let truth = PlanarMotion::new(&mount, pose.phi, travel(&mount, &pose));
        let mut matches = scene(&mut rng, &camera_motion(&mount, &pose), 100);
        for m in &mut matches[..50] {
            for p in [&mut m.first, &mut m.second] {
                *p += Vector2::new(gauss(&mut rng), gauss(&mut rng)).component_mul(&sigma);
            }
        }
        for m in &mut matches[50..] {
            m.second = Vector2::new(rng.random_range(-0.5..0.5), rng.random_range(-0.4..0.4));
        }
        let options = Options {
            seed,
            ..Options::default()
        };
        let report = ransac(
            &PlanarTwoPoint { mount },
            &scorer,
            &mut Uniform::default(),
            &matches,
            &options,
        );
        trials += report.trials;
        let best = report.best.unwrap();
        assert!(
            best.inliers.iter().filter(|i| **i < 50).count() >= 38,
            "{seed}"
        );
        // From the right matches alone, so that selection does not shrink the noise.
        let good: Vec<usize> = (0..50).collect();
        let refined = refine(
            &best.model,
            &matches,
            &good,
            &sigma.component_mul(&sigma),
            30,
        )
        .unwrap();
        let found = refined.model.oriented(&matches, &good, 0.0);
        let delta = SVector::<f64, 2>::new(
            wrap(truth.turn_rad - found.turn_rad),
            wrap(truth.direction_rad - found.direction_rad),
        );
        nees += delta.dot(&refined.covariance.cholesky().unwrap().solve(&delta));
        runs += 1;
    }
    let mean = nees / f64::from(runs);
    let band = 4.5 * (4.0 / f64::from(runs)).sqrt();
    assert!((mean - 2.0).abs() < band, "{mean} +- {band}");
    // P = 1/4: 25 trials at 0.999, a few more with noise.
    assert!(trials < 60 * runs as usize, "{trials}");

    // The arc needs one point: a level drive without side slip and without a forward arm.
    let axle = Mount::new(
        mount.body_from_camera.rotation.matrix(),
        &Vector3::new(0.0, 0.2, 0.0),
    )
    .unwrap();
    let (turn, chord) = (0.15_f64, 0.5);
    let pose = Se2::new(chord * (0.5 * turn).cos(), chord * (0.5 * turn).sin(), turn);
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    let mut matches = scene(&mut rng, &camera_motion(&axle, &pose), 100);
    for m in &mut matches[40..] {
        m.second = Vector2::new(rng.random_range(-0.5..0.5), rng.random_range(-0.4..0.4));
    }
    let solver = ArcOnePoint { mount: axle };
    let options = Options {
        min_trials: 0,
        ..Options::default()
    };
    let report = ransac(
        &solver,
        &scorer,
        &mut Uniform::default(),
        &matches,
        &options,
    );
    let best = report.best.unwrap();
    assert!((0..40).all(|i| best.inliers.contains(&i)));
    assert!((best.model.turn_rad - turn).abs() < 0.01);
    assert!(report.trials < 20, "{}", report.trials);
}
