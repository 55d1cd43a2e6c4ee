//! `mono-slam match`: matches of two images after the ratio test.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use feature_kdtree::{AutoIndex, DescriptorIndex as _, Match, match_descriptors};
use image::{GrayImage, Rgb, RgbImage};
use slam_io::{check_output_file, write_file};
use vision_sift::Features;

use super::features::detect;
use crate::failure::{Failure, distinct};

/// Arguments of `mono-slam match`.
#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// First image
    #[arg(value_name = "A")]
    first: PathBuf,
    /// Second image
    #[arg(value_name = "B")]
    second: PathBuf,
    /// CSV file for the matches
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Picture with both images and lines between matches
    #[arg(long, value_name = "FILE.png")]
    picture: Option<PathBuf>,
    /// Nearest over second nearest descriptor distance
    #[arg(long, default_value_t = 0.7)]
    ratio: f32,
}

/// Matches and writes.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut files: Vec<(&str, &Path)> = vec![
        ("the first image", &arguments.first),
        ("the second image", &arguments.second),
    ];
    // The two images may be one; no result may be an image or the other result.
    for (name, path) in [
        ("--out", Some(&arguments.out)),
        ("--picture", arguments.picture.as_ref()),
    ] {
        let Some(path) = path else { continue };
        check_output_file(path)?;
        for earlier in &files {
            distinct(&[*earlier, (name, path)])?;
        }
        files.push((name, path));
    }
    let (image_a, a) = detect(&arguments.first, None)?;
    let (image_b, b) = detect(&arguments.second, None)?;
    let matches = ratio_matches(&a, &b, arguments.ratio)
        .map_err(|e| Failure::input(format!("--ratio: {e}")))?;
    let mut table = String::from("xa,ya,xb,yb,distance,ratio\n");
    for m in &matches {
        let (ka, kb) = (&a.keypoints[m.query as usize], &b.keypoints[m.id as usize]);
        let distance = f64::from(m.distance_squared).sqrt();
        let _ = writeln!(
            table,
            "{},{},{},{},{distance:.3},{}",
            ka.x, ka.y, kb.x, kb.y, m.ratio
        );
    }
    write_file(&arguments.out, table.as_bytes())?;
    if let Some(path) = &arguments.picture {
        let picture = draw(&image_a, &image_b, &a, &b, &matches);
        let mut png = std::io::Cursor::new(Vec::new());
        picture
            .write_to(&mut png, image::ImageFormat::Png)
            .map_err(|e| Failure::Other(e.into()))?;
        write_file(path, png.get_ref())?;
    }
    Ok(())
}

fn ratio_matches(
    a: &Features,
    b: &Features,
    ratio: f32,
) -> Result<Vec<Match>, feature_kdtree::IndexError> {
    let mut index = AutoIndex::new();
    for (id, descriptor) in b.descriptors.iter().enumerate() {
        index.insert(id as u32, descriptor)?;
    }
    match_descriptors(&a.descriptors, &index, ratio)
}

/// Both images side by side with a line for every match.
fn draw(
    image_a: &GrayImage,
    image_b: &GrayImage,
    a: &Features,
    b: &Features,
    matches: &[Match],
) -> RgbImage {
    let offset = image_a.width();
    let mut picture = RgbImage::new(
        offset + image_b.width(),
        image_a.height().max(image_b.height()),
    );
    for (left, image) in [(0, image_a), (offset, image_b)] {
        for (x, y, p) in image.enumerate_pixels() {
            picture.put_pixel(left + x, y, Rgb([p.0[0]; 3]));
        }
    }
    // Colours of equal lightness, one per match in turn.
    const COLOURS: [[u8; 3]; 6] = [
        [230, 80, 60],
        [60, 170, 80],
        [70, 120, 230],
        [220, 170, 30],
        [180, 80, 200],
        [40, 180, 190],
    ];
    for (i, m) in matches.iter().enumerate() {
        let (ka, kb) = (&a.keypoints[m.query as usize], &b.keypoints[m.id as usize]);
        let from = (ka.x, ka.y);
        let to = (kb.x + offset as f32, kb.y);
        let steps = (to.0 - from.0).hypot(to.1 - from.1).ceil().max(1.0);
        for s in 0..=steps as u32 {
            let t = s as f32 / steps;
            let x = (from.0 + t * (to.0 - from.0)).round() as i64;
            let y = (from.1 + t * (to.1 - from.1)).round() as i64;
            if let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y))
                && x < picture.width()
                && y < picture.height()
            {
                picture.put_pixel(x, y, Rgb(COLOURS[i % COLOURS.len()]));
            }
        }
    }
    picture
}
