//! A finished run as plain values: the reports of the frame loop, frame by frame, and the facts of the run.
//!
//! The program fills a [`RunRecord`]; [`write_run`](crate::write_run) writes it and the report page draws it. Times in
//! these values are measured by the caller of the frame loop and never feed back into the estimate.

use mono_geometry::Se2;
use serde::{Deserialize, Serialize};
use slam_pipeline::{FrameReport, KeypointFate, MapLandmark};

use crate::disk;

/// Wall time of one frame, stage by stage, in milliseconds.
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
    /// The whole frame.
    pub total_ms: f64,
}

/// One keypoint as the report draws it, in pixels of the raw image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DrawnKeypoint {
    /// Column in pixels.
    pub x: f32,
    /// Row in pixels.
    pub y: f32,
    /// Scale in pixels.
    pub sigma: f32,
    /// Its fate.
    #[serde(with = "disk::Fate")]
    pub fate: KeypointFate,
    /// Where the matched landmark was predicted, pixels; `None` when unmatched.
    pub predicted: Option<[f32; 2]>,
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

/// A frame kept for the picture strip of the report.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameSnapshot {
    /// Index in the sequence.
    pub index: usize,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Grey pixels, row by row.
    pub pixels: Vec<u8>,
    /// Its keypoints.
    pub keypoints: Vec<DrawnKeypoint>,
}

/// Everything a finished run knows.
#[derive(Debug, Clone, PartialEq)]
pub struct RunRecord {
    /// Name of the sequence (last part of its path).
    pub sequence: String,
    /// One entry a frame, in order.
    pub frames: Vec<FrameRecord>,
    /// Whole path of the best particle: (time in seconds, body pose).
    pub smoothed: Vec<(f64, Se2)>,
    /// Final map of the best particle, in order of id.
    pub landmarks: Vec<MapLandmark>,
    /// Body path of dead reckoning, one pose a frame.
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
