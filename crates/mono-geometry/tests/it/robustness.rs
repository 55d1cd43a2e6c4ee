//! Any floats at all, NaN, infinities and subnormals included: an answer or an error, never a panic, never a NaN that
//! passes for an answer.

use mono_geometry::epipolar::{self, EpipolarPair, PlanarMotion, RelativePose};
use mono_geometry::inverse_depth::InverseDepthPoint;
use mono_geometry::motion::{ControlNoise, OdometrySample, accumulate, held_between};
use mono_geometry::pnp::{
    Correspondence, NoPose, RefineOptions, RobustPoseOptions, estimate_pose, estimate_pose_ransac,
    p3p, refine_pose,
};
use mono_geometry::ransac::{Options, Uniform};
use mono_geometry::triangulation::{
    Acceptance, Observation, correct_match, triangulate, triangulate_two_views,
};
use mono_geometry::{
    Camera, Distortion, Mount, NoiseShape, Pinhole, PlacedCamera, RobustLoss, Se2, Se3, homography,
    inverse_depth, so3,
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
                shape: NoiseShape::ROUND,
            })
            .collect();
        for acceptance in [
            Acceptance::default(),
            Acceptance { min_parallax_rad: n[21], chi_square_probability: n[22], max_iterations: 40 },
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
        let point = InverseDepthPoint { anchor: PlacedCamera::new(&pose(0)), alpha: n[12], beta: n[13], rho: n[14] };
        let view = PlacedCamera::new(&pose(6));
        if let Some(prediction) = point.predict(&pinhole, &view) {
            prop_assert!(prediction.pixel_ideal.iter().all(|v| v.is_finite()));
        }
        if let Some(world) = point.point_in_world() {
            prop_assert!(world.iter().all(|v| v.is_finite()));
        }
        let _ = point.linearity_index(n[15], &view);
        let diagonal = Matrix3::from_diagonal(&Vector3::new(n[16], n[17], n[18]));
        if let Ok((world, covariance)) = point.to_euclidean_if_linear(&diagonal, &view, n[19]) {
            prop_assert!(world.iter().chain(covariance.iter()).all(|v| v.is_finite()));
        }
        if let Ok(found) = inverse_depth::refine(&pinhole, &point.anchor, &observations, 40) {
            prop_assert!(found.point.parameters().iter().chain(found.covariance.iter()).all(|v| v.is_finite()));
        }
        let two = [observations[0], observations[1]];
        if let Ok(found) = triangulate_two_views(&pinhole, &two, &Acceptance::default()) {
            prop_assert!(found.point.iter().chain(found.covariance.iter()).all(|v| v.is_finite()));
        }
        let matrix = Matrix3::from_column_slice(&n[..9]);
        let (a, b) = (Vector2::new(n[12], n[13]), Vector2::new(n[14], n[15]));
        if let Ok(c) = correct_match(&matrix, &a, &b, n[18], n[19]) {
            prop_assert!(c.first_px.iter().chain(c.second_px.iter()).all(|v| v.is_finite()));
            prop_assert!(c.chi_square.is_finite());
        }
    }

    #[test]
    fn poses(n in numbers(36)) {
        let pinhole = Pinhole { width: 320, height: 240, fx: 370.0, fy: 371.0, cx: 160.0, cy: 120.0 };
        let seen: Vec<_> = (0..6).map(|k| Correspondence {
            point_in_world: Vector3::new(n[5 * k], n[5 * k + 1], 3.0 + n[5 * k + 2]),
            pixel_ideal: Vector2::new(160.0 + 50.0 * n[5 * k + 3], 120.0 + 50.0 * n[5 * k + 4]),
            sigma_px: if k < 5 { 1.0 } else { n[30] },
            shape: NoiseShape::ROUND,
        }).collect();
        let finite = |pose: &Se3| pose.translation.iter().chain(pose.rotation.matrix().iter()).all(|v| v.is_finite());
        let three = [seen[0], seen[1], seen[2]];
        let rays = three.map(|c| Vector3::new(c.pixel_ideal.x, c.pixel_ideal.y, 100.0));
        for pose in p3p(&rays, &three.map(|c| c.point_in_world)).as_slice() {
            prop_assert!(finite(pose));
        }
        let options = RefineOptions { loss: RobustLoss::Cauchy { threshold: n[31] }, max_iterations: 20 };
        for options in [options, RefineOptions::default()] {
            let start = Se3::exp(&Vector6::new(n[32], n[33], n[34], n[35], 0.0, 0.0));
            if let Ok(found) = refine_pose(&pinhole, &start, &seen, &options) {
                prop_assert!(finite(&found.world_from_camera));
                prop_assert!(found.covariance.iter().all(|v| v.is_finite()));
            }
            if let Ok(found) = estimate_pose(&pinhole, &seen, &options) {
                prop_assert!(finite(&found.estimate.world_from_camera));
                prop_assert!(found.estimate.covariance.iter().all(|v| v.is_finite()));
            }
        }
        let robust = RobustPoseOptions {
            threshold: n[31], min_inliers: 4,
            ransac: Options { max_trials: 20, ..Options::default() },
            ..RobustPoseOptions::default()
        };
        if let Ok(found) = estimate_pose_ransac(&pinhole, &seen, &mut Uniform::default(), &robust) {
            prop_assert!(finite(&found.estimate.world_from_camera));
            prop_assert!(found.estimate.covariance.iter().all(|v| v.is_finite()));
        }
    }

    #[test]
    fn two_views(n in numbers(46)) {
        let matches: Vec<_> = (0..10).map(|k| epipolar::Correspondence {
            first: Vector2::new(n[4 * k], n[4 * k + 1]),
            second: Vector2::new(n[4 * k + 2], n[4 * k + 3]),
        }).collect();
        let all: Vec<usize> = (0..10).collect();
        let variance = Vector2::new(n[40], n[41]);
        let motion = Se3::exp(&Vector6::new(n[42], n[43], n[44], 0.1, -0.2, n[45]));
        if let Some(start) = RelativePose::new(&motion)
            && let Ok(found) = epipolar::refine(&start, &matches, &all, &variance, 10)
        {
            prop_assert!(found.covariance.iter().all(|v| v.is_finite()));
        }
        let planar = PlanarMotion::new(&Mount::forward(), n[42], n[43]);
        if let Ok(found) = epipolar::refine(&planar, &matches, &all, &variance, 10) {
            prop_assert!(found.covariance.iter().all(|v| v.is_finite()));
        }
        for count in [4, 10] {
            let (source, target): (Vec<_>, Vec<_>) = matches[..count].iter().map(|m| (m.first, m.second)).unzip();
            if let Ok(found) = homography::fit(&source, &target) {
                prop_assert!(found.unit_covariance.iter().chain(found.homography.matrix()).all(|v| v.is_finite()));
                prop_assert!(found.rms.is_finite());
            }
        }
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
        let noise = ControlNoise { forward_per_sqrt_m: n[14], turn_per_sqrt_rad: n[15], ..ControlNoise::ZERO };
        if let Ok(increment) = accumulate(&held, &noise) {
            prop_assert!(increment.mean.log().iter().chain(increment.covariance.iter()).all(|v| v.is_finite()));
        }
    }
}

