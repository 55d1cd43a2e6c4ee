//! The features of the frames, detected one frame ahead of the filter.
//!
//! Features and the small picture of a frame depend on nothing but its image, so those of the next frame are found while the filter works on this one.
//! The result is the same as one after the other; with one thread it is one after the other.

use slam_io::{FrameSnapshot, Sequence};
use vision_sift::{Detector, Features, GrayImage, Workspace};

use crate::run_error::RunError;
use crate::stopwatch::{Clock, Lap};

/// The features and the small picture of an image, with the times that they took.
pub(crate) struct Detected {
    /// The picture for the report, without keypoints, of an image that is kept.
    pub(crate) snapshot: Option<FrameSnapshot>,
    /// The features.
    pub(crate) features: Features,
    /// Time to decode the image, milliseconds.
    pub(crate) decode_ms: f64,
    /// Time to find the features, milliseconds.
    pub(crate) features_ms: f64,
}

/// Finds the features of the frames of a sequence.
pub(crate) struct FrameDetector<'a> {
    sequence: &'a Sequence,
    detector: Detector,
    workspace: Workspace,
    clock: &'a Clock<'a>,
}

impl<'a> FrameDetector<'a> {
    /// A detector for the frames of `sequence`.
    pub(crate) fn new(sequence: &'a Sequence, detector: Detector, clock: &'a Clock<'a>) -> Self {
        Self {
            sequence,
            detector,
            workspace: Workspace::new(),
            clock,
        }
    }

    /// The features of frame `index`.
    ///
    /// # Errors
    /// [`RunError::Sequence`] when the image cannot be read, [`RunError::Features`] for one that SIFT refuses.
    pub(crate) fn detect(&mut self, index: usize) -> Result<Detected, RunError> {
        let mut lap = Lap::start(self.clock);
        let image = self.sequence.load_image(index)?;
        let decode_ms = lap.lap_ms();
        let mut features = Features::default();
        let view = GrayImage::new(image.width, image.height, &image.pixels)?;
        self.detector
            .detect(&view, &mut self.workspace, &mut features)?;
        let features_ms = lap.lap_ms();
        let frames = self.sequence.images.len();
        Ok(Detected {
            snapshot: FrameSnapshot::is_kept(index, frames)
                .then(|| FrameSnapshot::of_image(index, frames, &image)),
            features,
            decode_ms,
            features_ms,
        })
    }
}
