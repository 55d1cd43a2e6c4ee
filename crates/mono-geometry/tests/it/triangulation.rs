//! Triangulation: exact views, the least-squares minimum, consistency by Monte Carlo, every refusal with its value.

use crate::common::{config, gauss, look_at, pinhole, see};
use estimation_base::CholeskyFactor;
use mono_geometry::triangulation::{
    Acceptance, Observation, Rejection, linear, midpoint, triangulate,
};
use mono_geometry::{Mount, Se2, Se3};
use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Accepts any parallax but zero and any error.
fn open() -> Acceptance {
    Acceptance {
        min_parallax_rad: 0.0,
        chi_square_probability: 1.0,
        max_iterations: 50,
    }
}

proptest! {
    #![proptest_config(config(300))]

    #[test]
    fn exact_views_give_the_point(
        base in (-100.0..100.0_f64, -100.0..100.0_f64), depth in 0.5..20.0_f64,
        angle in 0.05..1.5_f64, views in 2_usize..6, side in -0.4..0.4_f64,
    ) {
        let target = Vector3::new(base.0, base.1 + depth, 0.3);
        let cameras: Vec<Se3> = (0..views).map(|k| {
            let a = angle * k as f64 / (views - 1) as f64;
            let position = target + Vector3::new(a.sin(), -a.cos(), 0.1 * a) * depth;
            look_at(position, target + Vector3::new(side, 0.0, 0.2 * side) * depth)
        }).collect();
        let observations: Vec<_> = cameras.iter().map(|c| see(c, &target, 0.5)).collect();
        let scale = depth / angle * 1e-12 * 100.0;
        prop_assert!((midpoint(&pinhole(), &observations).unwrap() - target).norm() < scale);
        prop_assert!((linear(&pinhole(), &observations).unwrap() - target).norm() < scale);
        let result = triangulate(&pinhole(), &observations, &Acceptance::default()).unwrap();
        prop_assert!((result.point - target).norm() < scale);
        prop_assert!(result.chi_square < 1e-12);
        prop_assert_eq!(result.degrees_of_freedom, 2 * views - 3);
        let lowest = cameras[0].translation - target;
        let highest = cameras[views - 1].translation - target;
        prop_assert!((result.parallax_rad - lowest.angle(&highest)).abs() < 1e-9);
        prop_assert!(CholeskyFactor::definite(&result.covariance).is_ok());
    }


    #[test]
    fn the_solution_is_the_least_squares_minimum(seed in 0_u64..100_000, angle in 0.1..1.0_f64) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let target = Vector3::new(0.1, 2.0, 0.2);
        let observations: Vec<_> = (0..3).map(|k| {
            let a = angle * f64::from(k) * 0.5;
            let camera = look_at(target + Vector3::new(a.sin(), -a.cos(), 0.0) * 2.0, target);
            let mut o = see(&camera, &target, 0.5 + f64::from(k));
            o.pixel_ideal += Vector2::new(gauss(&mut rng), gauss(&mut rng)) * o.sigma_px;
            o
        }).collect();
        let cost = |p: &Vector3<f64>| -> f64 {
            observations.iter().map(|o| {
                let pixel = pinhole().project(&o.camera_from_world.transform_point(p)).expect("in front");
                ((o.pixel_ideal - pixel) / o.sigma_px).norm_squared()
            }).sum()
        };
        let result = triangulate(&pinhole(), &observations, &open()).unwrap();
        prop_assert!((cost(&result.point) - result.chi_square).abs() < 1e-9);
        let sigmas = result.covariance.cholesky().unwrap().l();
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                // A step of a hundredth of a sigma raises the cost by 1e-4, up to second-order terms.
                let moved = result.point + sigmas.column(axis) * (0.01 * sign);
                let rise = cost(&moved) - result.chi_square;
                prop_assert!((rise - 1e-4).abs() < 5e-5, "{rise}");
            }
        }
    }

}

