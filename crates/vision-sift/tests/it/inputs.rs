//! Pictures of 16 bits and of floats, colours, masks, and features spread over the picture.

use crate::pictures::{Picture, scene};
use vision_sift::{
    Detector, Features, GrayImage, Keypoint, Pixel, Selection, SiftError, SiftParams, Workspace,
    grey_from_rgb,
};

fn found<P: Pixel>(image: &GrayImage<'_, P>, params: SiftParams) -> Features {
    let mut features = Features::default();
    let detector = Detector::new(params).expect("parameters are in range");
    detector
        .detect(image, &mut Workspace::new(), &mut features)
        .expect("images were checked");
    features
}

fn textured() -> Picture {
    Picture::draw(160, 120, |x, y| scene(x, y, 128.0))
}

/// The grey values differ by rounding only (2^-24 of the range): so do positions, and no more than a keypoint on a threshold
/// is lost.
#[test]
fn sixteen_bits_and_floats_give_the_keypoints_of_bytes() {
    let picture = textured();
    let bytes = found(&picture.view(), SiftParams::default()).keypoints;
    assert!(bytes.len() > 50, "{}", bytes.len());
    let wide: Vec<u16> = picture.pixels.iter().map(|&p| u16::from(p) * 257).collect();
    let floats: Vec<f32> = picture
        .pixels
        .iter()
        .map(|&p| f32::from(p) / 255.0)
        .collect();
    let of_wide = GrayImage::new(160, 120, &wide).unwrap();
    let of_floats = GrayImage::new(160, 120, &floats).unwrap();
    for other in [
        found(&of_wide, SiftParams::default()).keypoints,
        found(&of_floats, SiftParams::default()).keypoints,
    ] {
        let same = |a: &Keypoint, b: &Keypoint| {
            (a.x - b.x).hypot(a.y - b.y) < 1e-2
                && (a.sigma / b.sigma - 1.0).abs() < 1e-2
                && (a.angle - b.angle).abs() < 1e-2
        };
        let lost = bytes
            .iter()
            .filter(|a| !other.iter().any(|b| same(a, b)))
            .count();
        assert!(lost * 100 <= bytes.len(), "{lost} of {}", bytes.len());
        assert!(other.len().abs_diff(bytes.len()) * 100 <= bytes.len());
    }
}

#[test]
fn a_pixel_that_is_no_number_is_refused_with_its_place() {
    let mut pixels = vec![0.5_f32; 20 * 20];
    pixels[3 * 20 + 7] = f32::NAN;
    let error = GrayImage::new(20, 20, &pixels).unwrap_err();
    assert_eq!(
        error.to_string(),
        "pixel (7, 3) is NaN, a finite number needed"
    );
    // beyond the rows nothing is looked at
    pixels[3 * 20 + 7] = 2.0;
    pixels.push(f32::NAN);
    assert!(GrayImage::new(20, 20, &pixels).is_ok());
}

#[test]
fn colours_become_the_grey_of_opencv() {
    // cv2.cvtColor(..., cv2.COLOR_RGB2GRAY) of OpenCV 5.0
    let colours = [255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255, 10, 200, 30];
    assert_eq!(grey_from_rgb(&colours).unwrap(), [76, 150, 29, 255, 124]);
    assert_eq!(
        grey_from_rgb(&colours[..7]),
        Err(SiftError::ColourCount { length: 7 })
    );
}

#[test]
fn a_mask_holds_for_every_kind_of_pixel() {
    let picture = textured();
    let wide: Vec<u16> = picture.pixels.iter().map(|&p| u16::from(p) * 257).collect();
    let mask: Vec<u8> = (0..160 * 120).map(|i| u8::from(i % 160 < 80)).collect();
    let mut features = Features::default();
    Detector::new(SiftParams::default())
        .unwrap()
        .detect_in_region(
            &GrayImage::new(160, 120, &wide).unwrap(),
            &GrayImage::new(160, 120, &mask).unwrap(),
            &mut Workspace::new(),
            &mut features,
        )
        .unwrap();
    assert!(features.keypoints.len() > 20 && features.keypoints.iter().all(|k| k.x < 80.0));
}

/// Strong texture on the left, a third of its contrast on the right.
#[test]
fn spread_features_cover_what_the_strongest_leave_empty() {
    let picture = Picture::draw(320, 120, |x, y| {
        let grey = scene(x % 160.0, y, 128.0);
        if x < 160.0 {
            grey
        } else {
            128.0 + (grey - 128.0) / 3.0
        }
    });
    let params = |selection| SiftParams {
        max_features: Some(60),
        contrast_threshold: 0.01,
        selection,
        ..SiftParams::default()
    };
    let on_the_right =
        |features: &Features| features.keypoints.iter().filter(|k| k.x > 160.0).count();
    let strongest = found(&picture.view(), params(Selection::Strongest));
    let spread = found(&picture.view(), params(Selection::Spread));
    assert_eq!(
        (strongest.keypoints.len(), spread.keypoints.len()),
        (60, 60)
    );
    let (few, many) = (on_the_right(&strongest), on_the_right(&spread));
    assert!(few < 15 && many > 20, "{few} {many}");
    // Every feature is one of those without a limit, in the same order.
    let all = found(
        &picture.view(),
        SiftParams {
            max_features: None,
            ..params(Selection::Spread)
        },
    );
    let mut rest = all.keypoints.iter();
    assert!(
        spread
            .keypoints
            .iter()
            .all(|k| rest.any(|other| other == k))
    );
    // A limit that nothing exceeds changes nothing.
    let wide = SiftParams {
        max_features: Some(100_000),
        ..params(Selection::Spread)
    };
    assert_eq!(found(&picture.view(), wide), all);
}
