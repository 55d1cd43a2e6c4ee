//! Properties that hold for every picture.

use crate::pictures::{Picture, agreement, descriptor_distance, detect, detect_with, scene};
use proptest::prelude::*;
use simd_level::SimdLevel;
use vision_sift::{Detector, Features, GrayImage, Keypoint, SiftError, SiftParams, Workspace};

/// A picture of one of several kinds: noise, steps, smooth scene, flat.
fn pictures() -> impl Strategy<Value = Picture> {
    (16_usize..70, 16_usize..70, 0_usize..4, any::<u32>()).prop_map(
        |(width, height, kind, seed)| {
            Picture::draw(width, height, move |x, y| match kind {
                0 => f64::from((x as u32 * 7919 + y as u32 * 104_729).wrapping_mul(seed | 1) >> 24),
                1 => f64::from(((x as u32 / 9 + y as u32 / 7 + seed % 5) % 2) * 255),
                2 => scene(x + f64::from(seed % 64), y, 128.0),
                _ => f64::from(seed % 256),
            })
        },
    )
}

fn check(picture: &Picture, features: &Features) -> Result<(), TestCaseError> {
    prop_assert_eq!(features.keypoints.len(), features.descriptors.len());
    let min_response = SiftParams::default().contrast_threshold / 3.0;
    for (k, d) in features.keypoints.iter().zip(&features.descriptors) {
        prop_assert!(k.x >= 2.0 && k.x <= picture.width as f32 - 3.0, "{:?}", k);
        prop_assert!(k.y >= 2.0 && k.y <= picture.height as f32 - 3.0, "{:?}", k);
        prop_assert!(k.sigma > 0.79 && k.sigma.is_finite(), "{:?}", k);
        prop_assert!((0.0..std::f32::consts::TAU).contains(&k.angle), "{:?}", k);
        prop_assert!(k.response >= min_response, "{:?}", k);
        // Length 512, less what saturates at 255 of 512, plus rounding of 128 values by half a unit: 0.5 sqrt(128).
        let length = descriptor_distance(d, &[0; 128]);
        let saturated = d.contains(&255);
        prop_assert!(
            length < 518.0 && (saturated || length > 506.0),
            "length {}",
            length
        );
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 120, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn features_are_well_formed(picture in pictures()) {
        check(&picture, &detect(&picture))?;
    }

    #[test]
    fn stride_does_not_matter(picture in pictures(), extra in 1_usize..40) {
        let stride = picture.width + extra;
        let mut padded = vec![0xA5_u8; stride * picture.height];
        for (to, from) in padded.chunks_mut(stride).zip(picture.pixels.chunks(picture.width)) {
            to[..picture.width].copy_from_slice(from);
        }
        let view = GrayImage::with_stride(picture.width, picture.height, stride, &padded).unwrap();
        prop_assert_eq!(vision_sift::detect(&view).unwrap(), detect(&picture));
    }

    #[test]
    fn the_strongest_are_kept_in_order(picture in pictures(), limit in 1_usize..40) {
        let all = detect(&picture);
        let some = detect_with(&picture, SiftParams { max_features: Some(limit), ..SiftParams::default() });
        prop_assert_eq!(some.keypoints.len(), limit.min(all.keypoints.len()));
        let weakest = some.keypoints.iter().map(|k| k.response).fold(f32::INFINITY, f32::min);
        let stronger = all.keypoints.iter().filter(|k| k.response > weakest).count();
        prop_assert!(stronger < limit.max(1) || all.keypoints.len() <= limit);
        // The features kept are a subsequence of all features.
        let mut rest = all.keypoints.iter().zip(&all.descriptors);
        for pair in some.keypoints.iter().zip(&some.descriptors) {
            prop_assert!(rest.any(|other| other == pair));
        }
    }
}

#[test]
fn a_used_workspace_gives_the_same_and_does_not_grow() {
    let pictures = [(90, 70), (64, 64), (33, 121), (90, 70)]
        .map(|(w, h)| Picture::draw(w, h, |x, y| scene(x, y, 90.0)));
    let detector = Detector::new(SiftParams::default()).unwrap();
    let (mut workspace, mut features) = (Workspace::new(), Features::default());
    assert_eq!(workspace.memory_usage(), 0);
    for picture in &pictures {
        detector
            .detect(&picture.view(), &mut workspace, &mut features)
            .unwrap();
        assert_eq!(features, detect(picture));
    }
    let held = workspace.memory_usage();
    // At least the 6 levels of the doubled image of 179 x 139 and the image itself.
    assert!(held > 7 * 179 * 139 * 4);
    for picture in &pictures {
        detector
            .detect(&picture.view(), &mut workspace, &mut features)
            .unwrap();
    }
    assert_eq!(workspace.memory_usage(), held);
}

#[test]
fn the_steady_state_allocates_nothing() {
    let picture = Picture::draw(160, 120, |x, y| scene(x, y, 160.0));
    let detector = Detector::new(SiftParams::default()).unwrap();
    let (mut workspace, mut features) = (Workspace::new(), Features::default());
    let mut allocations = |fresh: bool| {
        // On the thread that counts: one thread of a pool of one, or this one without the feature.
        let run = || {
            allocation_counter::measure(|| {
                detector
                    .detect(&picture.view(), &mut workspace, &mut features)
                    .unwrap();
            })
        };
        let counted = on_one_thread(run).count_total;
        assert_eq!(counted > 0, fresh, "{counted} allocations");
    };
    allocations(true);
    for _ in 0..3 {
        allocations(false);
    }
    assert!(!features.keypoints.is_empty());
}

#[cfg(feature = "parallel")]
fn on_one_thread<R: Send>(run: impl FnOnce() -> R + Send) -> R {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("one thread").install(run)
}

#[cfg(not(feature = "parallel"))]
fn on_one_thread<R>(run: impl FnOnce() -> R) -> R {
    run()
}

#[test]
fn instruction_sets_do_not_matter() {
    let pictures = [(200, 151, 0.64), (16, 16, 8.0), (33, 121, 1.0)]
        .map(|(w, h, scale)| Picture::draw(w, h, move |x, y| scene(x * scale, y * scale, 128.0)));
    for params in [SiftParams::default(), SiftParams::opencv()] {
        let params = SiftParams {
            contrast_threshold: 0.005,
            ..params
        };
        for picture in &pictures {
            let run = |simd| {
                let detector = Detector::new(params.clone()).unwrap().with_simd(simd);
                let mut features = Features::default();
                detector
                    .detect(&picture.view(), &mut Workspace::new(), &mut features)
                    .unwrap();
                features
            };
            let portable = run(SimdLevel::Portable);
            for simd in SimdLevel::available() {
                assert!(run(simd) == portable, "{simd}");
            }
        }
    }
}

#[test]
fn a_region_keeps_what_lies_in_it() {
    let picture = Picture::draw(160, 120, |x, y| scene(x, y, 160.0));
    let all = detect(&picture);
    let inside = |k: &Keypoint| k.x.round() >= 70.0 && k.y.round() < 90.0;
    let region = Picture::draw(
        160,
        120,
        |x, y| {
            if x >= 70.0 && y < 90.0 { 1.0 } else { 0.0 }
        },
    );
    let mut features = Features::default();
    let mut run = |limit: Option<usize>, region: &Picture| {
        let detector = Detector::new(SiftParams {
            max_features: limit,
            ..SiftParams::default()
        })
        .unwrap();
        detector
            .detect_in_region(
                &picture.view(),
                &region.view(),
                &mut Workspace::new(),
                &mut features,
            )
            .map(|()| features.clone())
    };
    let kept = run(None, &region).unwrap();
    let expected: Vec<_> = all.keypoints.iter().filter(|k| inside(k)).collect();
    assert!(expected.len() > 5 && expected.len() < all.keypoints.len());
    assert_eq!(kept.keypoints.iter().collect::<Vec<_>>(), expected);
    // The limit counts only what is inside.
    assert_eq!(run(Some(5), &region).unwrap().keypoints.len(), 5);
    let nowhere = Picture::draw(160, 120, |_, _| 0.0);
    assert!(run(None, &nowhere).unwrap().keypoints.is_empty());
    let small = Picture::draw(160, 119, |_, _| 1.0);
    assert_eq!(
        run(None, &small).unwrap_err().to_string(),
        "region is 160x119 pixels, the image 160x120"
    );
}

#[cfg(feature = "parallel")]
#[test]
fn threads_do_not_matter() {
    let picture = Picture::draw(200, 151, |x, y| scene(x * 0.64, y * 0.64, 128.0));
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            detect_with(
                &picture,
                SiftParams {
                    contrast_threshold: 0.005,
                    ..SiftParams::default()
                },
            )
        })
    };
    let one = run(1);
    assert!(one.keypoints.len() > 100);
    for threads in [2, 3, 7] {
        assert_eq!(run(threads), one, "{threads} threads");
    }
}