#[test]
fn triangulated_points_are_consistent() {
    let trials = 4_000;
    let band = 4.5 * (6.0 / f64::from(trials)).sqrt();
    for parallax in [5.0_f64, 20.0] {
        for views in [2, 5] {
            let mut rng = ChaCha8Rng::seed_from_u64(7 + views);
            let target = Vector3::new(0.3, 2.0, 0.1);
            let angle = parallax.to_radians();
            let mut nees = 0.0;
            let mut chi_square = 0.0;
            for _ in 0..trials {
                let observations: Vec<_> = (0..views)
                    .map(|k| {
                        let a = angle * (k as f64 / (views - 1) as f64 - 0.5);
                        let camera = look_at(
                            target + Vector3::new(a.sin(), -a.cos(), 0.02) * 2.0,
                            target + Vector3::x() * 0.1,
                        );
                        let mut o = see(&camera, &target, 0.5);
                        o.pixel_ideal += Vector2::new(gauss(&mut rng), gauss(&mut rng)) * 0.5;
                        o
                    })
                    .collect();
                let result = triangulate(&pinhole(), &observations, &open()).unwrap();
                let error = result.point - target;
                nees += error.dot(&result.covariance.cholesky().unwrap().solve(&error));
                chi_square += result.chi_square;
            }
            let mean = nees / f64::from(trials);
            // Second order in the relative depth error, (0.5 sqrt 2 / 369 / parallax)^2 = 5e-4 at 5 degrees.
            assert!(
                (mean - 3.0).abs() < band + 0.02,
                "{parallax} deg, {views} views: NEES {mean}"
            );
            let dof = 2.0 * views as f64 - 3.0;
            let mean = chi_square / f64::from(trials);
            assert!(
                (mean - dof).abs() < 4.5 * (2.0 * dof / f64::from(trials)).sqrt() + 0.02,
                "chi-square {mean}"
            );
        }
    }
}

#[test]
fn depth_uncertainty_closed_form() {
    let (depth, baseline, sigma) = (4.0, 0.2, 0.5);
    let target = Vector3::new(0.0, depth, 0.0);
    let forward = look_at(Vector3::zeros(), target).rotation;
    let observations: Vec<_> = [-0.5, 0.5]
        .iter()
        .map(|side| {
            see(
                &Se3::new(forward, Vector3::new(side * baseline, 0.0, 0.0)),
                &target,
                sigma,
            )
        })
        .collect();
    let result = triangulate(&pinhole(), &observations, &open()).unwrap();
    let expected = depth * depth * sigma * 2.0_f64.sqrt() / (pinhole().fx * baseline);
    let got = result.covariance[(1, 1)].sqrt();
    assert!((got / expected - 1.0).abs() < 1e-9, "{got} {expected}");
}

#[test]
fn too_little_parallax_is_refused_with_the_value() {
    let target = Vector3::new(0.0, 10.0, 0.0);
    let acceptance = Acceptance::default();
    let near = |baseline: f64| {
        let observations: Vec<_> = [0.0, baseline]
            .iter()
            .map(|x| see(&look_at(Vector3::new(*x, 0.0, 0.0), target), &target, 0.5))
            .collect();
        triangulate(&pinhole(), &observations, &acceptance)
    };
    match near(0.1) {
        Err(Rejection::ParallaxTooSmall {
            parallax_rad,
            required_rad,
        }) => {
            assert!((parallax_rad - 0.01_f64.atan()).abs() < 1e-9);
            assert_eq!(required_rad, 2.0_f64.to_radians());
        }
        other => panic!("{other:?}"),
    }
    assert!(near(0.4).is_ok());
    // No baseline at all, even when nothing is demanded.
    let camera = look_at(Vector3::zeros(), target);
    let twice = [see(&camera, &target, 0.5), see(&camera, &target, 0.5)];
    assert!(matches!(
        triangulate(&pinhole(), &twice, &open()),
        Err(Rejection::ParallaxTooSmall { .. })
    ));
    // A pure rotation with noisy pixels makes rays that do cross, at the camera.
    let mut turned = [see(&camera, &target, 0.5), see(&camera, &target, 0.5)];
    turned[1].pixel_ideal.x += 30.0;
    assert!(triangulate(&pinhole(), &turned, &open()).is_err());
}

