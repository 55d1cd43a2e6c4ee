//! Images that a camera delivers twice: its driver hangs, and the robot drives on.
//!
//! Two pictures of a real camera are never equal to the last bit, because of the noise of its pixels. Equal keypoints are
//! equal images here: the features of an image depend on nothing but its pixels.

use std::hash::{DefaultHasher, Hash as _, Hasher as _};

use mono_geometry::motion::{OdometrySample, held_between};
use serde::{Deserialize, Serialize};
use slam_io::{FrameRecord, Warning};
use vision_sift::Features;

/// Keypoints that tell images apart; those of a blank wall do not.
const TELLING: usize = 20;
/// Metres and radians between two frames from which a robot moves.
const MOVES: f64 = 0.01;

/// The frames whose image is that of the frame before.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Repeated {
    last: Option<u64>,
    frames: Vec<usize>,
}

impl Repeated {
    /// Takes the next frame.
    pub(crate) fn observe(&mut self, index: usize, features: &Features) {
        let seen = (features.keypoints.len() >= TELLING).then(|| {
            let mut hasher = DefaultHasher::new();
            for keypoint in &features.keypoints {
                (keypoint.x.to_bits(), keypoint.y.to_bits()).hash(&mut hasher);
            }
            features.descriptors.hash(&mut hasher);
            hasher.finish()
        });
        if seen.is_some() && seen == self.last {
            self.frames.push(index);
        }
        self.last = seen;
    }

    /// Whether the frames are among the first `count`.
    pub(crate) fn is_within(&self, count: usize) -> bool {
        self.frames.iter().all(|&frame| frame < count)
    }

    /// The word on images that stand still while the odometry drives.
    pub(crate) fn warning(
        &self,
        odometry: &[OdometrySample],
        frames: &[FrameRecord],
    ) -> Option<Warning> {
        let mut driven_m = 0.0;
        let mut moving = self.frames.iter().copied().filter(|&index| {
            let (Some(before), Some(frame)) =
                (frames.get(index.wrapping_sub(1)), frames.get(index))
            else {
                return false;
            };
            let (way_m, turn) = held_between(odometry, before.time_s, frame.time_s)
                .iter()
                .fold((0.0, 0.0), |(way, turn), (row, duration_s)| {
                    (
                        way + (row.v_mps * duration_s).abs(),
                        turn + (row.omega_radps * duration_s).abs(),
                    )
                });
            let moves = way_m > MOVES || turn > MOVES;
            if moves {
                driven_m += way_m;
            }
            moves
        });
        let first = moving.next()?;
        let count = 1 + moving.count();
        let are = if count == 1 { "is" } else { "are" };
        Some(Warning::new(
            "images-repeated",
            format!(
                "{count} of {} images {are} the one before to the last bit, beginning at {:.2} s, while the odometry \
                 drives {driven_m:.2} m: does the camera deliver new ones?",
                frames.len(),
                frames[first].time_s
            ),
        ))
    }
}
