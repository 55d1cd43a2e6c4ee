//! Perspective-n-point: exact poses of three points in nasty configurations, refinement and its covariance, points without
//! a start, points among wrong matches.

use crate::common::{config, gauss, look_at, pinhole};
use mono_geometry::linalg::svd;
use mono_geometry::pnp::{
    Correspondence, NoPose, RefineOptions, RobustPoseOptions, estimate_pose, estimate_pose_ransac,
    p3p, refine_pose,
};
use mono_geometry::ransac::{Options, Prosac, Uniform};
use mono_geometry::{NoiseShape, RobustLoss, Se3, Termination, so3};
use nalgebra::{DMatrix, Rotation3, Vector2, Vector3, Vector6};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

fn random_rotation(rng: &mut ChaCha8Rng) -> Rotation3<f64> {
    let q = nalgebra::Quaternion::new(gauss(rng), gauss(rng), gauss(rng), gauss(rng));
    nalgebra::UnitQuaternion::from_quaternion(q).to_rotation_matrix()
}

/// Distance of the nearest solution: rotation angle plus position over `scale`.
fn nearest(truth: &Se3, found: &[Se3], scale: f64) -> f64 {
    found
        .iter()
        .map(|pose| {
            so3::log(&(truth.rotation.inverse() * pose.rotation)).norm()
                + (truth.translation - pose.translation).norm() / scale
        })
        .fold(f64::INFINITY, f64::min)
}

/// Bearings of camera points, and the points in the world.
fn problem(
    world_from_camera: &Se3,
    in_camera: &[Vector3<f64>; 3],
) -> ([Vector3<f64>; 3], [Vector3<f64>; 3]) {
    (
        in_camera.map(|p| p.normalize()),
        in_camera.map(|p| world_from_camera.transform_point(&p)),
    )
}

/// How far rounding may move the pose (angle, and position over `scale`): input rounding over the smallest singular value of
/// the Jacobian of the unit rays by (rho / scale, omega), at most its cube root: on the danger cylinder two solutions meet
/// (square root), and on lines of it three.
fn tolerance(world_from_camera: &Se3, in_camera: &[Vector3<f64>; 3], scale: f64) -> f64 {
    let mut jacobian = DMatrix::zeros(9, 6);
    let mut rounding = f64::EPSILON;
    for (k, p) in in_camera.iter().enumerate() {
        let ray = p.normalize();
        let by_point = (nalgebra::Matrix3::identity() - ray * ray.transpose()) / p.norm();
        let by_pose =
            world_from_camera.inverse_point_jacobian(&world_from_camera.transform_point(p));
        let mut rows = by_point * by_pose;
        rows.fixed_columns_mut::<3>(0).scale_mut(scale);
        jacobian.view_mut((3 * k, 0), (3, 6)).copy_from(&rows);
        rounding += f64::EPSILON * (1.0 + world_from_camera.translation.norm() / p.norm());
    }
    let smallest = svd(&jacobian).expect("valid").singular_values[5];
    100.0 * (rounding / smallest).min(rounding.cbrt())
}

#[test]
fn a_hundred_thousand_random_triples_have_their_pose_among_the_solutions() {
    let mut rng = ChaCha8Rng::seed_from_u64(2018);
    let (trials, mut missed, mut worst) = (100_000, 0, 0.0_f64);
    let mut counts = [0_usize; 5];
    for _ in 0..trials {
        let truth = Se3::new(
            random_rotation(&mut rng),
            Vector3::new(gauss(&mut rng), gauss(&mut rng), gauss(&mut rng)),
        );
        let in_camera = [(); 3].map(|()| {
            let (x, y) = (uniform(&mut rng, -1.0, 1.0), uniform(&mut rng, -1.0, 1.0));
            Vector3::new(x, y, 1.0) * uniform(&mut rng, 0.1, 10.0)
        });
        let (rays, points) = problem(&truth, &in_camera);
        let solutions = p3p(&rays, &points);
        counts[solutions.as_slice().len()] += 1;
        let error = nearest(&truth, solutions.as_slice(), 1.0);
        missed += usize::from(error > 1e-6);
        worst = worst.max(error);
    }
    println!("missed {missed} of {trials}, worst {worst:.1e}, with 0..4 solutions: {counts:?}");
    // The draw holds no problem within 1e-10 of a degenerate one.
    assert_eq!(missed, 0);
    assert!(worst < 1e-7, "{worst}");
}

