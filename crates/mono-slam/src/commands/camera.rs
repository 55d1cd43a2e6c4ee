//! `mono-slam camera`: a calibration from one tool's file format to another's.

use std::path::PathBuf;

use slam_io::{CameraFormat, calibration_text, read_calibration, write_file};

use crate::failure::Failure;

/// Arguments of `mono-slam camera`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "The mount exists in camera.toml only: a file of another tool is read with the camera looking \
    along body x, and T_cam_imu of Kalibr, which starts at an IMU, is not taken for it."
)]
pub(crate) struct Arguments {
    /// Calibration: camera.toml, Kalibr camchain.yaml, OpenCV FileStorage yml or ROS camera_info yaml
    #[arg(value_name = "INPUT")]
    input: PathBuf,
    /// Format of the input [default: recognised by its content]
    #[arg(long, value_enum)]
    from: Option<Format>,
    /// Which camera of a Kalibr file [default: cam0]
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
    /// Format to write
    #[arg(long, value_enum, default_value_t = Format::Toml)]
    to: Format,
    /// File to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Format {
    /// camera.toml of a sequence folder
    Toml,
    /// Kalibr camchain
    Kalibr,
    /// OpenCV FileStorage
    Opencv,
    /// ROS camera_info
    Ros,
}

impl From<Format> for CameraFormat {
    fn from(format: Format) -> Self {
        match format {
            Format::Toml => CameraFormat::Toml,
            Format::Kalibr => CameraFormat::Kalibr,
            Format::Opencv => CameraFormat::OpenCv,
            Format::Ros => CameraFormat::Ros,
        }
    }
}

/// Reads, checks, writes.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let calibration = read_calibration(
        &arguments.input,
        arguments.from.map(Into::into),
        arguments.camera.as_deref(),
    )?;
    // A camera that `run` would refuse is refused here.
    calibration
        .camera_and_mount()
        .map_err(|error| Failure::input(format!("{}: {error}", arguments.input.display())))?;
    let text = calibration_text(&calibration, arguments.to.into())?;
    Ok(write_file(&arguments.out, text.as_bytes())?)
}