#[test]
fn rays_that_part_meet_behind_the_cameras() {
    let target = Vector3::new(0.0, 3.0, 0.0);
    let left = look_at(Vector3::new(-0.5, 0.0, 0.0), Vector3::new(-0.5, 3.0, 0.0));
    let right = look_at(Vector3::new(0.5, 0.0, 0.0), Vector3::new(0.5, 3.0, 0.0));
    let mut observations = [see(&left, &target, 0.5), see(&right, &target, 0.5)];
    let (a, b) = (observations[0].pixel_ideal.x, observations[1].pixel_ideal.x);
    observations[0].pixel_ideal.x = b;
    observations[1].pixel_ideal.x = a;
    match triangulate(&pinhole(), &observations, &Acceptance::default()) {
        Err(Rejection::BehindCamera { depth_m, .. }) => assert!((depth_m + 3.0).abs() < 1e-6),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_wrong_match_fails_the_chi_square() {
    let target = Vector3::new(0.0, 3.0, 0.0);
    let mut observations: Vec<_> = [-0.5, 0.0, 0.5]
        .iter()
        .map(|x| see(&look_at(Vector3::new(*x, 0.0, 0.0), target), &target, 0.5))
        .collect();
    observations[2].pixel_ideal.y += 12.0;
    match triangulate(&pinhole(), &observations, &Acceptance::default()) {
        Err(Rejection::ChiSquareTooLarge {
            chi_square,
            threshold,
        }) => {
            assert!(chi_square > 100.0);
            // The 99.9 % quantile of three degrees of freedom is 16.266.
            assert!((threshold - 16.266).abs() < 0.02 * 16.266);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn without_steps_left_it_says_so() {
    let target = Vector3::new(0.0, 3.0, 0.0);
    let mut observations: Vec<_> = [-0.5, 0.5]
        .iter()
        .map(|x| see(&look_at(Vector3::new(*x, 0.0, 0.0), target), &target, 0.5))
        .collect();
    observations[0].pixel_ideal += Vector2::new(0.5, -1.0);
    let hasty = Acceptance {
        max_iterations: 0,
        ..Acceptance::default()
    };
    match triangulate(&pinhole(), &observations, &hasty) {
        Err(Rejection::NotConverged {
            iterations: 0,
            step_sigmas,
            required_sigmas,
        }) => {
            assert!(step_sigmas > required_sigmas);
        }
        other => panic!("{other:?}"),
    }
    assert!(triangulate(&pinhole(), &observations, &Acceptance::default()).is_ok());
}

#[test]
fn unusable_views_are_named() {
    let target = Vector3::new(0.0, 3.0, 0.0);
    let good: Vec<_> = [-0.5, 0.5]
        .iter()
        .map(|x| see(&look_at(Vector3::new(*x, 0.0, 0.0), target), &target, 0.5))
        .collect();
    let refused = |o: &[Observation], index: usize| {
        let result = triangulate(&pinhole(), o, &Acceptance::default());
        assert_eq!(
            result,
            Err(Rejection::BadObservation {
                view: index,
                views: o.len()
            })
        );
    };
    refused(&[], 0);
    refused(&good[..1], 1);
    for sigma in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let mut bad = good.clone();
        bad[1].sigma_px = sigma;
        refused(&bad, 1);
    }
    let mut bad = good.clone();
    bad[0].pixel_ideal.x = f64::NAN;
    refused(&bad, 0);
    let mut bad = good;
    bad[1].camera_from_world.translation.z = f64::INFINITY;
    refused(&bad, 1);
}

#[test]
fn points_of_a_plane_are_no_special_case() {
    let mount = Mount::forward();
    for i in -5..=5 {
        for j in -3..=3 {
            let target = Vector3::new(2.0, f64::from(i) * 0.15, f64::from(j) * 0.2);
            let observations: Vec<_> = (0..4)
                .map(|k| {
                    see(
                        &mount.world_from_camera(
                            &Se2::new(0.0, f64::from(k) * 0.1, 0.0),
                            0.0,
                            0.0,
                            0.0,
                        ),
                        &target,
                        0.5,
                    )
                })
                .collect();
            let result = triangulate(&pinhole(), &observations, &Acceptance::default()).unwrap();
            assert!((result.point - target).norm() < 1e-11);
        }
    }
}