#[test]
fn every_solution_sees_the_points_along_the_rays() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut several = 0;
    for _ in 0..5_000 {
        let truth = Se3::new(random_rotation(&mut rng), Vector3::new(5.0, -3.0, 1.0));
        let in_camera = [(); 3].map(|()| {
            Vector3::new(
                gauss(&mut rng),
                gauss(&mut rng),
                uniform(&mut rng, 3.0, 5.0),
            )
        });
        let (rays, points) = problem(&truth, &in_camera);
        let solutions = p3p(&rays, &points);
        several += usize::from(solutions.as_slice().len() > 2);
        for (k, pose) in solutions.as_slice().iter().enumerate() {
            let excess = pose.rotation.matrix().transpose() * pose.rotation.matrix();
            assert!((excess - nalgebra::Matrix3::identity()).amax() < 1e-14);
            assert!((pose.rotation.matrix().determinant() - 1.0).abs() < 1e-14);
            for (ray, point) in rays.iter().zip(&points) {
                let seen = pose.inverse().transform_point(point).normalize();
                assert!((seen - ray).norm() < 1e-8, "{}", (seen - ray).norm());
            }
            for other in &solutions.as_slice()[..k] {
                assert!(nearest(pose, &[*other], 1.0) > 1e-9, "twice the same");
            }
        }
    }
    assert!(several > 500, "{several}");
}

fn nasty() -> impl Strategy<Value = ([Vector3<f64>; 3], f64)> {
    let number = -1.0..1.0_f64;
    let random = prop::array::uniform3((number.clone(), number.clone(), 1.5..4.0_f64))
        .prop_map(|p| (p.map(|(x, y, z)| Vector3::new(x * z, y * z, z)), 3.0));
    // Parallel to the image; equilateral and centred on the axis, the most symmetric of all.
    let frontal = (
        0.1..1.0_f64,
        0.5..50.0_f64,
        prop_oneof![Just(0.0), number.clone()],
    )
        .prop_map(|(side, z, turn)| {
            let corner = |k: f64| {
                let angle = turn + k * std::f64::consts::TAU / 3.0;
                Vector3::new(side * angle.cos(), side * angle.sin(), z)
            };
            ([corner(0.0), corner(1.0), corner(2.0)], z)
        });
    // Camera on or near the circular cylinder through the points, across their plane.
    let cylinder = (
        prop::array::uniform3(-3.0..3.0_f64),
        2.0..5.0_f64,
        prop_oneof![Just(0.0), Just(1e-12), Just(1e-8), Just(1e-4)],
    )
        .prop_filter("apart", |(a, _, _)| {
            (a[0] - a[1]).abs() > 0.2 && (a[1] - a[2]).abs() > 0.2 && (a[2] - a[0]).abs() > 0.2
        })
        .prop_map(|(angles, height, off)| {
            // The camera at (1 + off, 0) of the circle, `height` above the plane, looking down on it.
            let point = |a: f64| Vector3::new(a.cos() - 1.0 - off, a.sin(), height);
            (angles.map(point), height)
        });
    // A field of view of a ten-thousandth.
    let narrow = (
        prop::array::uniform3((number.clone(), number.clone(), number.clone())),
        prop_oneof![Just(1e2), Just(1e4)],
    )
        .prop_map(|(p, far)| (p.map(|(x, y, z)| Vector3::new(x, y, far + z)), far));
    // One point on the axis itself, the others beside it.
    let on_axis = (number.clone(), number, 1.0..3.0_f64).prop_map(|(x, y, z)| {
        (
            [
                Vector3::new(0.0, 0.0, z),
                Vector3::new(0.5 + x * x, y, z),
                Vector3::new(x, 0.7 + y * y, 1.2 * z),
            ],
            z,
        )
    });
    prop_oneof![random, frontal, cylinder, narrow, on_axis]
}

