//! `mono-slam camera`: a calibration from one tool's file format to another's.

use std::path::PathBuf;

use slam_io::{
    CalibrationRequest, CameraFormat, calibration_text, check_output_file, read_calibration,
    write_file,
};

use crate::failure::{Failure, remark};

/// Arguments of `mono-slam camera`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "The mount exists in camera.toml only: a file of another tool is read with the camera looking \
    along body x, and T_cam_imu of Kalibr, which starts at an IMU, is not taken for it."
)]
pub(crate) struct Arguments {
    /// Calibration: camera.toml, or the file of Kalibr, OpenCV (yml, xml, json), ROS (also topic echo), ORB-SLAM, VINS,
    /// COLMAP (txt, bin), EuRoC or KITTI
    #[arg(value_name = "INPUT")]
    input: PathBuf,
    /// Format of the input [default: recognised by its content]
    #[arg(long, value_enum)]
    from: Option<Source>,
    /// Which camera of a file of several: its name or number [default: cam0, or the first]
    #[arg(long, value_name = "NAME")]
    camera: Option<String>,
    /// Image columns, where the file does not say them
    #[arg(long, value_name = "PIXELS", requires = "height")]
    width: Option<u32>,
    /// Image rows, where the file does not say them
    #[arg(long, value_name = "PIXELS", requires = "width")]
    height: Option<u32>,
    /// Format to write
    #[arg(long, value_enum, default_value_t = Format::Toml)]
    to: Format,
    /// File to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Formats that are read.
#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum Source {
    /// camera.toml of a sequence folder
    Toml,
    /// Kalibr camchain
    Kalibr,
    /// OpenCV FileStorage
    Opencv,
    /// ROS camera_info, as a file or as a printed message
    Ros,
    /// Settings of ORB-SLAM 2 or 3
    Orbslam,
    /// camodocal, as VINS uses it
    Vins,
    /// COLMAP cameras.txt or cameras.bin
    Colmap,
    /// EuRoC sensor.yaml
    Euroc,
    /// KITTI calib_cam_to_cam.txt or calib.txt
    Kitti,
}

impl From<Source> for CameraFormat {
    fn from(source: Source) -> Self {
        match source {
            Source::Toml => CameraFormat::Toml,
            Source::Kalibr => CameraFormat::Kalibr,
            Source::Opencv => CameraFormat::OpenCv,
            Source::Ros => CameraFormat::Ros,
            Source::Orbslam => CameraFormat::OrbSlam,
            Source::Vins => CameraFormat::Camodocal,
            Source::Colmap => CameraFormat::Colmap,
            Source::Euroc => CameraFormat::Euroc,
            Source::Kitti => CameraFormat::Kitti,
        }
    }
}

/// Formats that are written.
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

/// Reads, checks, writes; what was assumed or looks odd goes to standard error.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let request = CalibrationRequest {
        format: arguments.from.map(Into::into),
        camera: arguments.camera.clone(),
        size: arguments.width.zip(arguments.height).map(Into::into),
    };
    check_output_file(&arguments.out)?;
    let input = arguments.input.display();
    let found = read_calibration(&arguments.input, &request)?;
    // A camera that `run` would refuse is refused here.
    found
        .camera
        .camera_and_mount()
        .map_err(|error| Failure::input(format!("{input}: {error}")))?;
    let text = calibration_text(&found.camera, arguments.to.into())?;
    write_file(&arguments.out, text.as_bytes())?;
    for note in &found.notes {
        remark(&format!("{input}: {note}"));
    }
    Ok(())
}
