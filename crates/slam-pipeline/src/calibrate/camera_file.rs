//! `camera.toml` of a calibration: the values, and beside each its standard deviation.
//!
//! Values are written with the fewest digits that read back as the same number; the file says nothing of date or machine,
//! so equal images give equal bytes. Coefficients that were held at zero are left out where the format allows.

use std::fmt::Write as _;

use mono_geometry::Distortion;

use super::CalibrationRun;
use crate::report::plain_warning;

/// The file's text.
pub fn camera_toml(run: &CalibrationRun) -> String {
    let calibration = &run.calibration;
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
    for warning in &calibration.warnings {
        let _ = writeln!(text, "# Warning: {}", plain_warning(run, warning));
    }
    let _ = writeln!(
        text,
        "\nwidth = {}\nheight = {}\nmodel = \"pinhole\"   # pixel (0,0) is the centre of the top-left pixel",
        run.width, run.height
    );
    let (pinhole, lens) = calibration.parameters.split_at(4);
    for parameter in pinhole {
        let _ = writeln!(
            text,
            "{} = {}   # +- {} px",
            parameter.name,
            parameter.value,
            sigma(parameter.sigma)
        );
    }
    let model = match calibration.camera.distortion() {
        Distortion::None => return text,
        Distortion::Radtan { .. } => "radtan",
        Distortion::Rational { .. } => "rational",
        Distortion::KannalaBrandt { .. } => "kannala-brandt",
    };
    let _ = writeln!(text, "\n[distortion]\nmodel = \"{model}\"");
    for parameter in lens {
        let _ = writeln!(
            text,
            "{} = {}   # +- {}",
            parameter.name,
            parameter.value,
            sigma(parameter.sigma)
        );
    }
    text
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