proptest! {
    #![proptest_config(config(4_000))]

    #[test]
    fn nasty_triples_have_their_pose_to_the_conditioning(
        (shape, depth) in nasty(),
        unit in prop_oneof![Just(1.0), Just(1e-6), Just(1e6)],
        axis in (-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64),
        angle in prop_oneof![Just(0.0), Just(std::f64::consts::PI), Just(1e-9), -3.0..3.0_f64],
        place in prop_oneof![Just(0.0), Just(1.0), Just(100.0)],
        order in 0_usize..3,
    ) {
        let axis = Vector3::new(axis.0, axis.1, axis.2 + 1e-3).normalize();
        let truth = Se3::new(so3::exp(&(axis * angle)), Vector3::new(1.0, -2.0, 0.5) * (place * unit));
        let in_camera = [0, 1, 2].map(|k| shape[(k + order) % 3] * unit);
        // Thin triangles are another test.
        let area = (in_camera[1] - in_camera[0]).cross(&(in_camera[2] - in_camera[0])).norm();
        prop_assume!(area > 1e-3 * unit * unit);
        let (rays, points) = problem(&truth, &in_camera);
        let scale = depth * unit;
        let allowed = tolerance(&truth, &in_camera, scale);
        let error = nearest(&truth, p3p(&rays, &points).as_slice(), scale);
        prop_assert!(error <= allowed, "{error:.2e} {allowed:.2e}");
    }

    #[test]
    fn degenerate_triples_give_no_pose(
        start in (-1.0..1.0_f64, -1.0..1.0_f64, 2.0..4.0_f64), step in (-1.0..1.0_f64, -1.0..1.0_f64, -0.5..0.5_f64),
        share in 0.1..0.9_f64, unit in prop_oneof![Just(1.0), Just(1e-6), Just(1e6)], seed in 0_u64..1000,
    ) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let truth = Se3::new(random_rotation(&mut rng), Vector3::new(0.1, 0.2, 0.3) * unit);
        let a = Vector3::new(start.0, start.1, start.2) * unit;
        let b = a + Vector3::new(step.0, step.1 + 1.5, step.2) * unit;
        let c = Vector3::new(0.5, -1.0, 3.0) * unit;
        for degenerate in [[a, b, a + (b - a) * share], [a, a, c], [a, a, a], [a, a * (1.0 + share), c]] {
            let (rays, points) = problem(&truth, &degenerate);
            prop_assert!(p3p(&rays, &points).as_slice().is_empty());
        }
    }
}

#[test]
fn unusable_numbers_give_no_pose() {
    let rays = [
        Vector3::new(0.0, 0.0, 1.0),
        Vector3::new(0.1, 0.0, 1.0),
        Vector3::new(0.0, 0.1, 1.0),
    ];
    let points = rays.map(|r| r * 2.0);
    assert!(!p3p(&rays, &points).as_slice().is_empty());
    for bad in [f64::NAN, f64::INFINITY, 1e300, -1e-320] {
        for k in 0..3 {
            let (mut r, mut p) = (rays, points);
            r[k].x = bad;
            p[k].y = bad;
            for pose in p3p(&r, &points)
                .as_slice()
                .iter()
                .chain(p3p(&rays, &p).as_slice())
            {
                assert!(
                    pose.translation
                        .iter()
                        .chain(pose.rotation.matrix().iter())
                        .all(|v| v.is_finite())
                );
            }
        }
    }
    assert!(p3p(&[Vector3::zeros(); 3], &points).as_slice().is_empty());
}

/// Points seen from a pose near (0, 0, 0) looking along world y, with noise of `sigma_px`.
fn scene(
    rng: &mut ChaCha8Rng,
    count: usize,
    planar: bool,
    sigma_px: f64,
) -> (Se3, Vec<Correspondence>) {
    let truth = look_at(Vector3::new(0.2, -0.1, 0.3), Vector3::new(0.0, 5.0, 0.0));
    let correspondences = (0..count)
        .map(|_| {
            let depth = if planar { 4.0 } else { uniform(rng, 2.0, 8.0) };
            let point_in_world = Vector3::new(
                uniform(rng, -0.35, 0.35) * depth,
                depth,
                uniform(rng, -0.25, 0.25) * depth,
            );
            let exact = pinhole()
                .project(&truth.inverse().transform_point(&point_in_world))
                .expect("valid");
            Correspondence {
                point_in_world,
                pixel_ideal: exact + Vector2::new(gauss(rng), gauss(rng)) * sigma_px,
                sigma_px: sigma_px.max(0.01),
                shape: NoiseShape::ROUND,
            }
        })
        .collect();
    (truth, correspondences)
}

