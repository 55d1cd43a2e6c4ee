//! Inverse depth: Jacobians against central differences, conversion by Monte Carlo, agreement with triangulation.

use std::f64::consts::PI;

use crate::common::{config, gauss, look_at, pinhole, see};
use mono_geometry::inverse_depth::{
    CONVERSION_LINEARITY_INDEX, InverseDepthPoint, NotYet, first_sighting, refine,
};
use mono_geometry::triangulation::{Acceptance, Rejection, triangulate};
use mono_geometry::{Mount, PlacedCamera, Se2, Se3};
use nalgebra::{Matrix2x3, Matrix2x6, Matrix3, Vector2, Vector3, Vector6};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn placed_at(position: Vector3<f64>, target: Vector3<f64>) -> PlacedCamera {
    PlacedCamera::new(&look_at(position, target))
}

proptest! {
    #![proptest_config(config(300))]

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
        let anchor = PlacedCamera::new(&anchor);
        let point = InverseDepthPoint { anchor, alpha, beta, rho };
        let view = PlacedCamera::new(&camera);
        let prediction = point.predict(&pinhole(), &view).unwrap();
        prop_assert_eq!(point.project(&pinhole(), &view), Some(prediction.pixel_ideal));
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
            let moved = |d: Vector3<f64>| {
                InverseDepthPoint::new(&anchor, &(point.parameters() + d)).project(&pinhole(), &view).unwrap()
            };
            let (plus, minus) = (moved(d), moved(-d));
            by_parameters.set_column(j, &((plus - minus) / (2.0 * step)));
        }
        let mut by_camera = Matrix2x6::zeros();
        for j in 0..6 {
            let mut d = Vector6::zeros();
            d[j] = step;
            let moved = |d: Vector6<f64>| {
                let camera = PlacedCamera::new(&camera.compose(&Se3::exp(&d)));
                point.project(&pinhole(), &camera).unwrap()
            };
            let (plus, minus) = (moved(d), moved(-d));
            by_camera.set_column(j, &((plus - minus) / (2.0 * step)));
        }
        // Truncation h^2 f''' / 6 with f''' up to 1e4 px, rounding 1e-13 * 500 / h.
        prop_assert!((by_parameters - prediction.by_parameters).amax() < 1e-5);
        prop_assert!((by_camera - prediction.by_camera).amax() < 1e-5);
    }

}

