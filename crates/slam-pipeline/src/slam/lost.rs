//! The state of a robot that sees nothing of the map where it is expected; [`super::recovery`] says what is made of it.

use mono_geometry::Se2;
use serde::{Deserialize, Serialize};

use super::report::PoseEstimate;
use crate::filter::pose::CameraPose;

/// The knowledge of a robot while nothing of the map is seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Lost {
    /// Whether something else than the map was seen, so that odometry cannot be trusted; else the frames were blind.
    pub(super) elsewhere: bool,
    /// Frames with sight that were searched for in vain.
    pub(super) searched: u32,
    /// Seconds since the last keyframe when something else was first seen.
    pub(super) since_s: f64,
    /// Whether the robot maps on.
    pub(super) mapping: bool,
    /// Estimate of a robot that has just woken up in a known map.
    pub(super) awake: Option<PoseEstimate>,
    /// Places that the frames since show equally well, the best one first; each moves on with the odometry.
    pub(super) places: Vec<Hypothesis>,
}

/// A place where a lost robot may stand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Hypothesis {
    /// Pose there at its last frame, in the unit of the reference particle.
    pub(super) pose: CameraPose,
    /// The same of the body, metres.
    pub(super) body: Se2,
    /// Motion since the last keyframe at that frame.
    pub(super) driven: Se2,
    /// Landmarks found there, over all frames.
    pub(super) found: usize,
}
