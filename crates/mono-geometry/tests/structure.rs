//! Triangulation, inverse depth and epipolar geometry: closed forms, Jacobians, consistency by Monte Carlo, and the
//! configurations in which there is nothing to be known.

use std::f64::consts::PI;

use mono_geometry::epipolar::{essential, fundamental};
use mono_geometry::linalg::{cholesky, svd3};
use mono_geometry::triangulation::{chi_square_quantile, linear, midpoint};
use mono_geometry::{
    Acceptance, EpipolarPair, InverseDepthPoint, Mount, Observation, Pinhole, Rejection, Se2, Se3,
    so3, triangulate,
};
use nalgebra::{Matrix2x3, Matrix2x6, Matrix3, Vector2, Vector3, Vector6};
use proptest::prelude::*;
use proptest::test_runner::Config;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn pinhole() -> Pinhole {
    Pinhole {
        width: 320,
        height: 240,
        fx: 368.826_20,
        fy: 369.902_39,
        cx: 159.670_29,
        cy: 121.541_36,
    }
}

fn config(cases: u32) -> Config {
    Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    }
}

fn gauss(rng: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Any acceptance but that of the parallax and the error.
fn open() -> Acceptance {
    Acceptance {
        min_parallax_rad: 0.0,
        chi_square_z: 1e3,
        max_iterations: 50,
    }
}

/// Camera at `position` looking at `target`, its y axis as far down (world -z) as possible.
fn look_at(position: Vector3<f64>, target: Vector3<f64>) -> Se3 {
    let z = (target - position).normalize();
    let x = z.cross(&Vector3::z()).normalize();
    let y = z.cross(&x);
    let rotation =
        so3::rotation_from_matrix(&Matrix3::from_columns(&[x, y, z])).expect("orthonormal");
    Se3::new(rotation, position)
}

fn see(world_from_camera: &Se3, point: &Vector3<f64>, sigma_px: f64) -> Observation {
    let camera_from_world = world_from_camera.inverse();
    let pixel_ideal = pinhole()
        .project(&camera_from_world.transform_point(point))
        .expect("in front");
    Observation {
        camera_from_world,
        pixel_ideal,
        sigma_px,
    }
}

proptest! {
    #![proptest_config(config(300))]

    /// Without noise every method returns the point, far from the world's origin too.
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
        prop_assert!(cholesky(&result.covariance).is_ok());
    }

    /// At the solution the whitened gradient vanishes, and no neighbour is better: the minimum, not a start value.
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
        let sigmas = cholesky(&result.covariance).unwrap().l();
        for axis in 0..3 {
            for sign in [-1.0, 1.0] {
                // A step of a hundredth of a sigma raises the cost by 1e-4, up to second-order terms.
                let moved = result.point + sigmas.column(axis) * (0.01 * sign);
                let rise = cost(&moved) - result.chi_square;
                prop_assert!((rise - 1e-4).abs() < 5e-5, "{rise}");
            }
        }
    }

    #[test]
    fn inverse_depth_agrees_with_the_point_and_with_differences(
        alpha in -0.5..0.5_f64, beta in -0.4..0.4_f64,
        rho in prop_oneof![Just(0.0), Just(1e-9), Just(-0.01), 0.05..2.0_f64],
        turn in prop_oneof![Just(0.0), Just(1e-8), -0.3..0.3_f64],
        moved in prop_oneof![Just((0.0, 0.0)), Just((1e-9, 0.0)), (-0.2..0.2_f64, -0.2..0.2_f64)],
        heading in prop_oneof![Just(0.0), Just(PI), Just(-PI), -3.0..3.0_f64],
    ) {
        let mount = Mount::forward();
        let anchor = mount.world_from_camera(&Se2::new(3.0, -1.0, heading), 0.01, -0.02, 0.3);
        let camera = mount.world_from_camera(
            &Se2::new(3.0 + moved.0, -1.0 + moved.1, heading + turn), -0.01, 0.02, 0.31);
        let point = InverseDepthPoint { world_from_anchor: anchor, alpha, beta, rho };
        let prediction = point.predict(&pinhole(), &camera).unwrap();
        prop_assert_eq!(point.project(&pinhole(), &camera), Some(prediction.pixel_ideal));
        if let Some(world) = point.point_in_world() {
            if let Some(pixel) = pinhole().project(&camera.inverse().transform_point(&world)) {
                let tolerance = 1e-9 + 1e-13 / rho;
                prop_assert!((pixel - prediction.pixel_ideal).norm() < tolerance.min(1e-3));
            }
        } else {
            prop_assert!(rho <= 0.0);
        }
        let step = 1e-5;
        let mut by_parameters = Matrix2x3::zeros();
        for j in 0..3 {
            let mut d = Vector3::zeros();
            d[j] = step;
            let plus = point.with_parameters(&(point.parameters() + d)).project(&pinhole(), &camera).unwrap();
            let minus = point.with_parameters(&(point.parameters() - d)).project(&pinhole(), &camera).unwrap();
            by_parameters.set_column(j, &((plus - minus) / (2.0 * step)));
        }
        let mut by_camera = Matrix2x6::zeros();
        for j in 0..6 {
            let mut d = Vector6::zeros();
            d[j] = step;
            let plus = point.project(&pinhole(), &camera.compose(&Se3::exp(&d))).unwrap();
            let minus = point.project(&pinhole(), &camera.compose(&Se3::exp(&-d))).unwrap();
            by_camera.set_column(j, &((plus - minus) / (2.0 * step)));
        }
        // Truncation h^2 f''' / 6 with f''' up to 1e4 px, rounding 1e-13 * 500 / h.
        prop_assert!((by_parameters - prediction.by_parameters).amax() < 1e-5);
        prop_assert!((by_camera - prediction.by_camera).amax() < 1e-5);
    }

    #[test]
    fn exact_matches_satisfy_the_epipolar_constraint(
        x in -0.5..0.5_f64, y in -0.4..0.4_f64, depth in 1.0..10.0_f64,
        t in (-0.3..0.3_f64, -0.3..0.3_f64, -0.3..0.3_f64), w in (-0.1..0.1_f64, -0.1..0.1_f64, -0.1..0.1_f64),
    ) {
        let first = look_at(Vector3::new(1.0, 2.0, 0.5), Vector3::new(1.0, 5.0, 0.5));
        let second = first.compose(&Se3::exp(&Vector6::new(t.0, t.1, t.2, w.0, w.1, w.2)));
        prop_assume!((first.translation - second.translation).norm() > 0.01);
        let world = first.transform_point(&(Vector3::new(x, y, 1.0) * depth));
        let in_second = second.inverse().transform_point(&world);
        prop_assume!(in_second.z > 0.3);
        let p1 = pinhole().project(&first.inverse().transform_point(&world)).unwrap();
        let p2 = pinhole().project(&in_second).unwrap();
        let pair = EpipolarPair::new(&pinhole(), &first, &second).unwrap();
        let sampson = pair.sampson(&p1, &p2, 1.0, 1.0).unwrap();
        prop_assert!(sampson.distance_px.abs() < 1e-8);
        prop_assert!((sampson.sigma_px - 1.0).abs() < 1e-12);
        // Off by d along the normal of its line: the distance to the line is d, Sampson's at most that.
        let line = pair.line_in_second(&p1).unwrap();
        let off = p2 + line.xy() * 0.25;
        prop_assert!((line.dot(&off.push(1.0)) - 0.25).abs() < 1e-8);
        prop_assert!(pair.sampson(&p1, &off, 1.0, 1.0).unwrap().distance_px.abs() <= 0.25 + 1e-8);
        prop_assert!(pair.symmetric_distance_px(&p1, &off).unwrap() >= 0.25 - 1e-8);
        // Swapping the views changes nothing.
        let back = EpipolarPair::new(&pinhole(), &second, &first).unwrap();
        let swapped = back.symmetric_distance_px(&off, &p1).unwrap();
        prop_assert!((swapped - pair.symmetric_distance_px(&p1, &off).unwrap()).abs() < 1e-8);
    }
}