#[test]
fn flat_pictures_have_no_keypoints_and_are_no_error() {
    for grey in [0_u8, 1, 77, 128, 255] {
        for (width, height) in [(16, 16), (17, 33), (320, 240)] {
            let picture = Picture {
                width,
                height,
                pixels: vec![grey; width * height],
            };
            let params = SiftParams {
                contrast_threshold: 0.0001,
                ..SiftParams::default()
            };
            assert_eq!(detect_with(&picture, params), Features::default());
        }
    }
}

#[test]
fn every_small_and_odd_size_works() {
    for width in 16..40 {
        for height in [16, 17, 23, 31, 32, 33] {
            let picture = Picture::draw(width, height, |x, y| scene(x * 3.0, y * 3.0, 128.0));
            check(&picture, &detect(&picture)).unwrap();
            let plain = SiftParams {
                double_image: false,
                scales_per_octave: 1,
                base_sigma: 4.0,
                ..SiftParams::default()
            };
            detect_with(&picture, plain);
        }
    }
    let few = [9_u8; 15 * 400];
    assert_eq!(
        GrayImage::new(400, 15, &few).unwrap_err(),
        SiftError::ImageTooSmall {
            width: 400,
            height: 15,
            minimum: 16
        }
    );
}

#[test]
fn other_parameters_find_the_same_scene() {
    let picture = Picture::draw(150, 150, |x, y| scene(x, y, 150.0));
    let reference = detect(&picture);
    for scales_per_octave in [2, 4, 5] {
        let params = SiftParams {
            scales_per_octave,
            ..SiftParams::default()
        };
        let other = detect_with(&picture, params);
        let (share, _) = agreement(&reference, &other, |x, y| (x, y), 0.0, 1.0);
        assert!(share > 0.6, "{scales_per_octave} scales: {share}");
    }
}

#[test]
fn a_shift_by_whole_pixels_moves_the_keypoints_only() {
    // A shift by whole pixels moves coordinates by exactly that: far from the border nothing else changes in octave 0.
    let a = Picture::draw(140, 140, |x, y| scene(x, y, 140.0));
    let b = Picture::draw(140, 140, |x, y| scene(x + 8.0, y + 4.0, 140.0));
    let (fa, fb) = (detect(&a), detect(&b));
    let inside = |k: &&vision_sift::Keypoint| {
        k.sigma < 2.0 && (30.0..100.0).contains(&k.x) && (30.0..100.0).contains(&k.y)
    };
    let mut count = 0;
    for k in fa.keypoints.iter().filter(inside) {
        let moved = fb.keypoints.iter().any(|q| {
            (q.x + 8.0 - k.x).abs() < 1e-4
                && (q.y + 4.0 - k.y).abs() < 1e-4
                && (q.sigma - k.sigma).abs() < 1e-4
        });
        assert!(moved, "{k:?}");
        count += 1;
    }
    assert!(count > 15, "{count}");
}
