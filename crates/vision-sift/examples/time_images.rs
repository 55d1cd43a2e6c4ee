//! Times the detector for a script that times a rival between two calls.
//!
//! `cargo run --release -p vision-sift --features image --example time_images -- [THREADS] [LEVEL]`
//!
//! Each line of standard input is the path of a picture (PNG, JPEG); the answer is one line
//! `milliseconds keypoints bytes`: the time of one detection with all keypoints described, in a workspace that has
//! seen the picture before, the number of keypoints, and the size of the workspace. LEVEL is one of `portable`, `avx2`,
//! `avx512`. The last picture stays loaded, so that repeated paths cost no reading.

#![expect(
    clippy::print_stdout,
    reason = "a command-line example writes its result"
)]

use std::error::Error;
use std::io::{BufRead as _, Write as _};
use std::time::Instant;

use simd_level::SimdLevel;
use vision_sift::{Detector, Features, GrayImage, SiftParams, Workspace};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let threads = arguments.next().map_or(Ok(1), |text| text.parse())?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()?;
    let mut detector = Detector::new(SiftParams::default())?;
    if let Some(name) = arguments.next() {
        let simd = SimdLevel::available().find(|level| level.to_string() == name);
        detector = detector.with_simd(simd.ok_or("instruction set not available")?);
    }
    let (mut workspace, mut features) = (Workspace::new(), Features::default());
    let mut last = (String::new(), image::GrayImage::new(0, 0));
    for path in std::io::stdin().lock().lines() {
        let path = path?;
        if path != last.0 {
            last = (path.clone(), image::open(&path)?.into_luma8());
            let view = GrayImage::try_from(&last.1)?;
            pool.install(|| detector.detect(&view, &mut workspace, &mut features))?;
        }
        let view = GrayImage::try_from(&last.1)?;
        let start = Instant::now();
        pool.install(|| detector.detect(&view, &mut workspace, &mut features))?;
        let elapsed = start.elapsed().as_secs_f64() * 1e3;
        println!(
            "{elapsed:.4} {} {}",
            features.keypoints.len(),
            workspace.memory_usage()
        );
        std::io::stdout().flush()?;
    }
    Ok(())
}
