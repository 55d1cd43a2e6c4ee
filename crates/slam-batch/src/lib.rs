//! The batch maximum a posteriori solution of a drive: all poses, landmarks and constants of the robot at once, given
//! the associations that a run of `slam-pipeline` made.

mod constants;
mod error;
mod fold;
mod landmark;
mod motion;
mod pixel;
mod problem;
mod solution;
mod solve;
mod state;
mod system;

pub use constants::{Constant, Constants};
pub use error::BatchError;
pub use problem::{Keyframe, Model, Problem, Sighting, Track};
pub use solution::{Attitude, BatchLandmark, Fit, LearnedConstant, Solution};
pub use solve::solve;
