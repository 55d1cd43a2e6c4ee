#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`run::run_sequence`] runs a recorded sequence with the results of `mono-slam run`; [`calibrate`] makes a camera from image
//! files. The types to know are [`slam_io::Sequence`], [`slam_pipeline::config::Config`] and [`slam_io::RunRecord`].

pub mod calibrate;
mod detection;
pub mod map_camera;
pub mod pairs;
pub mod recorded;
pub mod refine;
mod repeated;
pub mod run;
mod run_error;
mod run_state;
pub mod smooth;
mod stopwatch;
pub mod warnings;
pub mod without_odometry;
