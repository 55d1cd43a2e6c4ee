//! The OpenCV mode against OpenCV 5.0.0: `tests/reference/opencv_mode.csv` for the drawn scene and, where they have been
//! made, seven photographs (`tests/reference/opencv_photographs.py`).
//!
//! Two features are the same when they agree within 0.05 pixels in position, 1 % in scale, half a degree in angle and 1 %
//! in response. Descriptors are the same when no value differs by more than 1. All points cannot be demanded: a value
//! within `f32` rounding of a threshold falls either way, and of the refinement's long steps (nearly singular Hessians)
//! some multiply the rounding.

use std::path::{Path, PathBuf};

use crate::optional_data::{folder, present};
use crate::pictures::{Picture, angle_between, detect_with, scene, stated_sum};
use vision_sift::{Conventions, Features, Keypoint, SiftParams};

const SCENE: &str = include_str!("../reference/opencv_mode.csv");

/// The least share of features found, in each direction, and of equal descriptors among them. A scene has some 250.
const SCENE_SHARE: f64 = 0.99;

/// The same over all photographs, some 3700 features.
const PHOTOGRAPHS_SHARE: f64 = 0.998;

fn default_upscale() -> SiftParams {
    SiftParams::opencv()
}

fn precise_upscale() -> SiftParams {
    SiftParams {
        conventions: Conventions::opencv_precise(),
        ..SiftParams::opencv()
    }
}

/// The rows of `text` whose first column is `upscale`.
fn features(text: &str, upscale: &str) -> Features {
    let mut features = Features::default();
    for line in text.lines().skip(2) {
        let (numbers, descriptor) = line.rsplit_once(',').unwrap();
        let mut values = numbers.split(',');
        if values.next() != Some(upscale) {
            continue;
        }
        let mut next = || values.next().unwrap().parse::<f32>().unwrap();
        features.keypoints.push(Keypoint {
            x: next(),
            y: next(),
            sigma: next(),
            angle: next().to_radians(),
            response: next(),
        });
        let value = |i: usize| u8::from_str_radix(&descriptor[2 * i..2 * i + 2], 16).unwrap();
        features.descriptors.push(std::array::from_fn(value));
    }
    features
}

fn same(p: &Keypoint, q: &Keypoint) -> bool {
    (p.x - q.x).hypot(p.y - q.y) < 0.05
        && (p.sigma / q.sigma - 1.0).abs() < 0.01
        && angle_between(p.angle, q.angle).abs() < 0.5_f32.to_radians()
        && (p.response / q.response - 1.0).abs() < 0.01
}

/// Counts over one or more pictures.
#[derive(Debug, Default)]
struct Agreement {
    theirs: usize,
    ours: usize,
    theirs_found: usize,
    ours_found: usize,
    equal_descriptors: usize,
}

impl Agreement {
    fn add(&mut self, ours: &Features, theirs: &Features) {
        self.theirs += theirs.keypoints.len();
        self.ours += ours.keypoints.len();
        for (k, d) in theirs.keypoints.iter().zip(&theirs.descriptors) {
            let Some(i) = ours.keypoints.iter().position(|q| same(k, q)) else {
                continue;
            };
            self.theirs_found += 1;
            let far = d
                .iter()
                .zip(&ours.descriptors[i])
                .any(|(a, b)| a.abs_diff(*b) > 1);
            self.equal_descriptors += usize::from(!far);
        }
        let found = |q: &&Keypoint| theirs.keypoints.iter().any(|k| same(k, q));
        self.ours_found += ours.keypoints.iter().filter(found).count();
    }

    /// Shares of their features found, of ours found, of equal descriptors.
    fn shares(&self) -> [f64; 3] {
        [
            self.theirs_found as f64 / self.theirs as f64,
            self.ours_found as f64 / self.ours as f64,
            self.equal_descriptors as f64 / self.theirs_found as f64,
        ]
    }

    #[expect(
        clippy::print_stdout,
        reason = "the shares are what these tests report"
    )]
    fn assert(&self, of: &str, least: f64) {
        let shares = self.shares();
        println!("{of}: {shares:.4?} of {self:?}");
        assert!(shares.iter().all(|&s| s >= least), "{of}: {shares:.4?}");
    }
}

fn scene_picture() -> Picture {
    let picture = Picture::draw(240, 180, |x, y| scene(x, y, 240.0));
    // A library exponential one ulp away may flip a rounding, not more.
    assert!(picture.sum().abs_diff(stated_sum(SCENE)) <= 2);
    picture
}

#[test]
fn val_opencv_mode_scene() {
    let picture = scene_picture();
    for (params, upscale, count) in [(default_upscale(), "0", 244), (precise_upscale(), "1", 248)] {
        let theirs = features(SCENE, upscale);
        assert_eq!(theirs.keypoints.len(), count);
        let mut agreement = Agreement::default();
        agreement.add(&detect_with(&picture, params), &theirs);
        agreement.assert(&format!("scene, upscale {upscale}"), SCENE_SHARE);
    }
}

/// The comparison tells conventions apart: this crate's own share some positions and almost no descriptor with OpenCV's.
#[test]
fn val_opencv_mode_is_not_the_default() {
    let mut agreement = Agreement::default();
    let ours = detect_with(&scene_picture(), SiftParams::default());
    agreement.add(&ours, &features(SCENE, "1"));
    let [found, _, equal] = agreement.shares();
    assert!(found < 0.8 && equal < 0.1, "{found} {equal}");
}

/// The folder of photographs, which `tests/reference/opencv_photographs.py FOLDER` makes; `None` where it is absent.
fn photographs() -> Option<PathBuf> {
    std::env::var_os("MONO_SLAM_OPENCV_PHOTOGRAPHS").map_or_else(
        || folder("opencv_sift_photographs"),
        |path| present(PathBuf::from(path)),
    )
}

/// `P5 width height 255`, one white-space byte, the pixels, as the script writes it.
fn read_pgm(path: &Path) -> Picture {
    let bytes = std::fs::read(path).unwrap();
    let mut at = 2;
    assert!(bytes.starts_with(b"P5"));
    let mut number = || {
        at += bytes[at..].iter().position(u8::is_ascii_digit).unwrap();
        let end = at
            + bytes[at..]
                .iter()
                .position(|b| !b.is_ascii_digit())
                .unwrap();
        let text = std::str::from_utf8(&bytes[at..end]).unwrap();
        at = end;
        text.parse::<usize>().unwrap()
    };
    let (width, height, largest) = (number(), number(), number());
    assert_eq!(largest, 255);
    let pixels = bytes[at + 1..].to_vec();
    assert_eq!(pixels.len(), width * height);
    Picture {
        width,
        height,
        pixels,
    }
}

#[test]
fn val_opencv_mode_photographs() {
    let Some(folder) = photographs() else {
        return;
    };
    let mut files: Vec<PathBuf> = std::fs::read_dir(&folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "pgm"))
        .collect();
    files.sort();
    assert!(!files.is_empty(), "no photographs in {}", folder.display());
    for (params, upscale) in [(default_upscale(), "0"), (precise_upscale(), "1")] {
        let mut agreement = Agreement::default();
        for file in &files {
            let text = std::fs::read_to_string(file.with_extension("csv")).unwrap();
            let picture = read_pgm(file);
            assert_eq!(picture.sum(), stated_sum(&text), "{}", file.display());
            let ours = detect_with(&picture, params.clone());
            agreement.add(&ours, &features(&text, upscale));
        }
        let of = format!("{} photographs, upscale {upscale}", files.len());
        agreement.assert(&of, PHOTOGRAPHS_SHARE);
    }
}
