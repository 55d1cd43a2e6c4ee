//! When odometry rows hold and when images are taken.
//!
//! A frame of a specification is half a second with five odometry rows. The frame rate changes how many images are taken
//! of that drive, not the drive: the rows, the path and its length in seconds and metres stay.

use serde::{Deserialize, Serialize};

/// Seconds of a frame of the specification.
pub const FRAME_PERIOD_S: f64 = 0.5;
/// Odometry rows per frame.
pub const ROWS_PER_FRAME: usize = 5;

/// Images per frame of the specification: `multiple / divisor`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct FrameRate {
    /// Images taken for each image at rate one.
    pub multiple: usize,
    /// Of these, every how manieth is kept.
    pub divisor: usize,
}

impl FrameRate {
    /// One image a frame.
    pub const ONE: Self = Self {
        multiple: 1,
        divisor: 1,
    };

    /// Number of images of a drive of `frames` frames, the first and what fits behind it.
    pub(crate) fn images(self, frames: usize) -> usize {
        (frames.saturating_sub(1) * self.multiple) / self.divisor + 1
    }

    /// Time of an image in frames.
    pub(crate) fn frames_at(self, image: usize) -> f64 {
        image as f64 * self.divisor as f64 / self.multiple as f64
    }

    /// Time of an image, seconds.
    pub(crate) fn time_s(self, image: usize) -> f64 {
        self.frames_at(image) * FRAME_PERIOD_S
    }

    /// The odometry row that begins at or before an image, and the share of the row that has passed.
    pub(crate) fn row(self, image: usize) -> (usize, f64) {
        let parts = image * ROWS_PER_FRAME * self.divisor;
        let rest = parts % self.multiple;
        (parts / self.multiple, rest as f64 / self.multiple as f64)
    }
}

impl Default for FrameRate {
    fn default() -> Self {
        Self::ONE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_share_the_times_they_have_in_common() {
        let rate = |multiple, divisor| FrameRate { multiple, divisor };
        assert_eq!(FrameRate::ONE.images(38), 38);
        assert_eq!(rate(8, 1).images(38), 297);
        assert_eq!(rate(1, 4).images(1500), 375);
        assert_eq!(rate(8, 1).time_s(16), FrameRate::ONE.time_s(2));
        assert_eq!(FrameRate::ONE.row(3), (15, 0.0));
        // The third of eight images a frame: 15/8 rows.
        assert_eq!(rate(8, 1).row(3), (1, 0.875));
        assert_eq!(rate(1, 4).row(3), (60, 0.0));
    }
}