#[test]
fn euclidean_covariance_matches_monte_carlo() {
    let anchor = placed_at(Vector3::new(1.0, -1.0, 0.4), Vector3::new(2.0, 3.0, 0.0));
    let point = InverseDepthPoint {
        anchor,
        alpha: 0.3,
        beta: -0.2,
        rho: 0.4,
    };
    let covariance = Matrix3::new(4e-6, 1e-6, 2e-6, 1e-6, 3e-6, -1e-6, 2e-6, -1e-6, 9e-6);
    let (mean, euclidean) = point.to_euclidean(&covariance).unwrap();
    let factor = covariance.cholesky().unwrap().l();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let trials = 20_000;
    let mut outer = Matrix3::zeros();
    for _ in 0..trials {
        let draw = Vector3::new(gauss(&mut rng), gauss(&mut rng), gauss(&mut rng));
        let moved = InverseDepthPoint::new(&anchor, &(point.parameters() + factor * draw));
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
    let triangulated = triangulate(&pinhole(), &observations, &Acceptance::default()).unwrap();
    let rho = 1.0 / cameras[0].inverse().transform_point(&target).z;
    // A prior without depth information, then the information of the second view.
    let (mean, prior) = first_sighting(&pinhole(), &observations[0].pixel_ideal, 0.5, rho, 1e4);
    let [anchor, second] = cameras.map(|camera| PlacedCamera::new(&camera));
    let point = InverseDepthPoint::new(&anchor, &mean);
    let prediction = point.predict(&pinhole(), &second).unwrap();
    let h = prediction.by_parameters;
    let information = prior.cholesky().unwrap().inverse() + h.transpose() * h / 0.25;
    let posterior = information.cholesky().unwrap().inverse();
    let (mean, covariance) = point.to_euclidean(&posterior).unwrap();
    assert!((mean - target).norm() < 1e-12);
    assert!((covariance - triangulated.covariance).amax() < 1e-6 * triangulated.covariance.amax());
}

#[test]
fn linearity_index_closed_form_and_limits() {
    let anchor = placed_at(Vector3::zeros(), Vector3::new(0.0, 1.0, 0.0));
    let point = InverseDepthPoint {
        anchor,
        alpha: 0.0,
        beta: 0.0,
        rho: 0.25,
    };
    // Seen from the anchor itself: 4 (sigma_rho / rho^2) / (1 / rho) = 4 sigma_rho / rho.
    assert!((point.linearity_index(0.01, &anchor) - 4.0 * 0.01 / 0.25).abs() < 1e-15);
    // At a right angle a Gaussian in depth is seen without distortion.
    let side = placed_at(Vector3::new(3.0, 4.0, 0.0), Vector3::new(0.0, 4.0, 0.0));
    assert!(point.linearity_index(0.01, &side) < 1e-15);
    let infinite = InverseDepthPoint { rho: 0.0, ..point };
    assert!(infinite.linearity_index(0.01, &anchor).is_infinite());
    assert!(infinite.to_euclidean(&Matrix3::identity()).is_none());
    // Infinity is seen in the anchor's direction from everywhere, and rho means nothing at the anchor.
    let moved = |centre| PlacedCamera { centre, ..anchor };
    let shifted = moved(Vector3::new(5.0, 0.0, 0.0));
    assert_eq!(
        infinite.project(&pinhole(), &shifted),
        infinite.project(&pinhole(), &anchor)
    );
    let at_anchor = point.predict(&pinhole(), &anchor).unwrap();
    assert_eq!(at_anchor.by_parameters.column(2).norm(), 0.0);
    // A camera beyond the point has it behind itself.
    let beyond = moved(Vector3::new(0.0, 5.0, 0.0));
    assert!(point.project(&pinhole(), &beyond).is_none());
}

#[test]
fn n_views_give_the_minimum_that_triangulation_gives() {
    for views in [2, 3, 7] {
        for seed in 0..50 {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let target = Vector3::new(0.2, 4.0, 0.1);
            let cameras: Vec<Se3> = (0..views)
                .map(|k| {
                    let x = -0.5 + 1.0 * k as f64 / (views - 1) as f64;
                    look_at(Vector3::new(x, 0.1 * x * x, 0.05 * x), target)
                })
                .collect();
            let observations: Vec<_> = cameras
                .iter()
                .enumerate()
                .map(|(k, camera)| {
                    let mut o = see(camera, &target, 0.3 + 0.1 * k as f64);
                    o.pixel_ideal += Vector2::new(gauss(&mut rng), gauss(&mut rng)) * o.sigma_px;
                    o
                })
                .collect();
            let open = Acceptance {
                min_parallax_rad: 0.0,
                chi_square_probability: 1.0,
                max_iterations: 50,
            };
            let euclidean = triangulate(&pinhole(), &observations, &open).unwrap();
            // Any anchor will do, also one that is no view.
            let elsewhere = look_at(Vector3::new(0.1, -0.5, 0.2), target + Vector3::x() * 0.2);
            for anchor in [cameras[0], cameras[views - 1], elsewhere] {
                let anchor = PlacedCamera::new(&anchor);
                let found = refine(&pinhole(), &anchor, &observations, 50).unwrap();
                assert!((found.chi_square - euclidean.chi_square).abs() < 1e-8);
                assert_eq!(found.degrees_of_freedom, 2 * views - 3);
                let (point, covariance) = found.point.to_euclidean(&found.covariance).unwrap();
                let apart = point - euclidean.point;
                let distance = apart.dot(&euclidean.covariance.cholesky().unwrap().solve(&apart));
                // Both stop within 1e-6 standard deviations.
                assert!(distance < 1e-11, "{distance}");
                let scale = euclidean.covariance.amax();
                assert!((covariance - euclidean.covariance).amax() < 1e-5 * scale);
            }
        }
    }
}

#[test]
fn points_not_told_from_infinity_are_an_answer_and_no_baseline_is_none() {
    let target = Vector3::new(0.0, 5_000.0, 0.0);
    let cameras = [-0.2, 0.2].map(|x| look_at(Vector3::new(x, 0.0, 0.0), target));
    let mut observations = [
        see(&cameras[0], &target, 0.5),
        see(&cameras[1], &target, 0.5),
    ];
    // Half a pixel of rays that part: nearest at rho < 0.
    observations[1].pixel_ideal.x += 0.5;
    let [anchor, second] = cameras.map(|camera| PlacedCamera::new(&camera));
    let found = refine(&pinhole(), &anchor, &observations, 20).unwrap();
    let sigma_rho = found.covariance[(2, 2)].sqrt();
    assert!(found.point.rho < 0.0 && sigma_rho > found.point.rho.abs());
    assert!(found.chi_square < 1e-9);
    match found
        .point
        .to_euclidean_if_linear(&found.covariance, &second, CONVERSION_LINEARITY_INDEX)
    {
        Err(NotYet::AtInfinity {
            rho,
            sigma_rho: sigma,
        }) => {
            assert_eq!((rho, sigma), (found.point.rho, sigma_rho));
        }
        other => panic!("{other:?}"),
    }
    let twice = [observations[0], observations[0]];
    assert!(matches!(
        refine(&pinhole(), &anchor, &twice, 20),
        Err(Rejection::ParallaxTooSmall {
            parallax_rad: 0.0,
            ..
        })
    ));
    let mut bad = observations;
    bad[1].sigma_px = -1.0;
    assert_eq!(
        refine(&pinhole(), &anchor, &bad, 20).unwrap_err(),
        Rejection::BadObservation { view: 1, views: 2 }
    );
    let mut skew = observations;
    skew[1].pixel_ideal.y += 2.0;
    assert!(matches!(
        refine(&pinhole(), &anchor, &skew, 0),
        Err(Rejection::NotConverged { iterations: 0, step_sigmas, required_sigmas })
            if step_sigmas > required_sigmas
    ));
    // The anchor looks away from what its neighbour sees.
    let away = placed_at(cameras[0].translation, -target);
    assert!(matches!(
        refine(&pinhole(), &away, &observations, 20),
        Err(Rejection::BehindCamera { .. })
    ));
}

#[test]
fn conversion_waits_for_the_index() {
    let anchor = placed_at(Vector3::zeros(), Vector3::new(0.0, 1.0, 0.0));
    let point = InverseDepthPoint {
        anchor,
        alpha: 0.1,
        beta: 0.0,
        rho: 0.25,
    };
    let with =
        |sigma_rho: f64| Matrix3::from_diagonal(&Vector3::new(1e-6, 1e-6, sigma_rho * sigma_rho));
    // L = 4 sigma_rho / rho at the anchor: 0.1 at sigma_rho = 0.00625.
    let just = with(0.006_2);
    assert_eq!(
        point.to_euclidean_if_linear(&just, &anchor, 0.1).ok(),
        point.to_euclidean(&just)
    );
    match point.to_euclidean_if_linear(&with(0.006_3), &anchor, 0.1) {
        Err(NotYet::NotLinear {
            linearity_index,
            required,
        }) => {
            assert!((linearity_index - 4.0 * 0.006_3 / 0.25).abs() < 1e-12);
            assert_eq!(required, 0.1);
        }
        other => panic!("{other:?}"),
    }
    for variance in [f64::NAN, -1.0, f64::INFINITY] {
        let mut bad = just;
        bad[(2, 2)] = variance;
        assert!(matches!(
            point.to_euclidean_if_linear(&bad, &anchor, 0.1),
            Err(NotYet::NotLinear { linearity_index, .. }) if linearity_index == f64::INFINITY
        ));
    }
}
