//! Time of one image of 320x240 and of 640x480, all stages, on one thread and on the default pool.

use criterion::{Criterion, criterion_group, criterion_main};
use vision_sift::{Detector, Features, GrayImage, SiftParams, Workspace};

/// Smoothed noise at three scales: about as many keypoints as an indoor picture.
fn textured(width: usize, height: usize) -> Vec<u8> {
    let mut state = 1_u32;
    let mut lattice = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 16) / 65_536.0
    };
    let octaves: Vec<(f64, Vec<f64>)> = [6.0, 14.0, 40.0]
        .iter()
        .map(|&cell| (cell, (0..128 * 128).map(|_| lattice()).collect()))
        .collect();
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let value = |x: f64, y: f64| -> f64 {
        let one = |(cell, grid): &(f64, Vec<f64>)| {
            let (u, v) = (x / cell, y / cell);
            let (i, j) = (u as usize, v as usize);
            let (a, b) = (smooth(u.fract()), smooth(v.fract()));
            let at = |i: usize, j: usize| grid[(j % 128) * 128 + i % 128];
            (at(i, j) * (1.0 - a) + at(i + 1, j) * a) * (1.0 - b)
                + (at(i, j + 1) * (1.0 - a) + at(i + 1, j + 1) * a) * b
        };
        octaves.iter().map(one).sum::<f64>() / 3.0
    };
    (0..width * height)
        .map(|i| (255.0 * value((i % width) as f64, (i / width) as f64)) as u8)
        .collect()
}

fn detect(c: &mut Criterion) {
    for (width, height) in [(320, 240), (640, 480)] {
        let pixels = textured(width, height);
        let image = GrayImage::new(width, height, &pixels).expect("large enough");
        let detector = Detector::new(SiftParams::default()).expect("defaults are in range");
        let (mut workspace, mut features) = (Workspace::new(), Features::default());
        let mut run = || {
            detector
                .detect(&image, &mut workspace, &mut features)
                .map(|()| features.keypoints.len())
        };
        let count = run().expect("checked input");
        c.bench_function(&format!("detect_{width}x{height}_{count}_keypoints"), |b| {
            b.iter(&mut run);
        });
    }
}

#[cfg(feature = "parallel")]
fn detect_one_thread(c: &mut Criterion) {
    let pixels = textured(320, 240);
    let image = GrayImage::new(320, 240, &pixels).expect("large enough");
    let detector = Detector::new(SiftParams::default()).expect("defaults are in range");
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("one thread");
    let (mut workspace, mut features) = (Workspace::new(), Features::default());
    c.bench_function("detect_320x240_one_thread", |b| {
        b.iter(|| pool.install(|| detector.detect(&image, &mut workspace, &mut features)));
    });
}

#[cfg(not(feature = "parallel"))]
fn detect_one_thread(_: &mut Criterion) {}

criterion_group!(benches, detect, detect_one_thread);
criterion_main!(benches);
