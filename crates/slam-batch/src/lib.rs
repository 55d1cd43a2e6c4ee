//! The batch maximum a posteriori solution of a drive: all poses, landmarks and constants of the robot at once, given
//! the associations that a run of `slam-pipeline` made.
//!
//! Use it after a run: as its smoother, as the limit that a filter is compared with, or to learn constants of the robot
//! and its camera. It looks back over the whole drive, so it is no substitute for the filter while driving, and it
//! believes the associations it is given.
//!
//! ```
//! use mono_geometry::{Camera, Distortion, Mount, Pinhole, Se2};
//! use slam_batch::{Keyframe, Model, Problem, Sighting, Track, solve};
//! use slam_pipeline::config::Config;
//! use slam_pipeline::{OdometryInterval, Rig};
//! use nalgebra::Vector3;
//!
//! let pinhole = Pinhole { width: 640, height: 480, fx: 400.0, fy: 400.0, cx: 320.0, cy: 240.0 };
//! let rig = Rig { camera: Camera::new(pinhole, Distortion::None)?, mount: Mount::forward() };
//! // Three keyframes, 0.5 m apart by the odometry.
//! let row = OdometryInterval { duration_s: 1.0, v_mps: 0.5, omega_radps: 0.0 };
//! let keyframes = (0..3)
//!     .map(|k| Keyframe {
//!         start: Se2::new(0.5 * f64::from(k), 0.0, 0.0),
//!         motion: (k > 0).then(|| vec![row]),
//!     })
//!     .collect();
//! // Landmarks ahead, seen from places that the wheels tell a little wrong.
//! let truth = [0.0, 0.51, 0.99];
//! let tracks = (0..20_u32)
//!     .map(|landmark| {
//!         let i = f64::from(landmark);
//!         let point = Vector3::new(4.0 + (2.0 * i).sin(), (3.0 * i).sin(), (5.0 * i).cos());
//!         let seen = |(keyframe, x): (usize, &f64)| {
//!             let q = Vector3::new(-point.y, -point.z, point.x - x);
//!             Sighting { keyframe, pixel: rig.camera.project(&q).expect("in front") }
//!         };
//!         Track { landmark, sightings: truth.iter().enumerate().map(seen).collect() }
//!     })
//!     .collect();
//! let mut config = Config::default();
//! config.odometry.forward_per_sqrt_m = 0.03;
//! let model = Model::of(&config.check()?);
//! let solution = solve(&Problem { rig, keyframes, tracks, model })?;
//! assert!(solution.converged);
//! // The wheels tell the length of the way, the images its middle.
//! let middle = solution.poses[1].pose.x / solution.poses[2].pose.x;
//! assert!((middle - 0.51 / 0.99).abs() < 2e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! The three types to know are [`Problem`] (what was measured and believed), [`Solution`] and [`Recording`] (from the
//! reports of a run to a problem and back).
//!
//! Reading order of the source: `problem`, `fold` and `motion` (the odometry), `pixel` and `landmark` (the images),
//! `system` (normal equations), `solve`, `solution`, `recording`.

mod constants;
mod error;
mod fold;
mod landmark;
mod motion;
mod pixel;
mod problem;
mod recording;
mod solution;
mod solve;
mod state;
mod system;

pub use constants::{Constant, Constants};
pub use error::BatchError;
pub use problem::{Keyframe, Model, Problem, Sighting, Track};
pub use recording::Recording;
pub use solution::{Attitude, BatchLandmark, Fit, LearnedConstant, Solution};
pub use solve::solve;

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
