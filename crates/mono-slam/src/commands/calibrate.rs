//! `mono-slam calibrate`: a camera from images of a checkerboard.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Duration;

use camera_calibration::{BoardSize, CalibrationRun, CalibrationSettings};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use mono_geometry::calibration::LensModel;
use mono_slam::calibrate::calibrate_files;
use slam_io::{camera_toml, image_files, read_grey, write_file};
use slam_report::render_calibration_html;

use super::threshold::metres;
use crate::failure::{Failure, print};

/// Arguments of `mono-slam calibrate`.
#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// PNG or JPEG images, or folders of them
    #[arg(value_name = "IMAGES", required = true)]
    images: Vec<PathBuf>,
    /// Inner corners of the board: columns x rows
    #[arg(long, value_name = "9x6")]
    board: BoardSize,
    /// Side of a square in metres
    #[arg(long, value_name = "METRES", value_parser = metres)]
    square: f64,
    /// File for the camera
    #[arg(long, value_name = "FILE.toml")]
    out: PathBuf,
    /// Lens model
    #[arg(long, default_value = "radtan")]
    model: Model,
    /// Page with the reprojection errors [default: as --out, ending .html]
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Model {
    /// No lens
    Pinhole,
    /// k1 k2 p1 p2 k3: ordinary and wide lenses
    Radtan,
    /// k1 k2 p1 p2: long lenses and few images, where k3 would only follow the noise
    Radtan4,
    /// k1 k2 p1 p2 k3 k4 k5 k6: very wide lenses
    Rational,
    /// k1 k2 k3 k4: fisheyes
    KannalaBrandt,
}

impl From<Model> for LensModel {
    fn from(model: Model) -> LensModel {
        match model {
            Model::Pinhole => LensModel::Pinhole,
            Model::Radtan => LensModel::RadtanK3,
            Model::Radtan4 => LensModel::Radtan,
            Model::Rational => LensModel::Rational,
            Model::KannalaBrandt => LensModel::KannalaBrandt,
        }
    }
}

/// Finds the boards, calibrates, writes camera and page, prints what was found.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let files = image_files(&arguments.images)?;
    let settings = CalibrationSettings {
        board: arguments.board,
        square_m: arguments.square,
        model: arguments.model.into(),
    };
    let bar = progress_bar(files.len());
    let outcome = calibrate_files(&files, &settings, &|| bar.inc(1));
    bar.finish_and_clear();
    let run = outcome?;
    let report = arguments
        .report
        .clone()
        .unwrap_or_else(|| arguments.out.with_extension("html"));
    if report == arguments.out {
        return Err(Failure::input(format!(
            "--report and --out are the same file: {}",
            report.display()
        )));
    }
    let page = render_calibration_html(&run, &|image| read_grey(&files[image]).ok());
    write_file(&arguments.out, camera_toml(&run)?.as_bytes())?;
    write_file(&report, page.as_bytes())?;
    print(&summary(&run, &files))
}

fn summary(run: &CalibrationRun, files: &[PathBuf]) -> String {
    let calibration = &run.calibration;
    let mut text = format!(
        "{} boards in {} images of {}x{} pixels\n",
        calibration.views.len(),
        run.images.len(),
        run.width,
        run.height
    );
    for (image, path) in run.images.iter().zip(files) {
        if let Some(reason) = image.reason() {
            let _ = writeln!(text, "not used: {}: {reason}", path.display());
        }
    }
    let _ = writeln!(
        text,
        "reprojection error: RMS {:.4} px, mean {:.4} px",
        calibration.rms_px, calibration.mean_error_px
    );
    for parameter in &calibration.parameters {
        let _ = writeln!(
            text,
            "{:<3} {:>14.6} +- {:.6}",
            parameter.name, parameter.value, parameter.sigma
        );
    }
    for warning in run.warnings() {
        let _ = writeln!(text, "warning: {warning}");
    }
    text
}

/// Invisible unless standard error is a terminal.
fn progress_bar(images: usize) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(images as u64), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} images") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
