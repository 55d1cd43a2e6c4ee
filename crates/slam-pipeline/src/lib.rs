//! Monocular landmark SLAM for wheeled robots: features and odometry in, metric trajectory, covariance
//! and landmark map out, frame by frame and all of it as values.
//!
//! Use it inside a robot or a program that has its images (or keypoints) and its odometry in
//! memory. For recorded folders, results on disk and a report page use `mono-slam`, which puts
//! files around this crate. Without wheel odometry there is no scale, so use a visual-inertial
//! system instead.
//!
//! ```
//! use mono_geometry::{Camera, Distortion, Mount, Pinhole};
//! use slam_pipeline::config::Config;
//! use slam_pipeline::{Rig, Slam};
//!
//! let pinhole = Pinhole { width: 320, height: 240, fx: 368.8, fy: 369.9, cx: 159.7, cy: 121.5 };
//! let rig = Rig { camera: Camera::new(pinhole, Distortion::None)?, mount: Mount::forward() };
//! let mut config = Config::default();
//! config.filter.particles = 100;
//! let slam = Slam::new(rig, &config.check()?)?;
//! assert!(slam.landmarks().is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The three types to know are [`Slam`] (the system), [`FrameReport`] (its answer to one frame) and
//! [`config::Config`] (every setting). Reading order of the source: `slam` (the frame loop), `filter` (the
//! estimator), `frontend` (keypoints to landmarks), `method` (where the three filters differ).

mod ablation;
pub mod config;
mod features;
mod filter;
mod frontend;
mod known_map;
mod method;
mod odometry;
mod rig;
mod slam;
mod stored;

pub use ablation::Ablation;
pub use features::detector_of;
pub use known_map::{KnownErrors, KnownKeyframe, KnownLandmark, KnownMap, MapUse};
pub use odometry::{Control, Odometer, OdometryInterval};
pub use rig::Rig;
pub use slam::{
    FrameInput, FrameReport, KeypointFate, KeypointReport, MapLandmark, PoseEstimate, Slam,
    SlamError, Stage, StageObserver, Tracking,
};

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