fn nees(truth: &Se3, mean: &Se3, covariance: &nalgebra::Matrix6<f64>) -> f64 {
    let error = mean.inverse().compose(truth).log();
    error.dot(&covariance.cholesky().expect("valid").solve(&error))
}

#[test]
fn refined_poses_are_consistent() {
    let trials = 3_000;
    let band = 4.5 * (12.0 / f64::from(trials)).sqrt();
    for (count, planar) in [(4, false), (8, false), (30, false), (12, true)] {
        let mut rng = ChaCha8Rng::seed_from_u64(30 + count as u64);
        let (mut sum, mut chi_square) = (0.0, 0.0);
        for _ in 0..trials {
            // Spread over the image by construction of the first four, so that every geometry is well conditioned.
            let (truth, mut seen) = scene(&mut rng, count, planar, 0.3);
            for (k, (x, z)) in [(-0.3, -0.2), (0.3, -0.2), (0.3, 0.2), (-0.3, 0.2)]
                .into_iter()
                .enumerate()
            {
                let depth = if planar { 4.0 } else { 3.0 + k as f64 };
                let point = Vector3::new(x * depth, depth, z * depth);
                let exact = pinhole()
                    .project(&truth.inverse().transform_point(&point))
                    .expect("valid");
                seen[k].point_in_world = point;
                seen[k].pixel_ideal = exact + Vector2::new(gauss(&mut rng), gauss(&mut rng)) * 0.3;
            }
            let found =
                refine_pose(&pinhole(), &truth, &seen, &RefineOptions::default()).expect("valid");
            assert!(found.termination.converged(), "{:?}", found.termination);
            sum += nees(&truth, &found.world_from_camera, &found.covariance);
            chi_square += found.chi_square;
        }
        let mean = sum / f64::from(trials);
        assert!((mean - 6.0).abs() < band, "{count} points: NEES {mean}");
        let dof = 2.0 * count as f64 - 6.0;
        let mean = chi_square / f64::from(trials);
        assert!(
            (mean - dof).abs() < 4.5 * (2.0 * dof / f64::from(trials)).sqrt(),
            "{count} points: chi-square {mean}"
        );
    }
}

#[test]
fn the_refined_pose_is_the_minimum_and_its_covariance_the_curvature() {
    for loss in [RobustLoss::None, RobustLoss::Huber { threshold: 50.0 }] {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let (truth, seen) = scene(&mut rng, 12, false, 0.5);
        let options = RefineOptions {
            loss,
            max_iterations: 50,
        };
        let start = truth.compose(&Se3::exp(&Vector6::new(0.3, -0.2, 0.4, 0.1, -0.1, 0.2)));
        let found = refine_pose(&pinhole(), &start, &seen, &options).expect("valid");
        let cost = |pose: &Se3| -> f64 {
            seen.iter()
                .map(|c| {
                    let pixel = pinhole()
                        .project(&pose.inverse().transform_point(&c.point_in_world))
                        .expect("valid");
                    ((c.pixel_ideal - pixel) / c.sigma_px).norm_squared()
                })
                .sum()
        };
        assert!((cost(&found.world_from_camera) - found.chi_square).abs() < 1e-9);
        assert!(nees(&truth, &found.world_from_camera, &found.covariance) < 30.0);
        let sigmas = found.covariance.cholesky().expect("valid").l();
        for axis in 0..6 {
            for sign in [-1.0, 1.0] {
                let delta: Vector6<f64> = sigmas.column(axis) * (0.01 * sign);
                let rise =
                    cost(&found.world_from_camera.compose(&Se3::exp(&delta))) - found.chi_square;
                assert!((rise - 1e-4).abs() < 5e-6, "{axis}: {rise}");
            }
        }
    }
}

