//! A recording: what a run leaves for a batch, collected frame by frame.
//!
//! The keyframes of the run become the poses of the batch, the landmarks' identities in its reports become tracks, the
//! odometry between is kept row by row. Frames between keyframes are put back at the end: each keeps its motion since
//! its keyframe, and what the batch changed about the motion to the next keyframe is spread over them.

use std::collections::BTreeMap;

use mono_geometry::Se2;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use slam_pipeline::{FrameReport, KeypointFate, OdometryInterval, PoseEstimate, Rig};
use vision_sift::Features;

use crate::problem::{Keyframe, Model, Problem, Sighting, Track};
use crate::solution::Solution;

/// One frame of a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Frame {
    /// Filtered body pose.
    filtered: Se2,
    /// Index of the keyframe at or before it.
    keyframe: usize,
    /// Odometry since the frame before.
    odometry: Vec<OdometryInterval>,
}

/// Sightings of a run by landmark, odometry and filtered poses by frame.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Recording {
    frames: Vec<Frame>,
    /// Frame of each keyframe.
    keyframes: Vec<usize>,
    tracks: BTreeMap<u32, Vec<Sighting>>,
}

impl Recording {
    /// Adds a frame as the frame loop reported it, with the features it was given and the odometry since the last
    /// frame.
    pub fn push(
        &mut self,
        features: &Features,
        report: &FrameReport,
        odometry: &[OdometryInterval],
    ) {
        let seen = features
            .keypoints
            .iter()
            .zip(&report.keypoints)
            .filter(|(_, r)| matches!(r.fate, KeypointFate::Matched | KeypointFate::New))
            .filter_map(|(k, r)| {
                let pixel = Vector2::new(f64::from(k.x), f64::from(k.y));
                Some((r.landmark?, pixel, f64::from(k.sigma)))
            });
        self.push_frame(report.estimate.pose, report.keyframe, odometry, seen);
    }

    /// Adds a frame by its parts; the sightings (landmark, raw pixel, size of the keypoint) count at keyframes only. The first frame is always a
    /// keyframe, and a second sighting of a landmark in one frame is ignored.
    pub fn push_frame(
        &mut self,
        filtered: Se2,
        keyframe: bool,
        odometry: &[OdometryInterval],
        seen: impl IntoIterator<Item = (u32, Vector2<f64>, f64)>,
    ) {
        if keyframe || self.keyframes.is_empty() {
            self.keyframes.push(self.frames.len());
            let index = self.keyframes.len() - 1;
            for (landmark, pixel, size_px) in seen {
                let track = self.tracks.entry(landmark).or_default();
                if track.last().is_none_or(|s| s.keyframe < index) {
                    track.push(Sighting {
                        keyframe: index,
                        pixel,
                        size_px,
                    });
                }
            }
        }
        self.frames.push(Frame {
            filtered,
            keyframe: self.keyframes.len() - 1,
            odometry: odometry.to_vec(),
        });
    }

    /// Frames of the keyframes, ascending.
    #[must_use]
    pub fn keyframes(&self) -> &[usize] {
        &self.keyframes
    }