/// Normalised estimation error squared over 4 000 trials: the mean is 3 within 4.5 standard errors if and only if the
/// covariance is right (the wrong sigma, or a covariance without one view, is far outside).
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
                nees += error.dot(&cholesky(&result.covariance).unwrap().solve(&error));
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

/// Depth error of a sideways pair in closed form: sigma_z = z^2 sigma sqrt(2) / (f b) for rays near the axis.
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

/// Points on a wall parallel to the path, the paper's experiment, and on a line through the cameras' plane.
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

#[test]
fn chi_square_quantiles_against_tables() {
    let table = [
        (1, 3.09, 10.83),
        (2, 2.326, 9.210),
        (3, 1.645, 7.815),
        (10, 2.326, 23.209),
        (100, 1.645, 124.342),
    ];
    for (dof, z, expected) in table {
        let got = chi_square_quantile(dof, z);
        assert!(
            (got / expected - 1.0).abs() < 0.03,
            "{dof}: {got} {expected}"
        );
    }
    assert_eq!(chi_square_quantile(0, 2.0), 0.0);
    assert_eq!(chi_square_quantile(1, -10.0), 0.0);
}

/// Conversion at small uncertainty: Monte Carlo over (alpha, beta, rho) reproduces the Euclidean covariance.
#[test]
fn euclidean_covariance_matches_monte_carlo() {
    let anchor = look_at(Vector3::new(1.0, -1.0, 0.4), Vector3::new(2.0, 3.0, 0.0));
    let point = InverseDepthPoint {
        world_from_anchor: anchor,
        alpha: 0.3,
        beta: -0.2,
        rho: 0.4,
    };
    let covariance = Matrix3::new(4e-6, 1e-6, 2e-6, 1e-6, 3e-6, -1e-6, 2e-6, -1e-6, 9e-6);
    let (mean, euclidean) = point.to_euclidean(&covariance).unwrap();
    let factor = cholesky(&covariance).unwrap().l();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let trials = 20_000;
    let mut outer = Matrix3::zeros();
    for _ in 0..trials {
        let draw = Vector3::new(gauss(&mut rng), gauss(&mut rng), gauss(&mut rng));
        let moved = point.with_parameters(&(point.parameters() + factor * draw));
        let error = moved.point_in_world().unwrap() - mean;
        outer += error * error.transpose();
    }
    let sampled = outer / f64::from(trials);
    for i in 0..3 {
        for j in 0..3 {
            let scale = (euclidean[(i, i)] * euclidean[(j, j)]).sqrt();
            assert!(
                (sampled[(i, j)] - euclidean[(i, j)]).abs() / scale
                    < 4.5 * (2.0 / 20_000.0_f64).sqrt() + 0.002
            );
        }
    }
}

