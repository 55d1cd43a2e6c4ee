//! `mono-slam features`: keypoints and descriptors of images as CSV.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use slam_io::{check_output_file, check_output_folder, write_file};
use slam_pipeline::config::Config;
use slam_pipeline::detector_of;
use vision_sift::{Features, GrayImage, Workspace};

use crate::failure::{Failure, distinct};

/// The largest limit the configuration allows; no image of ordinary size has as many.
const MAX_KEYPOINTS: u32 = 100_000;

/// Arguments of `mono-slam features`.
#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// PNG or JPEG images
    #[arg(value_name = "IMAGE", required = true)]
    images: Vec<PathBuf>,
    /// CSV file for one image, folder for several
    #[arg(long, value_name = "FILE|DIR")]
    out: PathBuf,
    /// Keep only the strongest keypoints of an image [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(10..=100_000))]
    max_keypoints: Option<u32>,
}

/// Detects and writes.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let targets = targets(arguments)?;
    // All images are detected before anything is written.
    let tables = arguments
        .images
        .iter()
        .map(|path| {
            let limit = arguments.max_keypoints.unwrap_or(MAX_KEYPOINTS);
            Ok(csv(&detect(path, Some(limit))?.1))
        })
        .collect::<Result<Vec<_>, Failure>>()?;
    if targets != [arguments.out.clone()] {
        std::fs::create_dir_all(&arguments.out).map_err(|e| {
            Failure::input(format!(
                "{}: expected a folder, {e}",
                arguments.out.display()
            ))
        })?;
    }
    for (target, table) in targets.iter().zip(tables) {
        write_file(target, table.as_bytes())?;
    }
    Ok(())
}

/// The file of every image: `--out` itself for one, else the image's name in the folder `--out`, each once.
fn targets(arguments: &Arguments) -> Result<Vec<PathBuf>, Failure> {
    let out = &arguments.out;
    if let [image] = arguments.images.as_slice()
        && !out.is_dir()
    {
        check_output_file(out)?;
        distinct(&[("the image", image), ("--out", out)])?;
        return Ok(vec![out.clone()]);
    }
    check_output_folder(out)?;
    let mut owners: BTreeMap<OsString, &Path> = BTreeMap::new();
    let mut targets = Vec::with_capacity(arguments.images.len());
    for image in &arguments.images {
        let mut name = image
            .file_stem()
            .unwrap_or(image.as_os_str())
            .to_os_string();
        name.push(".csv");
        targets.push(out.join(&name));
        let shown = name.to_string_lossy().into_owned();
        if let Some(earlier) = owners.insert(name, image) {
            return Err(Failure::input(format!(
                "{} and {} would both be written as {shown}: give each folder of images an --out of its own",
                earlier.display(),
                image.display()
            )));
        }
    }
    Ok(targets)
}

/// The grey image at `path` and its features under the default configuration, but for the number of keypoints kept.
pub(crate) fn detect(
    path: &Path,
    max_keypoints: Option<u32>,
) -> Result<(image::GrayImage, Features), Failure> {
    if path.is_dir() {
        return Err(Failure::input(format!(
            "{}: expected an image, found a folder",
            path.display()
        )));
    }
    let image = image::ImageReader::open(path)
        .map_err(|e| Failure::input(format!("{}: expected an image, {e}", path.display())))?
        .with_guessed_format()
        .map_err(|e| Failure::input(format!("{}: expected an image, {e}", path.display())))?
        .decode()
        .map_err(|e| {
            Failure::input(format!(
                "{}: expected a PNG or JPEG image, {e}",
                path.display()
            ))
        })?
        .into_luma8();
    let mut config = Config::default();
    if let Some(limit) = max_keypoints {
        config.features.max_keypoints = limit;
    }
    let config = config.check().map_err(|e| Failure::input(e.to_string()))?;
    let view = GrayImage::new(
        image.width() as usize,
        image.height() as usize,
        image.as_raw(),
    )
    .map_err(|e| Failure::input(format!("{}: {e}", path.display())))?;
    let mut features = Features::default();
    detector_of(&config)
        .and_then(|d| d.detect(&view, &mut Workspace::new(), &mut features))
        .map_err(|e| Failure::input(format!("{}: {e}", path.display())))?;
    Ok((image, features))
}

fn csv(features: &Features) -> String {
    let mut text = String::from("x,y,sigma,angle_deg,response");
    for i in 0..128 {
        let _ = write!(text, ",d{i}");
    }
    text.push('\n');
    for (k, d) in features.keypoints.iter().zip(&features.descriptors) {
        let _ = write!(
            text,
            "{},{},{},{},{}",
            k.x,
            k.y,
            k.sigma,
            k.angle.to_degrees(),
            k.response
        );
        for v in d {
            let _ = write!(text, ",{v}");
        }
        text.push('\n');
    }
    text
}
