//! A frame kept for the pictures of the report: a small picture and its keypoints.
//!
//! The room that all pictures of a run take together is bounded, whatever the length of the run and the size of its
//! images: beyond some hundred frames every n-th one is kept, and the more are kept the smaller they are.

use serde::{Deserialize, Serialize};
use slam_pipeline::KeypointFate;

use crate::images::GreyImage;

/// Frames kept of a run at most.
const MOST_SNAPSHOTS: usize = 240;
/// Bytes of all pictures together, without their headers.
const PICTURE_BYTES: usize = 220_000;
/// Bytes of one picture at most, which few frames would leave it.
const MOST_PICTURE_BYTES: usize = 12_000;

/// One keypoint as the report draws it, in pixels of the raw image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(into = "Row", from = "Row")]
pub struct DrawnKeypoint {
    /// Column in pixels.
    pub x: f32,
    /// Row in pixels.
    pub y: f32,
    /// Scale in pixels.
    pub sigma: f32,
    /// Its fate.
    pub fate: KeypointFate,
    /// Where the matched landmark was predicted, pixels; `None` when unmatched.
    pub predicted: Option<[f32; 2]>,
}

/// A frame kept for the pictures of the report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameSnapshot {
    /// Index in the sequence.
    pub index: usize,
    /// Width of the raw image in pixels.
    pub width: usize,
    /// Height of the raw image in pixels.
    pub height: usize,
    /// The image made small: a grey JPEG file of the same proportions. Empty when there is no picture.
    pub jpeg: Vec<u8>,
    /// Its keypoints.
    pub keypoints: Vec<DrawnKeypoint>,
}

impl FrameSnapshot {
    /// Whether a frame of a run of `frames` frames is kept.
    #[must_use]
    pub fn is_kept(index: usize, frames: usize) -> bool {
        index.is_multiple_of(stride(frames))
    }

    /// Frame `index` of a run of `frames` frames, without keypoints.
    #[must_use]
    pub fn of_image(index: usize, frames: usize, image: &GreyImage) -> Self {
        let kept = frames.div_ceil(stride(frames)).max(1);
        let most = (PICTURE_BYTES / kept).min(MOST_PICTURE_BYTES);
        FrameSnapshot {
            index,
            width: image.width,
            height: image.height,
            jpeg: image.small_jpeg(most).unwrap_or_default(),
            keypoints: Vec::new(),
        }
    }

    /// The same with these keypoints. Positions are rounded to a tenth of a pixel; keypoints that are not finite are left out.
    #[must_use]
    pub fn with_keypoints(self, keypoints: &[DrawnKeypoint]) -> Self {
        FrameSnapshot {
            keypoints: keypoints.iter().filter_map(rounded).collect(),
            ..self
        }
    }
}

fn stride(frames: usize) -> usize {
    frames.div_ceil(MOST_SNAPSHOTS).max(1)
}

fn rounded(keypoint: &DrawnKeypoint) -> Option<DrawnKeypoint> {
    let tenth = |value: f32| (10.0 * value).round() / 10.0;
    let DrawnKeypoint { x, y, sigma, .. } = *keypoint;
    (x.is_finite() && y.is_finite() && sigma.is_finite()).then(|| DrawnKeypoint {
        x: tenth(x),
        y: tenth(y),
        sigma: tenth(sigma),
        fate: keypoint.fate,
        predicted: keypoint
            .predicted
            .filter(|p| p[0].is_finite() && p[1].is_finite())
            .map(|p| p.map(tenth)),
    })
}

/// A keypoint on disk: column, row, scale, first letter of the fate, prediction.
#[derive(Serialize, Deserialize)]
struct Row(f32, f32, f32, Letter, Option<[f32; 2]>);

#[derive(Serialize, Deserialize)]
enum Letter {
    #[serde(rename = "m")]
    Matched,
    #[serde(rename = "o")]
    Outlier,
    #[serde(rename = "n")]
    New,
    #[serde(rename = "u")]
    Unused,
}

impl From<DrawnKeypoint> for Row {
    fn from(keypoint: DrawnKeypoint) -> Self {
        let letter = match keypoint.fate {
            KeypointFate::Matched => Letter::Matched,
            KeypointFate::Outlier => Letter::Outlier,
            KeypointFate::New => Letter::New,
            KeypointFate::Unused => Letter::Unused,
        };
        let DrawnKeypoint { x, y, sigma, .. } = keypoint;
        Row(x, y, sigma, letter, keypoint.predicted)
    }
}

impl From<Row> for DrawnKeypoint {
    fn from(Row(x, y, sigma, letter, predicted): Row) -> Self {
        DrawnKeypoint {
            x,
            y,
            sigma,
            fate: match letter {
                Letter::Matched => KeypointFate::Matched,
                Letter::Outlier => KeypointFate::Outlier,
                Letter::New => KeypointFate::New,
                Letter::Unused => KeypointFate::Unused,
            },
            predicted,
        }
    }
}