#[test]
fn a_robust_loss_bears_wrong_matches() {
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let (truth, mut seen) = scene(&mut rng, 60, false, 0.3);
    for c in &mut seen[..12] {
        c.pixel_ideal += Vector2::new(
            uniform(&mut rng, 20.0, 60.0),
            uniform(&mut rng, -40.0, 60.0),
        );
    }
    let with = |loss| {
        refine_pose(
            &pinhole(),
            &truth,
            &seen,
            &RefineOptions {
                loss,
                max_iterations: 100,
            },
        )
        .expect("valid")
    };
    let plain = with(RobustLoss::None);
    let cauchy = with(RobustLoss::Cauchy { threshold: 3.0 });
    let huber = with(RobustLoss::Huber { threshold: 1.5 });
    let error = |p: &Se3| nearest(&truth, &[*p], 1.0);
    assert!(error(&plain.world_from_camera) > 0.05);
    assert!(error(&huber.world_from_camera) < 0.3 * error(&plain.world_from_camera));
    assert!(
        error(&cauchy.world_from_camera) < 0.01,
        "{}",
        error(&cauchy.world_from_camera)
    );
    assert!(
        cauchy.robust_chi_square < cauchy.chi_square && plain.robust_chi_square == plain.chi_square
    );
}

#[test]
fn endings_and_refusals_carry_their_numbers() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (truth, seen) = scene(&mut rng, 10, false, 0.5);
    let off = truth.compose(&Se3::exp(&Vector6::new(0.1, 0.1, 0.1, 0.05, 0.05, 0.05)));
    let refine = |seen: &[Correspondence], max_iterations| {
        refine_pose(
            &pinhole(),
            &off,
            seen,
            &RefineOptions {
                max_iterations,
                ..RefineOptions::default()
            },
        )
    };
    match refine(&seen, 1).expect("valid").termination {
        Termination::IterationLimit {
            iterations: 1,
            relative,
        } => assert!(relative > 0.5),
        other => panic!("{other:?}"),
    }
    match refine(&seen, 50).expect("valid").termination {
        Termination::Step { length, threshold } => assert!(length <= threshold),
        other => panic!("{other:?}"),
    }
    // A sigma far too small makes a cost of which the last steps are rounding.
    let mut sure = seen.clone();
    for c in &mut sure {
        c.sigma_px = 1e-9;
    }
    match refine(&sure, 50).expect("valid").termination {
        Termination::PredictedDecrease {
            decrease,
            threshold,
        } => assert!(decrease <= threshold),
        other => panic!("{other:?}"),
    }
    assert_eq!(
        refine(&seen[..2], 50),
        Err(NoPose::TooFewPoints {
            points: 2,
            required: 3
        })
    );
    assert_eq!(
        estimate_pose(&pinhole(), &seen[..3], &RefineOptions::default()),
        Err(NoPose::TooFewPoints {
            points: 3,
            required: 4
        })
    );
    let mut bad = seen.clone();
    bad[4].sigma_px = 0.0;
    assert_eq!(
        refine(&bad, 50),
        Err(NoPose::BadCorrespondence { index: 4 })
    );
    let mut behind = seen.clone();
    behind[7].point_in_world = Vector3::new(0.0, -5.0, 0.0);
    match refine(&behind, 50) {
        Err(NoPose::BehindCamera { index: 7, depth_m }) => assert!(depth_m < 0.0),
        other => panic!("{other:?}"),
    }
    let loss = RobustLoss::Huber { threshold: -1.0 };
    let options = RefineOptions {
        loss,
        ..RefineOptions::default()
    };
    assert!(matches!(
        refine_pose(&pinhole(), &off, &seen, &options),
        Err(NoPose::BadOption { .. })
    ));
    // Points of one line leave the turn about it free; one point many times leaves more.
    let mut line = seen;
    for (k, c) in line.iter_mut().enumerate() {
        c.point_in_world = Vector3::new(0.0, 4.0, 0.0) + Vector3::new(0.1, 0.05, 0.02) * k as f64;
        c.pixel_ideal = pinhole()
            .project(&truth.inverse().transform_point(&c.point_in_world))
            .expect("valid");
    }
    assert!(refine(&line, 50).is_err());
    assert!(matches!(
        estimate_pose(&pinhole(), &line, &RefineOptions::default()),
        Err(NoPose::NoCandidate { candidates: 0, .. })
    ));
}

