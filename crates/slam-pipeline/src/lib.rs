//! Monocular landmark SLAM for wheeled robots: a sequence folder in, a metric
//! trajectory, a landmark map, a covariance and a report page out.
//!
//! The shortest way is [`sequence::Sequence::open`], [`run::run_sequence`],
//! [`output::write_run`]. Robots that hold images in memory feed
//! [`slam::Slam::step`] frame by frame.
//!
//! Reading order: [`slam`] (the frame loop), [`filter`] (the estimator),
//! [`frontend`] (keypoints to landmarks), then what surrounds them.

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
