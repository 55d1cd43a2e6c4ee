//! A finished run as plain values: the reports of the frame loop, frame by frame, and the facts of the run.
//!
//! The program fills a [`RunRecord`]; [`write_run`](crate::write_run) writes it and the report page draws it. Times in
//! these values are measured by the caller of the frame loop and never feed back into the estimate.

use mono_geometry::Se2;
use serde::{Deserialize, Serialize};
use slam_pipeline::{FrameReport, KnownMap, MapLandmark};

use crate::disk;
use crate::sequence::OdometryRow;
use crate::snapshot::FrameSnapshot;
use crate::warning::Warning;

/// Wall time of one frame, stage by stage, in milliseconds.
///
/// Images are decoded and searched for features one frame ahead of the filter, on threads that are free.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct StageTimes {
    /// Reading and decoding the image.
    pub decode_ms: f64,
    /// Keypoints and descriptors.
    pub features_ms: f64,
    /// Descriptor matching, gating, consensus.
    pub association_ms: f64,
    /// Pose proposals and importance weights.
    pub proposal_ms: f64,
    /// Resampling and evolution strategy.
    pub evolution_ms: f64,
    /// Landmark updates, new landmarks, removal.
    pub mapping_ms: f64,
    /// Decoding, features and filter step together.
    pub total_ms: f64,
}

/// One row of `frames.csv` and one pose of the trajectory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameRecord {
    /// Index in the sequence, from zero.
    pub index: usize,
    /// Time stamp, seconds.
    pub time_s: f64,
    /// Number of keypoints detected.
    pub keypoints: usize,
    /// The report of the frame loop, without the keypoints; those of some frames are in the [`FrameSnapshot`]s.
    #[serde(flatten, with = "disk::Report")]
    pub report: FrameReport,
    /// Milliseconds of each stage.
    pub times: StageTimes,
}

/// A landmark found in a keyframe: one row of `tracks.csv`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TrackRow {
    /// Index of the frame, a keyframe.
    pub frame: usize,
    /// Identity of the landmark.
    pub landmark: u32,
    /// Column where the keypoint was found, pixels of the raw image.
    pub x_px: f64,
    /// Row where the keypoint was found, pixels of the raw image.
    pub y_px: f64,
    /// Size of the keypoint, standard deviation of its blur, pixels; 0 in files of earlier versions.
    #[serde(default)]
    pub size_px: f64,
}

/// A constant of the robot as the smoother learned it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LearnedValue {
    /// Name with unit.
    pub name: String,
    /// Deviation from nominal.
    pub value: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// Standard deviation before the run.
    pub prior_sigma: f64,
}

/// Where the smoothed path comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SmootherRecord {
    /// `batch`; where there was no batch solution `best particle`, or `filtered` where that path does not end where the filter says.
    pub method: String,
    /// Why it is not the batch solution; `None` where it is.
    pub note: Option<String>,
    /// Iterations of the batch.
    pub iterations: usize,
    /// Sightings of landmarks that the batch used.
    pub sightings: usize,
    /// Constants of the robot that the batch learned.
    pub constants: Vec<LearnedValue>,
}

/// The unit of length of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RunScale {
    /// A metre: odometry measured it.
    #[default]
    Metric,
    /// Anything: the images alone tell no length. Everything that is said in metres is in this unit.
    Arbitrary,
}

/// Everything a finished run knows.
#[derive(Debug, Clone, PartialEq)]
pub struct RunRecord {
    /// Name of the sequence (last part of its path).
    pub sequence: String,
    /// Remarks on inputs that do not fit together: to be read before the result is believed.
    pub warnings: Vec<Warning>,
    /// The unit of length of the poses and landmarks.
    pub scale: RunScale,
    /// One entry a frame, in order.
    pub frames: Vec<FrameRecord>,
    /// Path that looks back over the whole run: (time in seconds, body pose).
    pub smoothed: Vec<(f64, Se2)>,
    /// Where the smoothed path comes from; `None` in runs of earlier versions.
    pub smoother: Option<SmootherRecord>,
    /// Associations at the keyframes, in order of frame and landmark.
    pub tracks: Vec<TrackRow>,
    /// Final map of the best particle, in order of id.
    pub landmarks: Vec<MapLandmark>,
    /// The same map as a later run can begin with it; `None` where the run made none.
    pub known_map: Option<KnownMap>,
    /// Motions that the run expected in place of odometry, a row a frame but the last; empty where there was odometry.
    /// [`read_run`](crate::read_run) does not bring them back: they are the `odometry.csv` beside the results.
    pub predicted: Vec<OdometryRow>,
    /// Body path of dead reckoning, one pose a frame; empty where there was no odometry.
    pub dead_reckoning: Vec<Se2>,
    /// Reference body path where the sequence has one: (time in seconds, pose).
    pub reference: Option<Vec<(f64, Se2)>>,
    /// Frames kept for pictures.
    pub snapshots: Vec<FrameSnapshot>,
    /// Effective configuration as TOML text.
    pub configuration: String,
    /// Seed of the run.
    pub seed: u64,
    /// Number of particles.
    pub particles: usize,
    /// Method: `exact`, `paper` or `conventional`.
    pub method: String,
    /// Wall time of the whole run in seconds.
    pub wall_s: f64,
}
