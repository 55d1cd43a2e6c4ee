//! Calibration of a camera from image files: files in, a camera and `camera.toml` out.
//!
//! Every image is decoded and searched in parallel, then [`camera_calibration`] does the rest. The result is the same
//! for any number of threads: each image is alone, and results keep the order of the files.
//!
//! In `camera.toml` values are written with the fewest digits that read back as the same number, and beside each stands
//! its standard deviation; a coefficient without one was held at zero. The file says nothing of date or machine, so
//! equal images give equal bytes.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use camera_calibration::{BoardSize, SearchedImage, calibrate_boards};
use mono_geometry::Camera;
use rayon::prelude::*;

use crate::sequence::{
    CameraFile, CameraFormat, MountFile, SequenceError, calibration_text, list_images, read_grey,
};
pub use camera_calibration::{
    CalibrateError, CalibrationImage, CalibrationRun, CalibrationSettings, Outcome,
};

/// The images behind a list of files and folders; a folder stands for its images in lexical order.
///
/// # Errors
/// [`SequenceError`] when a folder cannot be listed or holds no image.
pub fn image_files(inputs: &[PathBuf]) -> Result<Vec<PathBuf>, SequenceError> {
    let mut files = Vec::new();
    for input in inputs {
        if input.is_dir() {
            files.extend(list_images(input)?);
        } else {
            files.push(input.clone());
        }
    }
    Ok(files)
}

/// Finds the boards and calibrates. `progress` is called once for every image done, from any thread.
///
/// # Errors
/// [`CalibrateError`]: too few boards, or boards that fix no camera.
pub fn calibrate_images(
    files: &[PathBuf],
    settings: &CalibrationSettings,
    progress: &(dyn Fn() + Sync),
) -> Result<CalibrationRun, CalibrateError> {
    let searched = files
        .par_iter()
        .map(|path| {
            let seen = search(path, settings.board);
            progress();
            seen
        })
        .collect();
    calibrate_boards(searched, settings)
}

/// One image, searched when it can be read.
fn search(path: &Path, board: BoardSize) -> SearchedImage {
    let name = path.file_name().unwrap_or(path.as_os_str());
    let name = name.to_string_lossy().into_owned();
    match read_grey(path) {
        Err(error) => {
            // The name says already which file it is.
            let text = error.to_string();
            let prefix = format!("{}: ", path.display());
            let reason = text.strip_prefix(&prefix).unwrap_or(&text);
            SearchedImage::unreadable(name, reason.to_string())
        }
        Ok(image) => SearchedImage::search(name, image.view(), board),
    }
}

/// Parameters in pixels.
const PINHOLE: [&str; 4] = ["fx", "fy", "cx", "cy"];

/// The file's text.
///
/// # Errors
/// [`SequenceError`] for a lens that the format cannot hold: none at present.
pub fn camera_toml(run: &CalibrationRun) -> Result<String, SequenceError> {
    let calibration = &run.calibration;
    let plain = calibration_text(&camera_file(&calibration.camera), CameraFormat::Toml)?;
    let mut text = String::new();
    let _ = write!(
        text,
        "# Calibrated by mono-slam {} from {} of {} images of a {} checkerboard with squares of {} m.\n\
         # Reprojection error: RMS {:.4} px, mean {:.4} px, over {} corners.\n\
         # After each value its standard deviation, scaled by these errors.\n",
        env!("CARGO_PKG_VERSION"),
        calibration.views.len(),
        run.images.len(),
        run.settings.board,
        run.settings.square_m,
        calibration.rms_px,
        calibration.mean_error_px,
        calibration
            .views
            .iter()
            .map(|view| view.residuals_px.len())
            .sum::<usize>()
    );
    for warning in run.warnings() {
        let _ = writeln!(text, "# Warning: {warning}");
    }
    text.push('\n');
    for line in plain.lines() {
        let name = line.split(" = ").next().unwrap_or_default();
        match calibration.parameter(name) {
            Some(parameter) => {
                let unit = if PINHOLE.contains(&name) { " px" } else { "" };
                let _ = writeln!(text, "{line}   # +- {}{unit}", sigma(parameter.sigma));
            }
            None => {
                text.push_str(line);
                text.push('\n');
            }
        }
    }
    Ok(text)
}

/// The camera as its file holds it, at the default place on the body.
fn camera_file(camera: &Camera) -> CameraFile {
    let pinhole = camera.pinhole();
    CameraFile {
        // Sizes came from images, whose sides fit.
        width: pinhole.width as u32,
        height: pinhole.height as u32,
        fx: pinhole.fx,
        fy: pinhole.fy,
        cx: pinhole.cx,
        cy: pinhole.cy,
        distortion: *camera.distortion(),
        mount: MountFile::default(),
    }
}

/// Two significant digits.
fn sigma(value: f64) -> String {
    if !value.is_finite() {
        return "unknown: the images do not fix it".into();
    }
    let decimals = if value > 0.0 {
        (1.0 - value.log10().floor()).clamp(0.0, 12.0) as usize
    } else {
        0
    };
    format!("{value:.decimals$}")
}