/// One sighting plus a second, fused linearly, is the triangulated point: the two files tell one story.
#[test]
fn inverse_depth_update_agrees_with_triangulation() {
    let target = Vector3::new(0.2, 3.0, 0.1);
    let cameras = [
        look_at(Vector3::new(-0.4, 0.0, 0.0), target),
        look_at(Vector3::new(0.4, 0.1, 0.0), target),
    ];
    let observations = [
        see(&cameras[0], &target, 0.5),
        see(&cameras[1], &target, 0.5),
    ];
    let triangulated = triangulate(&pinhole(), &observations, &open()).unwrap();
    let rho = 1.0 / cameras[0].inverse().transform_point(&target).z;
    let point =
        InverseDepthPoint::from_pixel(&pinhole(), &cameras[0], &observations[0].pixel_ideal, rho);
    // A prior without depth information, then the information of the second view.
    let prior = InverseDepthPoint::initial_covariance(&pinhole(), 0.5, 1e4);
    let prediction = point.predict(&pinhole(), &cameras[1]).unwrap();
    let h = prediction.by_parameters;
    let information = cholesky(&prior).unwrap().inverse() + h.transpose() * h / 0.25;
    let posterior = cholesky(&information).unwrap().inverse();
    let (mean, covariance) = point.to_euclidean(&posterior).unwrap();
    assert!((mean - target).norm() < 1e-12);
    assert!((covariance - triangulated.covariance).amax() < 1e-6 * triangulated.covariance.amax());
}

#[test]
fn linearity_index_closed_form_and_limits() {
    let anchor = look_at(Vector3::zeros(), Vector3::new(0.0, 1.0, 0.0));
    let point = InverseDepthPoint {
        world_from_anchor: anchor,
        alpha: 0.0,
        beta: 0.0,
        rho: 0.25,
    };
    // Seen from the anchor itself: 4 (sigma_rho / rho^2) / (1 / rho) = 4 sigma_rho / rho.
    assert!((point.linearity_index(0.01, &anchor) - 4.0 * 0.01 / 0.25).abs() < 1e-15);
    // At a right angle a Gaussian in depth is seen without distortion.
    let side = look_at(Vector3::new(3.0, 4.0, 0.0), Vector3::new(0.0, 4.0, 0.0));
    assert!(point.linearity_index(0.01, &side) < 1e-15);
    let infinite = InverseDepthPoint { rho: 0.0, ..point };
    assert!(infinite.linearity_index(0.01, &anchor).is_infinite());
    assert!(infinite.to_euclidean(&Matrix3::identity()).is_none());
    // Infinity is seen in the anchor's direction from everywhere, and rho means nothing at the anchor.
    let shifted = Se3::new(anchor.rotation, Vector3::new(5.0, 0.0, 0.0));
    assert_eq!(
        infinite.project(&pinhole(), &shifted),
        infinite.project(&pinhole(), &anchor)
    );
    let at_anchor = point.predict(&pinhole(), &anchor).unwrap();
    assert_eq!(at_anchor.by_parameters.column(2).norm(), 0.0);
    // A camera beyond the point has it behind itself.
    let beyond = Se3::new(anchor.rotation, Vector3::new(0.0, 5.0, 0.0));
    assert!(point.project(&pinhole(), &beyond).is_none());
}

