//! `camera.toml` of a calibration: the values, and beside each its standard deviation.
//!
//! Values are written with the fewest digits that read back as the same number; the file says nothing of date or
//! machine, so equal images give equal bytes. A coefficient without a standard deviation was held at zero.

use std::fmt::Write as _;

use camera_calibration::CalibrationRun;
use mono_geometry::calibration::Calibration;

use crate::camera::{CameraFile, CameraFormat, MountFile, SigmaFile, calibration_text};
use crate::error::SequenceError;

/// Parameters in pixels.
const PINHOLE: [&str; 4] = ["fx", "fy", "cx", "cy"];

/// The file's text.
///
/// # Errors
/// [`SequenceError`] for a lens that the format cannot hold: none at present.
pub fn camera_toml(run: &CalibrationRun) -> Result<String, SequenceError> {
    let calibration = &run.calibration;
    let plain = calibration_text(&calibrated_camera(calibration), CameraFormat::Toml)?;
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
    let mut values = true;
    for line in plain.lines() {
        values &= line != "[sigma]";
        let name = line.split(" = ").next().unwrap_or_default();
        match calibration.parameter(name).filter(|_| values) {
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

/// The camera of a calibration as its file holds it, at the default place on the body.
pub fn calibrated_camera(calibration: &Calibration) -> CameraFile {
    let camera = &calibration.camera;
    let known = |name: &str| {
        let sigma = calibration.parameter(name)?.sigma;
        sigma.is_finite().then_some(sigma)
    };
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
        sigma: SigmaFile {
            fx: known("fx"),
            fy: known("fy"),
            cx: known("cx"),
            cy: known("cy"),
            k1: known("k1"),
            ..SigmaFile::default()
        },
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
