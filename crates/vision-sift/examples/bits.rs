//! One number for all bits of the features of some drawn pictures: equal numbers mean equal features.
//!
//! `cargo run -p vision-sift --example bits` prints a line for every level of vector instructions of this processor. The
//! pictures and the detector use nothing whose rounding differs between processors, so the numbers are the same
//! everywhere; `xtask/scripts/neon_bits.py` compares those of x86-64 and aarch64.

#![expect(
    clippy::print_stdout,
    reason = "a command-line example writes its result"
)]

use simd_level::SimdLevel;
use vision_sift::{Detector, Features, GrayImage, SiftError, SiftParams, Workspace};

const SIZES: [(usize, usize); 3] = [(160, 120), (131, 97), (320, 240)];

fn main() -> Result<(), SiftError> {
    for level in SimdLevel::available() {
        let (mut bits, mut count) = (0xcbf2_9ce4_8422_2325, 0);
        for params in [SiftParams::default(), SiftParams::opencv()] {
            let detector = Detector::new(params)?.with_simd(level);
            for (width, height) in SIZES {
                let pixels = picture(width, height);
                let mut features = Features::default();
                let image = GrayImage::new(width, height, &pixels)?;
                detector.detect(&image, &mut Workspace::new(), &mut features)?;
                count += features.keypoints.len();
                for k in &features.keypoints {
                    for value in [k.x, k.y, k.sigma, k.angle, k.response] {
                        bits = hashed(bits, &value.to_bits().to_le_bytes());
                    }
                }
                bits = features
                    .descriptors
                    .iter()
                    .fold(bits, |bits, d| hashed(bits, d));
            }
        }
        println!("vision-sift {level} {count} {bits:016x}");
    }
    Ok(())
}

/// FNV-1a of some more bytes.
fn hashed(state: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(state, |state, &byte| {
        (state ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// Rectangles and ramps of many sizes, drawn with integers alone.
fn picture(width: usize, height: usize) -> Vec<u8> {
    let mut pixels = vec![90_u8; width * height];
    let mut state = 1_u64;
    let mut draw = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    for _ in 0..width * height / 150 {
        let (x, y, w, h) = (draw(width), draw(height), 2 + draw(17), 2 + draw(17));
        let (grey, slope) = (draw(200), draw(5));
        for v in y..(y + h).min(height) {
            for u in x..(x + w).min(width) {
                pixels[v * width + u] = (grey + slope * (u - x)).min(255) as u8;
            }
        }
    }
    pixels
}
