#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`Slam`] is the system, [`FrameReport`] its answer to one frame and [`config::Config`] every setting. Reading order of the
//! source: `slam` (the frame loop), `filter` (the estimator), `frontend` (keypoints to landmarks), `method` (where the three
//! filters differ).

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
pub use features::{detector_of, keypoint_sigma_px};
pub use known_map::{KnownErrors, KnownKeyframe, KnownLandmark, KnownMap, MapUse};
pub use odometry::{Control, Odometer, OdometryInterval};
pub use rig::Rig;
pub use slam::{
    FrameInput, FrameReport, KeypointFate, KeypointReport, MapLandmark, PoseEstimate, Slam,
    SlamError, Stage, StageObserver, Tracking,
};
