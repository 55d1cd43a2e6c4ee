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
//! use slam_pipeline::slam::Slam;
//!
//! let pinhole = Pinhole { width: 320, height: 240, fx: 368.8, fy: 369.9, cx: 159.7, cy: 121.5 };
//! let camera = Camera::new(pinhole, Distortion::None)?;
//! let mount = Mount::forward().body_from_camera;
//! let mut config = Config::default();
//! config.filter.particles = 100;
//! let slam = Slam::new(camera, mount.rotation.matrix(), &mount.translation, &config.check()?)?;
//! assert!(slam.landmarks().is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The three types to know are [`slam::Slam`] (the system), [`slam::FrameInput`] (one frame) and
//! [`config::Config`] (every setting). Reading order: [`slam`] (the frame loop), [`filter`] (the
//! estimator), [`frontend`] (keypoints to landmarks).

pub mod config;
mod features;
pub mod filter;
pub mod frontend;
pub mod odometry;
pub mod record;
pub mod slam;
pub mod stopwatch;

pub use features::detector_of;

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
