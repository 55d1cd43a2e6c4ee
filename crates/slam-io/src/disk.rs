//! The form in JSON of values whose types belong to other crates.

use serde::{Deserialize, Serialize};
use slam_pipeline::record::{KeypointFate, PlanarPose};

/// A planar pose: metres, metres, radians.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Pose {
    x: f64,
    y: f64,
    phi: f64,
}

impl From<PlanarPose> for Pose {
    fn from(PlanarPose { x, y, phi }: PlanarPose) -> Self {
        Pose { x, y, phi }
    }
}

impl From<Pose> for PlanarPose {
    fn from(Pose { x, y, phi }: Pose) -> Self {
        PlanarPose { x, y, phi }
    }
}

/// A field that holds a planar pose.
pub(crate) mod planar_pose {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use slam_pipeline::record::PlanarPose;

    use super::Pose;

    pub(crate) fn serialize<S: Serializer>(
        pose: &PlanarPose,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        Pose::from(*pose).serialize(serializer)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<PlanarPose, D::Error> {
        Pose::deserialize(deserializer).map(PlanarPose::from)
    }
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
