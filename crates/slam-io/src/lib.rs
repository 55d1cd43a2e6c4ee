#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`Sequence::open`] reads and checks a sequence folder, [`write_run`] writes every result of a run and [`read_run`] reads it
//! back; [`read_calibration`] and [`calibration_text`] convert between `camera.toml`, Kalibr, OpenCV, ROS and others;
//! [`read_tum`] reads trajectories; [`configuration`] is the TOML form of [`slam_pipeline::config::Config`].

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
mod toml_fault;
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
