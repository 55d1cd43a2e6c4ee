//! The report of a frame: what the estimator says after each step.

use mono_geometry::Se2;
use nalgebra::{Matrix3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// A body pose with its covariance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseEstimate {
    /// Pose of the body in the world, metres and radians.
    pub pose: Se2,
    /// Covariance over (x, y, phi): m^2, m rad, rad^2.
    pub covariance: Matrix3<f64>,
}

impl PoseEstimate {
    /// The origin, known exactly.
    #[must_use]
    pub fn origin() -> Self {
        Self {
            pose: Se2::identity(),
            covariance: Matrix3::zeros(),
        }
    }
}

/// The use that was made of a keypoint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum KeypointFate {
    /// It was matched to a landmark of the map and used.
    Matched,
    /// It was matched to a landmark and rejected by the consensus.
    Outlier,
    /// It started a new feature.
    New,
    /// It was not used.
    Unused,
}

/// One keypoint of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct KeypointReport {
    /// The use that was made of it.
    pub fate: KeypointFate,
    /// Identity of the landmark it was matched to, or of the feature it started; `None` for an unused keypoint.
    ///
    /// A feature keeps its identity when it becomes a landmark of the map, and no identity is given out twice, so the
    /// sightings of one landmark are those of one identity over the run.
    pub landmark: Option<u32>,
    /// Ideal pixel at which its landmark was predicted; `None` without a landmark.
    pub predicted: Option<Vector2<f64>>,
}

/// Whether the system knows where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Tracking {
    /// The landmarks of the map are followed, or there is nothing to follow yet.
    #[default]
    Tracking,
    /// The images show nothing of the map where it is expected: the pose is that of the odometry, its covariance grows.
    Lost,
    /// The robot was found in the map by its looks with this frame; how it came there is not known.
    Relocalised,
}

impl Tracking {
    /// Name as written in tables: `tracking`, `lost` or `relocalised`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Tracking => "tracking",
            Self::Lost => "lost",
            Self::Relocalised => "relocalised",
        }
    }
}

/// The outcome of one frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameReport {
    /// Filtered body pose: the weighted mean of the particles.
    pub estimate: PoseEstimate,
    /// Whether the frame was a filter step; otherwise the pose was refined on top of the last one.
    pub keyframe: bool,
    /// Number of accepted matches.
    pub matches: usize,
    /// Number of rejected matches.
    pub outliers: usize,
    /// Number of landmarks that entered the map.
    pub new_landmarks: usize,
    /// Number of landmarks in the map after the frame.
    pub landmarks: usize,
    /// Effective number of particles before resampling.
    pub n_eff: f64,
    /// Number of distinct origins among the particles.
    pub unique_ancestors: usize,
    /// Whether the step resampled.
    pub resampled: bool,
    /// Share of evolution moves that were accepted; `None` when none was tried.
    pub es_acceptance: Option<f64>,
    /// Mean normalised innovation squared per degree of freedom; `None` without matches.
    pub nis: Option<f64>,
    /// Whether the odometry since the last keyframe was taken for that of slipping wheels, because the matches lay beside it.
    pub odometry_doubted: bool,
    /// Whether the system knows where it is.
    pub tracking: Tracking,
    /// Whether an old place was recognised with this frame and the path since then corrected.
    pub revisit: bool,
    /// One entry a keypoint, in the order of the features.
    pub keypoints: Vec<KeypointReport>,
    /// Remarks on what was unusual; empty for an ordinary frame.
    pub notes: Vec<String>,
}

/// One landmark of the final map.
#[derive(Debug, Clone, PartialEq)]
pub struct MapLandmark {
    /// Identity, stable over the run.
    pub id: u32,
    /// Position in the world, metres.
    pub position: Vector3<f64>,
    /// Covariance of the position, m^2.
    pub covariance: Matrix3<f64>,
    /// Number of keyframes that measured it.
    pub observations: u32,
    /// Descriptor of its last sighting; `None` for a landmark read from a map file without descriptors.
    pub descriptor: Option<Box<[u8; 128]>>,
}

/// A stage of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// Odometry, undistortion, prediction, matching and consensus.
    Association,
    /// Pose proposals, weights and resampling; between keyframes the refinement of the pose.
    Proposal,
    /// Moves of the poses after a resampling.
    Evolution,
    /// Landmark updates, new features and the reported pose.
    Mapping,
}

/// An observer that is told when a stage of a frame begins.
///
/// Stage times are measured here, outside the estimator: the crate reads no clock. Any `FnMut(Stage)` is an observer.
pub trait StageObserver {
    /// Called when `stage` begins and the stage before it has ended.
    fn begin(&mut self, stage: Stage);
}

impl<F: FnMut(Stage)> StageObserver for F {
    fn begin(&mut self, stage: Stage) {
        self(stage);
    }
}
