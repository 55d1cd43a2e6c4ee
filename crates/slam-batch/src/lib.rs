#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`Problem`] is what was measured and believed, [`solve()`] makes a [`Solution`] of it, and [`Recording`] goes from the reports of
//! a run to a problem and back. It looks back over the whole drive, so it is no substitute for the filter while driving; [`filter_limit()`] is what a filter could
//! have known.

mod constants;
mod error;
mod filter_limit;
mod fold;
mod landmark;
mod motion;
mod pixel;
mod problem;
mod process_noise;
mod recording;
mod solution;
mod solve;
mod state;
mod system;

pub use constants::{Constant, Constants};
pub use error::BatchError;
pub use filter_limit::filter_limit;
pub use nalgebra;
pub use problem::{Keyframe, Model, Problem, Sighting, Track};
pub use process_noise::NoiseFactors;
pub use recording::Recording;
pub use solution::{Attitude, BatchLandmark, Fit, LearnedConstant, Solution};
pub use solve::solve;
