//! Input that no camera gives: nothing panics, whatever comes.

use mono_geometry::{NoiseShape, Pinhole};
use nalgebra::{Matrix3, Vector2, Vector3};
use place_recognition::{
    CandidateOptions, PlaceError, PlaceIndex, PointMatch, PoseOptions, SamePlaceOptions, View,
    poses, same_place,
};
use proptest::prelude::*;

use crate::world::{PINHOLE, World};

/// Few values, the worst of `f64` among them, so that points coincide, lie on lines and are unusable.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => prop::sample::select(vec![0.0, 1.0, -1.0, 2.0, 4.0, 100.0, 320.0, 479.0]),
        4 => -5.0..500.0_f64,
        1 => prop::sample::select(vec![
            f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 1e-300, f64::MIN_POSITIVE,
        ]),
    ]
}

fn any_match() -> impl Strategy<Value = PointMatch> {
    let triple = || (number(), number(), number()).prop_map(|(x, y, z)| Vector3::new(x, y, z));
    let head = (0..30_usize, 0..20_u32, triple(), triple());
    (head, triple(), number(), number(), number(), number()).prop_map(
        |((keypoint, landmark, point, seen_from), spread, u, v, sigma, quality)| PointMatch {
            keypoint,
            landmark,
            point_in_world: point,
            point_covariance: Matrix3::from_diagonal(&spread) + spread * spread.transpose(),
            seen_from,
            pixel_ideal: Vector2::new(u, v),
            sigma_px: sigma,
            shape: NoiseShape::ROUND,
            quality,
        },
    )
}

fn few_trials() -> PoseOptions {
    PoseOptions {
        max_trials: 30,
        min_inliers: 4,
        min_cells: 0,
        ..PoseOptions::default()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn any_matches_give_finite_poses_or_none(
        matches in prop::collection::vec(any_match(), 0..60),
        reach in prop::sample::select(vec![0.0, 1.0, 1e300]),
        focal in number(),
    ) {
        for pinhole in [PINHOLE, Pinhole { fx: focal, width: 0, ..PINHOLE }] {
            let options = PoseOptions { reach, ..few_trials() };
            for hypothesis in poses(&pinhole, &matches, &options).unwrap() {
                prop_assert!(hypothesis.world_from_camera.translation.iter().all(|v| v.is_finite()));
                prop_assert!(hypothesis.covariance.iter().all(|v| v.is_finite()));
                prop_assert!(hypothesis.inliers.iter().all(|i| *i < matches.len()));
            }
        }
    }

    #[test]
    fn unusable_matches_among_good_ones_change_nothing(
        bad in prop::collection::vec((any_match(), 0..3_u8), 1..20),
        seed in 0..20_u64,
    ) {
        let mut world = World::new(seed, 1);
        let camera = world.camera(0);
        let good = world.matches(&camera, 0, 60, 0, None);
        let spoil = |(mut m, how): (PointMatch, u8)| {
            match how {
                0 => m.pixel_ideal.x = f64::NAN,
                1 => m.sigma_px = 0.0,
                _ => m.point_in_world.z = f64::INFINITY,
            }
            m
        };
        let mut spoiled: Vec<PointMatch> = bad.into_iter().map(spoil).collect();
        let shift = spoiled.len();
        spoiled.extend(good.iter().copied());
        let options = PoseOptions::default();
        let (with, without) = (
            poses(&PINHOLE, &spoiled, &options).unwrap(),
            poses(&PINHOLE, &good, &options).unwrap(),
        );
        prop_assert_eq!(with.len(), without.len());
        for (a, b) in with.iter().zip(&without) {
            prop_assert_eq!(a.world_from_camera, b.world_from_camera);
            prop_assert!(a.inliers.iter().eq(b.inliers.iter().map(|i| i + shift).collect::<Vec<_>>().iter()));
        }
    }

    #[test]
    fn any_two_views_give_evidence(
        pixels in prop::collection::vec((number(), number(), 0..4_u8, 0..5_u8), 0..60),
        size in prop::sample::select(vec![0_usize, 1, 640, usize::MAX]),
    ) {
        let at: Vec<Vector2<f64>> = pixels.iter().map(|p| Vector2::new(p.0, p.1)).collect();
        let descriptors: Vec<[u8; 128]> = pixels
            .iter()
            .enumerate()
            .map(|(k, p)| std::array::from_fn(|i| if i == k { 200 } else { p.2 * p.3 }))
            .collect();
        let view = View { pixels: &at, descriptors: &descriptors, width: size, height: size };
        let options = SamePlaceOptions { min_inliers: 0, max_trials: 20, ..SamePlaceOptions::default() };
        let evidence = same_place(&view, &view, &options).unwrap();
        prop_assert!(evidence.inliers.len() <= evidence.matches);
    }
}

#[test]
fn nothing_gives_nothing() {
    assert_eq!(poses(&PINHOLE, &[], &PoseOptions::default()), Ok(vec![]));
    let view = View {
        pixels: &[],
        descriptors: &[],
        width: 640,
        height: 480,
    };
    let evidence = same_place(&view, &view, &SamePlaceOptions::default()).unwrap();
    assert!(!evidence.same_place && evidence.matches == 0);
    assert_eq!(
        PlaceIndex::new().candidates(&[[1; 128]], &CandidateOptions::default()),
        Ok(vec![])
    );
}

#[test]
fn one_match_many_times_is_no_place() {
    let mut world = World::new(1, 1);
    let camera = world.camera(0);
    let one = world.matches(&camera, 0, 1, 0, None)[0];
    let copies: Vec<PointMatch> = (0..100)
        .map(|k| PointMatch {
            keypoint: k,
            landmark: k as u32,
            ..one
        })
        .collect();
    assert_eq!(
        poses(&PINHOLE, &copies, &PoseOptions::default()),
        Ok(vec![])
    );
    assert_eq!(
        poses(&PINHOLE, &vec![one; 100], &PoseOptions::default()),
        Ok(vec![])
    );
}

#[test]
fn options_out_of_range_are_refused_with_their_numbers() {
    let options = PoseOptions {
        min_inliers: 3,
        ..PoseOptions::default()
    };
    let error = poses(&PINHOLE, &[], &options).unwrap_err();
    assert_eq!(error.to_string(), "min_inliers is 3, required: at least 4");
    for options in [
        PoseOptions {
            threshold: f64::NAN,
            ..PoseOptions::default()
        },
        PoseOptions {
            reach: f64::INFINITY,
            ..PoseOptions::default()
        },
        PoseOptions {
            confidence: 1.5,
            ..PoseOptions::default()
        },
    ] {
        assert!(matches!(
            poses(&PINHOLE, &[], &options),
            Err(PlaceError::Option { .. })
        ));
    }
    let view = View {
        pixels: &[Vector2::zeros()],
        descriptors: &[],
        width: 9,
        height: 9,
    };
    let error = same_place(&view, &view, &SamePlaceOptions::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        "1 pixels and 0 descriptors, required: one descriptor a pixel"
    );
}
