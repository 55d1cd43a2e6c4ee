//! The state of a robot that sees nothing of the map where it is expected; [`super::recovery`] says what is made of it.

use serde::{Deserialize, Serialize};

use super::report::PoseEstimate;

/// The knowledge of a robot while nothing of the map is seen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
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
}
