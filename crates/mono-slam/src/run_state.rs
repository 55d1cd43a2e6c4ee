//! That which a run collects beside the state of the filter, and its form in bytes.

use mono_geometry::Se2;
use serde::{Deserialize, Serialize};
use slam_batch::Recording;
use slam_io::{FrameRecord, FrameSnapshot, Sequence, StageTimes};
use slam_pipeline::{FrameReport, OdometryInterval, Slam};

use crate::pairs::PairCollector;
use crate::repeated::Repeated;
use crate::run_error::RunError;

/// Collected frame by frame, for the results.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Collected {
    /// For the batch.
    pub(crate) recording: Recording,
    /// For the question whether odometry and images fit.
    pub(crate) pairs: PairCollector,
    /// For the question whether the camera delivers new images.
    pub(crate) repeated: Repeated,
    /// Rows of `frames.csv`.
    #[serde(with = "stored_frames")]
    pub(crate) frames: Vec<FrameRecord>,
    /// For the picture strip.
    pub(crate) snapshots: Vec<FrameSnapshot>,
    /// Motions expected in place of odometry.
    pub(crate) predictions: Vec<OdometryInterval>,
    /// Where the wheels alone say that the robot is.
    pub(crate) wheels: Se2,
    /// The same at every frame.
    pub(crate) dead_reckoning: Vec<Se2>,
    /// Whether the run began in a map.
    pub(crate) in_map: bool,
    /// Wall time so far, seconds.
    pub(crate) wall_s: f64,
}

impl Collected {
    /// Nothing yet, in a run of `frames` frames.
    pub(crate) fn new(frames: usize) -> Self {
        Self {
            recording: Recording::default(),
            pairs: PairCollector::new(frames),
            repeated: Repeated::default(),
            frames: Vec::with_capacity(frames),
            snapshots: Vec::new(),
            predictions: Vec::new(),
            wheels: Se2::identity(),
            dead_reckoning: Vec::with_capacity(frames),
            in_map: false,
            wall_s: 0.0,
        }
    }

    /// The bytes of it and of the filter's state.
    pub(crate) fn to_bytes(&self, slam: &[u8]) -> Result<Vec<u8>, RunError> {
        postcard::to_allocvec(&(self, slam)).map_err(|e| RunError::State(e.to_string()))
    }

    /// The parts that [`Self::to_bytes`] stored.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Result<(Self, &[u8]), RunError> {
        postcard::from_bytes(bytes).map_err(|e| RunError::State(e.to_string()))
    }

    /// Refuses what no run of `sequence` up to the frame of `slam` collects.
    pub(crate) fn check(&self, slam: &Slam, sequence: &Sequence) -> Result<(), RunError> {
        let frames = self.frames.len();
        let holds = frames == slam.frames()
            && frames <= sequence.images.len()
            && frames == self.recording.frames()
            && self.recording.is_whole()
            && self.pairs.is_whole()
            && self.repeated.is_within(frames)
            && self.dead_reckoning.len().max(self.predictions.len()) <= frames
            && self.frames.iter().enumerate().all(|(i, f)| f.index == i)
            && self.snapshots.iter().all(|s| s.index < frames);
        if holds {
            Ok(())
        } else {
            Err(RunError::State(format!(
                "its parts disagree about the {frames} frames"
            )))
        }
    }
}

/// Frames without the names that their form in JSON has.
mod stored_frames {
    use super::{Deserialize, FrameRecord, FrameReport, Serialize, StageTimes};
    use serde::{Deserializer, Serializer};

    #[derive(Serialize)]
    struct Borrowed<'a> {
        index: usize,
        time_s: f64,
        keypoints: usize,
        report: &'a FrameReport,
        times: &'a StageTimes,
    }

    #[derive(Deserialize)]
    struct Owned {
        index: usize,
        time_s: f64,
        keypoints: usize,
        report: FrameReport,
        times: StageTimes,
    }

    pub(super) fn serialize<S: Serializer>(
        frames: &[FrameRecord],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(frames.iter().map(|frame| Borrowed {
            index: frame.index,
            time_s: frame.time_s,
            keypoints: frame.keypoints,
            report: &frame.report,
            times: &frame.times,
        }))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<FrameRecord>, D::Error> {
        let frames = Vec::<Owned>::deserialize(deserializer)?;
        Ok(frames
            .into_iter()
            .map(|frame| FrameRecord {
                index: frame.index,
                time_s: frame.time_s,
                keypoints: frame.keypoints,
                report: frame.report,
                times: frame.times,
            })
            .collect())
    }
}
