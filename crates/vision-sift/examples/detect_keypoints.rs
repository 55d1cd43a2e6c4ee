//! Keypoints and descriptors of one picture as CSV on standard output.
//!
//! `cargo run --release -p vision-sift --example detect_keypoints -- PICTURE.png [CONTRAST_THRESHOLD] > features.csv`
//!
//! Columns: x, y, sigma (pixels, (0, 0) the centre of the top-left pixel), angle (degrees), response, 128 bytes.
//! Any format the `image` crate is built with here (PNG, JPEG) and binary 8-bit PGM. Without arguments a small drawn
//! picture is used.

#![expect(
    clippy::print_stdout,
    reason = "a command-line example writes its result"
)]

use std::error::Error;
use std::fmt::Write as _;

use vision_sift::{Detector, Features, GrayImage, SiftParams, Workspace};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (width, height, pixels) = match arguments.next() {
        Some(path) => read_grey(&path)?,
        None => drawn(),
    };
    let mut params = SiftParams::default();
    if let Some(threshold) = arguments.next() {
        params.contrast_threshold = threshold.parse()?;
    }
    let image = GrayImage::new(width, height, &pixels)?;
    let mut features = Features::default();
    Detector::new(params)?.detect(&image, &mut Workspace::new(), &mut features)?;

    let mut csv = String::from("x,y,sigma,angle_deg,response");
    for i in 0..128 {
        write!(csv, ",d{i}")?;
    }
    for (k, descriptor) in features.keypoints.iter().zip(&features.descriptors) {
        write!(
            csv,
            "\n{:.4},{:.4},{:.4},{:.3},{:.6}",
            k.x,
            k.y,
            k.sigma,
            k.angle.to_degrees(),
            k.response
        )?;
        for value in descriptor {
            write!(csv, ",{value}")?;
        }
    }
    println!("{csv}");
    Ok(())
}

/// Width, height and grey values of a picture file.
fn read_grey(path: &str) -> Result<(usize, usize, Vec<u8>), Box<dyn Error>> {
    if path.ends_with(".pgm") {
        return read_pgm(&std::fs::read(path)?)
            .ok_or_else(|| format!("{path}: not a binary 8-bit PGM").into());
    }
    let picture = image::open(path)?.into_luma8();
    Ok((
        picture.width() as usize,
        picture.height() as usize,
        picture.into_raw(),
    ))
}

/// `P5 width height 255` and the pixels after one white-space byte.
fn read_pgm(bytes: &[u8]) -> Option<(usize, usize, Vec<u8>)> {
    let mut words = [0_usize; 3];
    let mut at = bytes.starts_with(b"P5").then_some(2)?;
    for word in &mut words {
        while bytes.get(at)?.is_ascii_whitespace() {
            at += 1;
        }
        let digits = bytes[at..]
            .iter()
            .take_while(|b| b.is_ascii_digit())
            .count();
        *word = std::str::from_utf8(&bytes[at..at + digits])
            .ok()?
            .parse()
            .ok()?;
        at += digits;
    }
    let pixels = bytes.get(at + 1..at + 1 + words[0].checked_mul(words[1])?)?;
    (words[2] == 255).then(|| (words[0], words[1], pixels.to_vec()))
}

/// Three soft spots on a dark ground.
fn drawn() -> (usize, usize, Vec<u8>) {
    let (width, height) = (160, 120);
    let spots = [
        (40.0_f64, 30.0_f64, 3.0_f64),
        (100.5, 60.25, 6.0),
        (50.0, 90.0, 4.5),
    ];
    let grey = |i: usize| {
        let (x, y) = ((i % width) as f64, (i / width) as f64);
        let sum: f64 = spots
            .iter()
            .map(|(u, v, s)| 150.0 * (-((x - u).powi(2) + (y - v).powi(2)) / (2.0 * s * s)).exp())
            .sum();
        (30.0 + sum).min(255.0) as u8
    };
    (width, height, (0..width * height).map(grey).collect())
}