/// Points so far off that the information of the pose is next to nothing in one direction: its inverse is no number.
#[test]
fn regress_a_covariance_beyond_all_numbers_is_refused() {
    let seen = [
        [0.0, 0.0, 6.055_515_759_039_813e64, 0.0, 1.0],
        [
            0.0,
            0.0,
            -1.258_327_999_154_406_5,
            -0.038_212_018_243_242_51,
            1.0,
        ],
        [
            0.0,
            1.889_432_083_495_428e266,
            0.463_568_485_633_548_8,
            2.189_449_895_386_74,
            1.0,
        ],
        [0.0, 0.0, 0.0, 1.871_390_168_704_310_4, 1.0],
        [0.0, 0.0, 1.908_754_939_600_904_3, 0.0, 1.0],
        [
            0.0,
            0.0,
            -1_498_206.184_529_443_3,
            0.0,
            2.540_417_182_673_947_2,
        ],
    ]
    .map(|[x, y, u, v, sigma_px]| Correspondence {
        point_in_world: Vector3::new(x, y, 3.0),
        pixel_ideal: Vector2::new(160.0 + 50.0 * u, 120.0 + 50.0 * v),
        sigma_px,
        shape: NoiseShape::ROUND,
    });
    let pinhole = Pinhole {
        width: 320,
        height: 240,
        fx: 370.0,
        fy: 371.0,
        cx: 160.0,
        cy: 120.0,
    };
    let far = Vector6::new(
        0.0,
        -1.103_977_534_880_542_1e161,
        0.0,
        -0.027_185_059_174_578_183,
        0.0,
        0.0,
    );
    for loss in [
        RobustLoss::None,
        RobustLoss::Cauchy {
            threshold: 1.104_806_762_383_026_7,
        },
    ] {
        let options = RefineOptions {
            loss,
            max_iterations: 20,
        };
        match refine_pose(&pinhole, &Se3::exp(&far), &seen, &options) {
            Ok(found) => assert!(found.covariance.iter().all(|v| v.is_finite())),
            Err(refused) => assert!(matches!(refused, NoPose::Singular { .. }), "{refused}"),
        }
    }
}
