//! The form in JSON of values whose types belong to other crates.

use mono_geometry::Se2;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};
use slam_pipeline::{FrameReport, KeypointFate, KeypointReport, PoseEstimate, Tracking};

/// A planar pose: metres, metres, radians.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Pose {
    x: f64,
    y: f64,
    phi: f64,
}

impl From<Se2> for Pose {
    fn from(Se2 { x, y, phi }: Se2) -> Self {
        Pose { x, y, phi }
    }
}

impl From<Pose> for Se2 {
    fn from(Pose { x, y, phi }: Pose) -> Self {
        Se2 { x, y, phi }
    }
}

/// A field that holds a planar pose.
mod planar_pose {
    use mono_geometry::Se2;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use super::Pose;

    pub(super) fn serialize<S: Serializer>(pose: &Se2, serializer: S) -> Result<S::Ok, S::Error> {
        Pose::from(*pose).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Se2, D::Error> {
        Pose::deserialize(deserializer).map(Se2::from)
    }
}

/// A body pose and its covariance.
#[derive(Serialize, Deserialize)]
#[serde(remote = "PoseEstimate")]
struct Estimate {
    #[serde(with = "planar_pose")]
    pose: Se2,
    covariance: Matrix3<f64>,
}

/// The report of a frame without its keypoints.
#[derive(Serialize, Deserialize)]
#[serde(remote = "FrameReport")]
pub(crate) struct Report {
    #[serde(flatten, with = "Estimate")]
    estimate: PoseEstimate,
    keyframe: bool,
    matches: usize,
    outliers: usize,
    new_landmarks: usize,
    landmarks: usize,
    n_eff: f64,
    unique_ancestors: usize,
    resampled: bool,
    es_acceptance: Option<f64>,
    nis: Option<f64>,
    /// Absent in files of earlier versions.
    #[serde(default)]
    odometry_doubted: bool,
    #[serde(default, with = "State")]
    tracking: Tracking,
    #[serde(default)]
    revisit: bool,
    #[serde(skip)]
    keypoints: Vec<KeypointReport>,
    notes: Vec<String>,
}

/// The fate of a keypoint by its name.
#[derive(Serialize, Deserialize)]
#[serde(remote = "KeypointFate")]
pub(crate) enum Fate {
    /// Matched and used.
    Matched,
    /// Matched and rejected.
    Outlier,
    /// Started a landmark.
    New,
    /// None of these.
    Unused,
}

/// Whether the system knows where it is, by its name.
#[derive(Serialize, Deserialize)]
#[serde(remote = "Tracking", rename_all = "lowercase")]
pub(crate) enum State {
    /// The map is followed.
    Tracking,
    /// Nothing of the map is seen where it is expected.
    Lost,
    /// Found again with this frame.
    Relocalised,
}
