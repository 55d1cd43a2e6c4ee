//! Files of a monocular SLAM run: sequences and camera calibrations in, trajectories, maps and
//! tables out.
//!
//! [`Sequence::open`] reads and checks a sequence folder, [`write_run`] writes every result of a run
//! and [`read_run`] reads it back; [`read_calibration`] and [`calibration_text`] convert between
//! `camera.toml`, Kalibr, OpenCV, ROS and others; [`read_tum`] reads trajectories; [`configuration`] is the
//! TOML form of [`slam_pipeline::config::Config`].
//!
//! Use it to feed [`slam_pipeline::Slam`] from disk and to keep what it
//! found. A robot that holds its images in memory and sends its poses elsewhere needs none of it.
//!
//! ```
//! use slam_io::{CalibrationRequest, CameraFormat, calibration_text, read_calibration};
//!
//! let folder = std::env::temp_dir().join(format!("slam-io-front-page-{}", std::process::id()));
//! std::fs::create_dir_all(&folder)?;
//! let kalibr = folder.join("camchain.yaml");
//! std::fs::write(&kalibr, "cam0:\n  camera_model: pinhole\n  intrinsics: [458.6, 457.3, 367.2, 248.4]\n  \
//!     distortion_model: none\n  distortion_coeffs: []\n  resolution: [752, 480]\n")?;
//! // Recognised by its contents, written as the `camera.toml` of a sequence folder.
//! let camera = read_calibration(&kalibr, &CalibrationRequest::default())?.camera;
//! assert_eq!((camera.width, camera.fx), (752, 458.6));
//! assert!(calibration_text(&camera, CameraFormat::Toml)?.contains("fx = 458.6"));
//! # std::fs::remove_dir_all(&folder)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A fault of the input is one sentence with the file, the line, what was expected and what was
//! found. Results appear whole or not at all.
//!
//! The three types to know are [`Sequence`] (a checked folder), [`CameraFile`] (a calibration,
//! whoever wrote it) and [`RunRecord`] (everything that a finished run knows).

mod calibration;
mod camera;
pub mod configuration;
mod considered;
mod disk;
mod error;
mod figures;
mod images;
mod output;
mod record;
mod sequence;
mod snapshot;
mod text;
mod trajectory;
mod tum;
mod warning;

pub use calibration::{calibrated_camera, camera_toml};
pub use camera::{
    CalibrationRequest, CameraFile, CameraFormat, FoundCalibration, MountFile, SigmaFile,
    calibration_text, read_calibration,
};
pub use error::SequenceError;
pub use figures::{PathFigures, RunFigures, run_figures, uncertainty_m};
pub use images::{GreyImage, Images, image_files, read_grey};
pub use output::{
    Checkpoint, OutputError, RunIdentity, check_output_file, check_output_folder, covariance_csv,
    map_checksum, read_checkpoint, read_known_map, read_map, read_run, remove_checkpoint, tum_text,
    write_checkpoint, write_file, write_files, write_map, write_run,
};
pub use record::{
    FrameRecord, LearnedValue, RunRecord, RunScale, SmootherRecord, StageTimes, TrackRow,
};
pub use sequence::{
    Odometry, OdometryChoice, OdometryRow, OdometrySource, OpenOptions, Part, Sequence,
    SequenceFormat, Survey, odometry_csv, read_run_inputs,
};
pub use snapshot::{DrawnKeypoint, FrameSnapshot};
pub use text::read_text;
pub use trajectory::{Trajectory, read_trajectory};
pub use tum::read_tum;
pub use warning::Warning;

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
