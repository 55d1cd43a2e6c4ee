//! Any floats at all, NaN, infinities and subnormals included: an answer or an error, never a panic, never a NaN that
//! passes for an answer.

use mono_geometry::motion::{accumulate, held_between};
use mono_geometry::{
    Acceptance, Camera, ControlNoise, Distortion, EpipolarPair, InverseDepthPoint, Mount,
    Observation, OdometrySample, Pinhole, Se2, Se3, so3, triangulate,
};
use nalgebra::{Matrix3, Vector2, Vector3, Vector6};
use proptest::prelude::*;
use proptest::test_runner::Config;

/// Ordinary numbers as often as absurd ones, so that deep branches are reached.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -3.0..3.0_f64,
        1 => any::<f64>(),
        1 => prop_oneof![
            Just(0.0), Just(-0.0), Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY),
            Just(f64::MIN_POSITIVE), Just(1e-320), Just(1e300), Just(-1e300),
        ],
    ]
}

fn numbers(count: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(number(), count)
}

proptest! {
    #![proptest_config(Config { cases: 2_000, failure_persistence: None, ..Config::default() })]

    #[test]
    fn cameras(n in numbers(14)) {
        let pinhole = Pinhole { width: 320, height: 240, fx: n[0], fy: n[1], cx: n[2], cy: n[3] };
        for lens in [
            Distortion::Radtan { k1: n[4], k2: n[5], p1: n[6], p2: n[7], k3: n[8] },
            Distortion::KannalaBrandt { k1: n[4], k2: n[5], k3: n[6], k4: n[7] },
            Distortion::Rational {
                k1: n[4], k2: n[5], p1: n[6], p2: n[7], k3: n[8], k4: n[9], k5: n[10], k6: n[11],
            },
        ] {
            let _ = lens.undistort(&Vector2::new(n[9], n[10]));
            let Ok(camera) = Camera::new(pinhole, lens) else { continue };
            if let Ok(ideal) = camera.undistort_pixel(&Vector2::new(n[9], n[10])) {
                prop_assert!(!ideal.iter().any(|v| v.is_nan()));
            }
            if let Ok(ray) = camera.unproject(&Vector2::new(n[9], n[10])) {
                prop_assert!(!ray.iter().any(|v| v.is_nan()));
            }
            if let Some((_, by_point, by_parameters)) =
                camera.project_with_jacobians(&Vector3::new(n[11], n[12], n[13]))
            {
                prop_assert!(by_point.iter().chain(by_parameters.iter()).all(|v| v.is_finite()), "{lens:?}");
            }
            if let Some(pixel) = camera.project(&Vector3::new(n[11], n[12], n[13])) {
                prop_assert!(pixel.iter().all(|v| v.is_finite()));
            }
        }
    }

    #[test]
    fn views(n in numbers(24)) {
        let pinhole = Pinhole { width: 320, height: 240, fx: 370.0, fy: 371.0, cx: 160.0, cy: 120.0 };
        let mount = Mount::forward();
        let pose = |k: usize| mount.world_from_camera(&Se2::new(n[k], n[k + 1], n[k + 2]), n[k + 3], n[k + 4], n[k + 5]);
        let observations: Vec<_> = (0..3)
            .map(|k| Observation {
                camera_from_world: pose(3 * k).inverse(),
                pixel_ideal: Vector2::new(160.0 + 50.0 * n[12 + 2 * k], 120.0 + 50.0 * n[13 + 2 * k]),
                sigma_px: n[18 + k],
            })
            .collect();
        for acceptance in [
            Acceptance::default(),
            Acceptance { min_parallax_rad: n[21], chi_square_z: n[22], max_iterations: 40 },
        ] {
            if let Ok(found) = triangulate(&pinhole, &observations, &acceptance) {
                prop_assert!(found.point.iter().chain(found.covariance.iter()).all(|v| v.is_finite()));
                prop_assert!(found.parallax_rad >= acceptance.min_parallax_rad);
                for o in &observations {
                    prop_assert!(o.camera_from_world.transform_point(&found.point).z > 0.0);
                }
            }
        }
        if let Some(pair) = EpipolarPair::new(&pinhole, &pose(0), &pose(6)) {
            let (a, b) = (Vector2::new(n[12], n[13]), Vector2::new(n[14], n[15]));
            let _ = pair.symmetric_distance_px(&a, &b);
            if let Some(line) = pair.line_in_second(&a) {
                prop_assert!((line.xy().norm() - 1.0).abs() < 1e-12);
            }
            let _ = pair.sampson(&a, &b, n[16], n[17]);
        }
        let point = InverseDepthPoint { world_from_anchor: pose(0), alpha: n[12], beta: n[13], rho: n[14] };
        if let Some(prediction) = point.predict(&pinhole, &pose(6)) {
            prop_assert!(prediction.pixel_ideal.iter().all(|v| v.is_finite()));
        }
        if let Some(world) = point.point_in_world() {
            prop_assert!(world.iter().all(|v| v.is_finite()));
        }
        let _ = point.linearity_index(n[15], &pose(6));
    }

    #[test]
    fn motions(n in numbers(18)) {
        let twist = Vector3::new(n[0], n[1], n[2]);
        let _ = Se2::exp(&twist).log();
        let _ = Se2::right_jacobian(&twist);
        let _ = so3::log(&so3::exp(&twist));
        let _ = Se2::left_jacobian_inverse(&twist);
        let _ = Se3::left_jacobian(&Vector6::new(n[0], n[1], n[2], n[3], n[4], n[5]));
        let _ = Se3::exp(&Vector6::new(n[0], n[1], n[2], n[3], n[4], n[5])).log();
        let _ = Mount::new(&Matrix3::from_column_slice(&n[..9]), &twist);
        let samples: Vec<_> = (0..4)
            .map(|k| OdometrySample { t_s: n[3 * k], v_mps: n[3 * k + 1], omega_radps: n[3 * k + 2] })
            .collect();
        let held = held_between(&samples, n[12], n[13]);
        let noise = ControlNoise { v_ratio: n[14], omega_ratio: n[15], ..ControlNoise::ZERO };
        if let Ok(increment) = accumulate(&held, &noise) {
            prop_assert!(increment.mean.log().iter().chain(increment.covariance.iter()).all(|v| v.is_finite()));
        }
    }
}