#[test]
fn poses_without_a_start() {
    let mut rng = ChaCha8Rng::seed_from_u64(77);
    for (count, planar) in [(4, false), (5, false), (20, false), (8, true), (40, true)] {
        let mut missed = 0;
        for _ in 0..300 {
            let (truth, mut seen) = scene(&mut rng, count, planar, 0.3);
            // Anywhere in the world, in any attitude.
            let moved = Se3::new(random_rotation(&mut rng), Vector3::new(100.0, -50.0, 7.0));
            for c in &mut seen {
                c.point_in_world = moved.transform_point(&c.point_in_world);
            }
            let truth = moved.compose(&truth);
            let reference =
                refine_pose(&pinhole(), &truth, &seen, &RefineOptions::default()).expect("valid");
            let fit = estimate_pose(&pinhole(), &seen, &RefineOptions::default()).expect("valid");
            // Never above the minimum next to the truth, except for the tolerance of both.
            missed +=
                usize::from(fit.estimate.chi_square > reference.chi_square * (1.0 + 1e-6) + 1e-6);
            if let Some(other) = fit.runner_up_chi_square {
                assert!(other >= fit.estimate.robust_chi_square);
            }
        }
        assert!(missed == 0, "{count} {planar}: {missed}");
    }
}

#[test]
fn a_pose_among_wrong_matches() {
    for seed in 0..20 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (truth, mut seen) = scene(&mut rng, 100, seed % 2 == 0, 0.5);
        for c in &mut seen[..50] {
            c.pixel_ideal =
                Vector2::new(uniform(&mut rng, 0.0, 320.0), uniform(&mut rng, 0.0, 240.0));
        }
        let options = RobustPoseOptions {
            ransac: Options {
                seed,
                ..Options::default()
            },
            ..RobustPoseOptions::default()
        };
        let found = estimate_pose_ransac(&pinhole(), &seen, &mut Uniform::default(), &options)
            .expect("valid");
        // 1e-6 of chi-square with six degrees of freedom lies above 38.3; truncation makes the covariance 6 % small.
        assert!(
            nees(
                &truth,
                &found.estimate.world_from_camera,
                &found.estimate.covariance
            ) < 1.06 * 38.3
        );
        let good = found.inliers.iter().filter(|i| **i >= 50).count();
        assert!(
            good >= 43 && found.inliers.len() - good <= 4,
            "{good} of {}",
            found.inliers.len()
        );
        assert_eq!(
            found.estimate.degrees_of_freedom,
            2 * found.inliers.len() - 6
        );
        assert!(found.trials < 300, "{}", found.trials);
        let again = estimate_pose_ransac(&pinhole(), &seen, &mut Uniform::default(), &options)
            .expect("valid");
        assert_eq!(found, again);
        // The good ones first: a handful of samples.
        let qualities: Vec<f64> = (0..100).map(f64::from).collect();
        let ordered =
            estimate_pose_ransac(&pinhole(), &seen, &mut Prosac::new(&qualities), &options)
                .expect("valid");
        assert!(ordered.trials <= found.trials);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (_, mut noise) = scene(&mut rng, 40, false, 0.5);
    for c in &mut noise {
        c.pixel_ideal = Vector2::new(uniform(&mut rng, 0.0, 320.0), uniform(&mut rng, 0.0, 240.0));
    }
    let options = RobustPoseOptions {
        min_inliers: 10,
        ..RobustPoseOptions::default()
    };
    match estimate_pose_ransac(&pinhole(), &noise, &mut Uniform::default(), &options) {
        Err(NoPose::NoConsensus {
            inliers,
            required: 10,
        }) => assert!(inliers < 10),
        other => panic!("{other:?}"),
    }
}
