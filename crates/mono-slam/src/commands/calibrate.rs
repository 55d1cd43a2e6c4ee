//! `mono-slam calibrate`: a camera from images of a checkerboard, or refined over recorded runs.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Duration;

use camera_calibration::{BoardSize, CalibrateError, CalibrationRun, CalibrationSettings};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use mono_geometry::calibration::LensModel;
use mono_slam::calibrate::calibrate_files;
use mono_slam::recorded::RecordedRun;
use mono_slam::refine::{Refinement, priors, refine};
use slam_batch::Constant;
use slam_io::{
    CameraFile, CameraFormat, calibrated_camera, calibration_text, camera_toml, check_output_file,
    image_files, read_grey, write_file,
};
use slam_report::render_calibration_html;

use super::batch::{constants_table, prior};
use super::threshold::metres;
use crate::failure::{Failure, distinct, print, remark};

/// Arguments of `mono-slam calibrate`.
#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// PNG or JPEG images, or folders of them
    #[arg(
        value_name = "IMAGES",
        required_unless_present = "from_run",
        requires_all = ["board", "square"]
    )]
    images: Vec<PathBuf>,
    /// Refine the camera of these runs instead: focal length, principal point, k1, yaw of the mount, lever arm and wheel
    /// scale over folders that `mono-slam run` wrote, with the priors of [sigma] in their camera.toml, else 1 %, 2 px, 0.01,
    /// 10 mrad, 2 cm
    #[arg(long, value_name = "RUN", num_args = 1.., conflicts_with = "images")]
    from_run: Vec<PathBuf>,
    /// With --from-run: standard deviation before the drives of a constant, as focal_scale=0.003; 0 fixes it
    #[arg(long, value_name = "NAME=SIGMA", value_parser = prior, requires = "from_run")]
    prior: Vec<(Constant, f64)>,
    /// Inner corners of the board: columns x rows
    #[arg(long, value_name = "9x6")]
    board: Option<BoardSize>,
    /// Side of a square in metres
    #[arg(long, value_name = "METRES", value_parser = metres)]
    square: Option<f64>,
    /// File for the camera
    #[arg(long, value_name = "FILE.toml")]
    out: PathBuf,
    /// Write a calibration, too, whose numbers are too uncertain to be used
    #[arg(long)]
    force: bool,
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
    let (Some(board), Some(square_m)) = (arguments.board, arguments.square) else {
        return refined(arguments);
    };
    let report = arguments
        .report
        .clone()
        .unwrap_or_else(|| arguments.out.with_extension("html"));
    distinct(&[("--out", &arguments.out), ("--report", &report)])?;
    check_output_file(&arguments.out)?;
    check_output_file(&report)?;
    let files = image_files(&arguments.images)?;
    for file in &files {
        distinct(&[("an image", file), ("--out", &arguments.out)])?;
    }
    let settings = CalibrationSettings {
        board,
        square_m,
        model: arguments.model.into(),
    };
    let bar = progress_bar(files.len());
    let outcome = calibrate_files(&files, &settings, &|| bar.inc(1));
    bar.finish_and_clear();
    let run = outcome.map_err(|error| with_hint(&error))?;
    let camera = calibrated_camera(&run.calibration);
    if let Some(reason) = run.unusable().or_else(|| camera.implausible())
        && !arguments.force
    {
        print(&summary(&run, &files))?;
        return Err(Failure::input(format!(
            "the calibration is not usable and not written: {reason}; --force writes it all the same"
        )));
    }
    let page = render_calibration_html(&run, &|image| read_grey(&files[image]).ok());
    write_file(&arguments.out, camera_toml(&run)?.as_bytes())?;
    write_file(&report, page.as_bytes())?;
    for oddity in camera.oddities() {
        remark(&oddity);
    }
    print(&summary(&run, &files))
}

/// The commonest cause of no board at all is the count of squares in place of corners.
fn with_hint(error: &CalibrateError) -> Failure {
    let text = error.to_string();
    let hint = match error {
        CalibrateError::TooFewBoards { .. } if text.contains("corners") => {
            "; --board counts inner corners, a board of 10x7 squares has 9x6"
        }
        _ => "",
    };
    Failure::input(format!("{text}{hint}"))
}

/// Refines over recorded runs, writes the camera, prints it before and after.
fn refined(arguments: &Arguments) -> Result<(), Failure> {
    check_output_file(&arguments.out)?;
    let runs = arguments
        .from_run
        .iter()
        .map(|dir| RecordedRun::open(dir))
        .collect::<Result<Vec<_>, _>>()?;
    let first = runs
        .first()
        .ok_or_else(|| Failure::input("expected images or --from-run, found neither".to_owned()))?;
    let mut priors = priors(first);
    for (constant, sigma) in &arguments.prior {
        priors[*constant] = *sigma;
    }
    let refinement = refine(&runs, &priors)?;
    let text = format!(
        "# Refined by mono-slam {} over {} run(s): {} keyframes, {} sightings.\n{}",
        env!("CARGO_PKG_VERSION"),
        runs.len(),
        refinement.keyframes,
        refinement.sightings,
        calibration_text(&refinement.after, CameraFormat::Toml)?
    );
    write_file(&arguments.out, text.as_bytes())?;
    print(&before_and_after(&refinement))
}

fn before_and_after(refinement: &Refinement) -> String {
    let (before, after) = (&refinement.before, &refinement.after);
    let sigma = &after.sigma;
    let mut text = format!(
        "{} keyframes, {} sightings\n\n{:<12}{:>14}{:>14}{:>12}\n",
        refinement.keyframes, refinement.sightings, "", "before", "after", "sigma"
    );
    let k1 = |camera: &CameraFile| camera.distortion.parameters().first().copied();
    let rows = [
        ("fx (px)", Some(before.fx), Some(after.fx), sigma.fx),
        ("fy (px)", Some(before.fy), Some(after.fy), sigma.fy),
        ("cx (px)", Some(before.cx), Some(after.cx), sigma.cx),
        ("cy (px)", Some(before.cy), Some(after.cy), sigma.cy),
        ("k1", k1(before), k1(after), sigma.k1),
        (
            "lever x (m)",
            Some(before.mount.position_in_body[0]),
            Some(after.mount.position_in_body[0]),
            sigma.lever_x,
        ),
        (
            "lever y (m)",
            Some(before.mount.position_in_body[1]),
            Some(after.mount.position_in_body[1]),
            sigma.lever_y,
        ),
    ];
    for (name, before, after, sigma) in rows {
        if let (Some(before), Some(after), Some(sigma)) = (before, after, sigma) {
            // Writing into a String cannot fail.
            let _ = writeln!(text, "{name:<12}{before:>14.5}{after:>14.5}{sigma:>12.5}");
        }
    }
    text.push_str(&constants_table(&refinement.constants));
    text
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
