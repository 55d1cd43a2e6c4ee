//! Recorded corridors, walked twice: which image saw the place before?

use image::ImageReader;
use nalgebra::Vector2;
use place_recognition::{Evidence, SamePlaceOptions, View, same_place};
use std::path::PathBuf;
use vision_sift::{Detector, GrayImage, SiftParams, Workspace};

/// Images of the sequence.
const IMAGES: usize = 84;
/// Images of a lap.
const LAP: usize = 40;
/// Earlier images are those at least so many before.
const GAP: usize = 20;

struct Features {
    pixels: Vec<Vector2<f64>>,
    descriptors: Vec<[u8; 128]>,
}

#[expect(clippy::print_stdout, reason = "a test that is skipped says so")]
fn folder() -> Option<PathBuf> {
    let root = std::env::var_os("MONO_SLAM_DATA").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let path = root.join("rtabmap_corridor_loops/images");
    if path.is_dir() {
        return Some(path);
    }
    println!("skipped: no optional data at {}", path.display());
    None
}

fn features(folder: &std::path::Path) -> Vec<Features> {
    let detector = Detector::new(SiftParams::default()).expect("the defaults are in range");
    let mut workspace = Workspace::new();
    let mut all = Vec::new();
    for number in 1..=IMAGES {
        let path = folder.join(format!("{number:03}.jpg"));
        let picture = ImageReader::open(path)
            .expect("the picture is there")
            .decode()
            .expect("the picture is a JPEG")
            .into_luma8();
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let mut found = vision_sift::Features::default();
        let grey = GrayImage::new(width, height, picture.as_raw())
            .expect("as many pixels as the sizes say");
        detector
            .detect(&grey, &mut workspace, &mut found)
            .expect("a picture has features");
        let pixel = |k: &vision_sift::Keypoint| Vector2::new(f64::from(k.x), f64::from(k.y));
        all.push(Features {
            pixels: found.keypoints.iter().map(pixel).collect(),
            descriptors: found.descriptors,
        });
    }
    all
}

/// For every image of a parity the best image at least [`GAP`] before, by the number of inliers; images are numbered from 1.
fn best_earlier(
    all: &[Features],
    parity: usize,
    options: &SamePlaceOptions,
) -> Vec<(usize, usize, Evidence)> {
    let view = |number: usize| View {
        pixels: &all[number - 1].pixels,
        descriptors: &all[number - 1].descriptors,
        width: 512,
        height: 384,
    };
    (GAP + 1..=IMAGES)
        .filter(|later| later % 2 == parity)
        .map(|later| {
            let evidence = |earlier: usize| {
                let found = same_place(&view(earlier), &view(later), options)
                    .expect("the options are in range");
                (later, earlier, found)
            };
            (1..=later - GAP)
                .map(evidence)
                .max_by_key(|(_, earlier, e)| (e.inliers.len(), std::cmp::Reverse(*earlier)))
                .expect("there are earlier images")
        })
        .collect()
}

/// The truth of the data: one lap before give or take two, two laps for the last four images.
fn is_right(later: usize, earlier: usize) -> bool {
    [LAP, 2 * LAP]
        .iter()
        .any(|lap| (earlier + lap).abs_diff(later) <= 2)
}

/// The middle between the most inliers of a wrong pair and the fewest of a right pair above it.
fn threshold(best: &[(usize, usize, Evidence)]) -> usize {
    let inliers = |right: bool| {
        best.iter()
            .filter(move |(later, earlier, _)| is_right(*later, *earlier) == right)
            .map(|(_, _, e)| e.inliers.len())
    };
    let wrong = inliers(false).max().expect("some are wrong");
    let right = inliers(true)
        .filter(|n| *n > wrong)
        .min()
        .expect("some are right");
    (wrong + right).div_ceil(2)
}

/// Pairs accepted, those of them that are right, and the images of the later laps.
fn count(best: &[(usize, usize, Evidence)]) -> (usize, usize, usize) {
    let accepted = || best.iter().filter(|(_, _, e)| e.same_place);
    let right = accepted().filter(|(later, earlier, _)| is_right(*later, *earlier));
    let revisits = best.iter().filter(|(later, _, _)| *later > LAP);
    (accepted().count(), right.count(), revisits.count())
}

#[test]
fn val_rtabmap_corridor_revisits() {
    let Some(folder) = folder() else { return };
    let all = features(&folder);
    let loose = SamePlaceOptions {
        min_inliers: 9,
        ..SamePlaceOptions::default()
    };
    let odd = best_earlier(&all, 1, &loose);
    let chosen = threshold(&odd);
    println!("chosen on the odd images: {chosen} inliers");
    assert_eq!(SamePlaceOptions::default().min_inliers, chosen);
    let (mut right_of_both, mut revisits_of_both) = (0, 0);
    for (name, parity) in [("odd", 1), ("even", 0)] {
        let best = best_earlier(&all, parity, &SamePlaceOptions::default());
        let (accepted, right, revisits) = count(&best);
        println!("{name}: {accepted} accepted, {right} of them right, {revisits} revisits");
        for (later, earlier, e) in &best {
            let (inliers, matches) = (e.inliers.len(), e.matches);
            println!(
                "  {later} {earlier}: {inliers} of {matches} matches, {}",
                e.same_place
            );
        }
        assert_eq!(accepted, right, "{name}: precision");
        right_of_both += right;
        revisits_of_both += revisits;
    }
    // Of all 44, blank walls among them; the description of the data counts 38 that SIFT can find.
    println!("recall {right_of_both} of {revisits_of_both}");
    assert!(right_of_both >= 36, "{right_of_both} of {revisits_of_both}");
}