    /// Whether frames, keyframes and sightings refer to one another as [`Self::push`] leaves them: to be asked of a
    /// recording that was read from a file.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        let begins = self.frames.is_empty() == self.keyframes.is_empty()
            && self.keyframes.first().is_none_or(|&first| first == 0);
        let rising = self.keyframes.windows(2).all(|pair| pair[0] < pair[1]);
        let of_frames = self.frames.iter().enumerate().all(|(index, frame)| {
            let keyframe = self.keyframes.get(frame.keyframe);
            let next = self.keyframes.get(frame.keyframe + 1);
            keyframe.is_some_and(|&k| k <= index) && next.is_none_or(|&k| k > index)
        });
        let in_frames = self.keyframes.iter().all(|&k| k < self.frames.len());
        let sighted = self.tracks.values().all(|track| {
            track
                .windows(2)
                .all(|pair| pair[0].keyframe < pair[1].keyframe)
                && track.iter().all(|s| s.keyframe < self.keyframes.len())
        });
        begins && rising && of_frames && in_frames && sighted
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.frames.len()
    }

    /// The filtered poses, one a frame.
    pub fn filtered(&self) -> impl Iterator<Item = Se2> + '_ {
        self.frames.iter().map(|frame| frame.filtered)
    }

    /// Landmarks with their sightings, by identity.
    pub fn tracks(&self) -> impl Iterator<Item = (u32, &[Sighting])> {
        self.tracks.iter().map(|(id, s)| (*id, s.as_slice()))
    }

    /// The batch over this recording. It starts at `path`, one body pose a frame (the best particle's path), or at the
    /// filtered poses where that has another length.
    #[must_use]
    pub fn problem(&self, rig: Rig, model: Model, path: &[Se2]) -> Problem {
        let start = |frame: usize| {
            if path.len() == self.frames.len() {
                path[frame]
            } else {
                self.frames[frame].filtered
            }
        };
        let mut keyframes = Vec::with_capacity(self.keyframes.len());
        for (k, &frame) in self.keyframes.iter().enumerate() {
            keyframes.push(if k == 0 {
                Keyframe {
                    start: start(frame),
                    motion: None,
                }
            } else {
                Keyframe {
                    start: start(frame),
                    motion: Some(
                        self.frames[self.keyframes[k - 1] + 1..=frame]
                            .iter()
                            .flat_map(|f| f.odometry.iter().copied())
                            .collect(),
                    ),
                }
            });
        }
        Problem {
            rig,
            keyframes,
            tracks: self
                .tracks
                .iter()
                .filter(|(_, sightings)| sightings.len() > 1)
                .map(|(landmark, sightings)| Track {
                    landmark: *landmark,
                    sightings: sightings.clone(),
                })
                .collect(),
            model,
        }
    }

    /// The recording as it was before the keyframe after `keyframe`. O(frames + sightings).
    pub(crate) fn until(&self, keyframe: usize) -> Self {
        let end = self.keyframes.get(keyframe + 1);
        let known = |sightings: &[Sighting]| -> Vec<Sighting> {
            let known = sightings.partition_point(|s| s.keyframe <= keyframe);
            sightings[..known].to_vec()
        };
        Self {
            frames: self.frames[..end.copied().unwrap_or(self.frames.len())].to_vec(),
            keyframes: self.keyframes.iter().take(keyframe + 1).copied().collect(),
            tracks: self
                .tracks
                .iter()
                .map(|(landmark, sightings)| (*landmark, known(sightings)))
                .filter(|(_, sightings)| !sightings.is_empty())
                .collect(),
        }
    }

    /// The whole path of a solution of [`Self::problem`], one estimate a frame.
    ///
    /// A frame between keyframes keeps its filtered motion since its keyframe; the difference between the solution's motion
    /// to the next keyframe and the filtered one is added in proportion to the frames that have passed. Its covariance is
    /// interpolated likewise.
    #[must_use]
    pub fn whole_path(&self, solution: &Solution) -> Vec<PoseEstimate> {
        self.frames
            .iter()
            .enumerate()
            .filter_map(|(index, frame)| {
                let anchor = solution.poses.get(frame.keyframe)?;
                let from = self.keyframes[frame.keyframe];
                if index == from {
                    return Some(*anchor);
                }
                let filtered = &self.frames[from].filtered;
                let motion = filtered.between(&frame.filtered);
                let pose = anchor.pose.compose(&motion);
                let Some((next, &until)) = solution
                    .poses
                    .get(frame.keyframe + 1)
                    .zip(self.keyframes.get(frame.keyframe + 1))
                else {
                    return Some(PoseEstimate {
                        pose,
                        covariance: anchor.covariance,
                    });
                };
                let share = (index - from) as f64 / (until - from) as f64;
                let told = filtered.between(&self.frames[until].filtered);
                let found = anchor.pose.between(&next.pose);
                let correction = Se2::exp(&(told.between(&found).log() * share));
                Some(PoseEstimate {
                    pose: pose.compose(&correction),
                    covariance: anchor.covariance * (1.0 - share) + next.covariance * share,
                })
            })
            .collect()
    }
}
