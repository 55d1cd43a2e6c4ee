//! Time of one image on one thread for every instruction set, of its stages, and on two threads.

use std::time::{Duration, Instant};

use criterion::{Criterion, criterion_group, criterion_main};
use simd_level::SimdLevel;
use vision_sift::{Detector, Features, GrayImage, SiftParams, Stage, Workspace};

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

/// The detector, the picture and the memory of one benchmark.
struct Run {
    detector: Detector,
    pixels: Vec<u8>,
    size: (usize, usize),
    workspace: Workspace,
    features: Features,
}

impl Run {
    fn new(width: usize, height: usize, simd: SimdLevel) -> Self {
        let detector = Detector::new(SiftParams::default()).expect("defaults are in range");
        Self {
            detector: detector.with_simd(simd),
            pixels: textured(width, height),
            size: (width, height),
            workspace: Workspace::new(),
            features: Features::default(),
        }
    }

    /// One detection; how long `stage` took.
    fn stage(&mut self, stage: Stage) -> Duration {
        let image = GrayImage::new(self.size.0, self.size.1, &self.pixels).expect("large enough");
        let (mut last, mut took) = (Instant::now(), Duration::ZERO);
        self.detector
            .detect_observed(
                &image,
                &mut self.workspace,
                &mut self.features,
                &mut |done| {
                    let now = Instant::now();
                    if done == stage {
                        took = now - last;
                    }
                    last = now;
                },
            )
            .expect("checked input");
        took
    }

    fn whole(&mut self) -> usize {
        let image = GrayImage::new(self.size.0, self.size.1, &self.pixels).expect("large enough");
        self.detector
            .detect(&image, &mut self.workspace, &mut self.features)
            .expect("checked input");
        self.features.keypoints.len()
    }
}

/// A number of threads to run on; without the feature `parallel`, the one there is.
#[cfg(feature = "parallel")]
struct Threads(rayon::ThreadPool);

#[cfg(feature = "parallel")]
impl Threads {
    fn new(count: usize) -> Self {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build();
        Self(pool.expect("threads"))
    }

    fn run<R: Send>(&self, run: impl FnOnce() -> R + Send) -> R {
        self.0.install(run)
    }
}

#[cfg(not(feature = "parallel"))]
struct Threads;

#[cfg(not(feature = "parallel"))]
impl Threads {
    fn new(_: usize) -> Self {
        Self
    }

    fn run<R>(&self, run: impl FnOnce() -> R) -> R {
        run()
    }
}

fn levels(c: &mut Criterion) {
    for (width, height) in [(320, 240), (640, 480)] {
        for simd in SimdLevel::available() {
            let mut run = Run::new(width, height, simd);
            let count = run.whole();
            let name = format!("detect_{width}x{height}_{count}_keypoints_{simd}");
            let one = Threads::new(1);
            c.bench_function(&name, |b| b.iter(|| one.run(|| run.whole())));
        }
    }
}

fn stages(c: &mut Criterion) {
    let mut run = Run::new(320, 240, SimdLevel::best());
    let one = Threads::new(1);
    for stage in Stage::ALL {
        c.bench_function(&format!("stage_320x240_{stage:?}"), |b| {
            b.iter_custom(|n| (0..n).map(|_| one.run(|| run.stage(stage))).sum());
        });
    }
}

fn two_threads(c: &mut Criterion) {
    let mut run = Run::new(320, 240, SimdLevel::best());
    let two = Threads::new(2);
    c.bench_function("detect_320x240_two_threads", |b| {
        b.iter(|| two.run(|| run.whole()));
    });
}

criterion_group!(benches, levels, stages, two_threads);
criterion_main!(benches);