#[test]
fn essential_matrix_closed_form() {
    // A step to the right: lines are image rows. E = [x]x.
    let right = Se3::new(so3::exp(&Vector3::zeros()), Vector3::new(-0.3, 0.0, 0.0));
    assert_eq!(essential(&right).unwrap(), so3::hat(&-Vector3::x()));
    let pair = EpipolarPair::new(&pinhole(), &Se3::identity(), &right.inverse()).unwrap();
    let line = pair.line_in_second(&Vector2::new(100.0, 50.0)).unwrap();
    assert!(line.x.abs() < 1e-15 && (line.z / line.y + 50.0).abs() < 1e-12);
    let motion = Se3::exp(&Vector6::new(0.3, -0.1, 0.2, 0.5, 0.2, -0.7));
    let (_, s, _) = svd3(&essential(&motion).unwrap()).unwrap();
    assert!((s - Vector3::new(1.0, 1.0, 0.0)).amax() < 1e-15 * 8.0);
    // A pure step forward: the epipole, the focus of expansion, is the principal point and has no line.
    let forward = Se3::new(so3::exp(&Vector3::zeros()), Vector3::new(0.0, 0.0, -0.5));
    let centre = Vector2::new(pinhole().cx, pinhole().cy);
    let mut exact = pinhole();
    (exact.cx, exact.cy) = (160.0, 120.0);
    let pair = EpipolarPair::new(&exact, &Se3::identity(), &forward.inverse()).unwrap();
    assert!(pair.line_in_second(&Vector2::new(160.0, 120.0)).is_none());
    assert!(
        pair.sampson(
            &Vector2::new(160.0, 120.0),
            &Vector2::new(160.0, 120.0),
            1.0,
            1.0
        )
        .is_none()
    );
    assert!(pair.line_in_second(&centre).is_some());
    assert!((pair.baseline_m() - 0.5).abs() < 1e-15);
}

#[test]
fn without_baseline_there_is_no_constraint() {
    let camera = look_at(
        Vector3::new(100.0, 50.0, 0.3),
        Vector3::new(101.0, 50.0, 0.3),
    );
    let turned = camera.compose(&Se3::exp(&Vector6::new(0.0, 0.0, 0.0, 0.1, 0.2, 0.3)));
    assert!(EpipolarPair::new(&pinhole(), &camera, &turned).is_none());
    let mut rounded = turned;
    rounded.translation.x += 2.0 * f64::EPSILON * 100.0;
    assert!(EpipolarPair::new(&pinhole(), &camera, &rounded).is_none());
    let mut nan = turned;
    nan.translation.x = f64::NAN;
    assert!(EpipolarPair::new(&pinhole(), &camera, &nan).is_none());
    assert!(essential(&Se3::identity()).is_none());
    assert!(fundamental(&pinhole(), &Se3::identity()).is_none());
}

/// The Sampson distance over its sigma is a standard normal; the paper's sum has no such property.
#[test]
fn sampson_over_sigma_is_standard_normal() {
    let target = Vector3::new(0.3, 3.0, 0.2);
    let first = look_at(Vector3::zeros(), Vector3::new(0.0, 3.0, 0.0));
    let second = look_at(Vector3::new(0.4, 0.2, 0.05), Vector3::new(0.1, 3.0, 0.0));
    let pair = EpipolarPair::new(&pinhole(), &first, &second).unwrap();
    let (p1, p2) = (
        see(&first, &target, 1.0).pixel_ideal,
        see(&second, &target, 1.0).pixel_ideal,
    );
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let trials = 20_000;
    let (sigma1, sigma2) = (0.3, 1.2);
    let mut squares = 0.0;
    let mut sum = 0.0;
    for _ in 0..trials {
        let a = p1 + Vector2::new(gauss(&mut rng), gauss(&mut rng)) * sigma1;
        let b = p2 + Vector2::new(gauss(&mut rng), gauss(&mut rng)) * sigma2;
        let s = pair.sampson(&a, &b, sigma1, sigma2).unwrap();
        let whitened = s.distance_px / s.sigma_px;
        sum += whitened;
        squares += whitened * whitened;
    }
    let count = f64::from(trials);
    assert!((sum / count).abs() < 4.5 / count.sqrt());
    assert!(
        (squares / count - 1.0).abs() < 4.5 * (2.0 / count).sqrt() + 1e-3,
        "{}",
        squares / count
    );
}
