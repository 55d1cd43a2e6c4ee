//! Images of a log as the images of a sequence.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use image::{DynamicImage, GrayImage, ImageBuffer, RgbImage};
use robot_logs::{Message, MessageHandle, Pixels, RobotLog};

use crate::error::SequenceError;
use crate::images::{ImageSource, decoded_in_memory};

/// The images of one topic.
#[derive(Debug)]
pub(super) struct LogImages {
    path: PathBuf,
    log: Arc<RobotLog>,
    handles: Vec<MessageHandle>,
    /// Columns and rows of the first image; that the others have the same is found when they are decoded.
    size: (u32, u32),
}

impl LogImages {
    /// The images behind `handles`, and the name of the first one's coordinate frame.
    pub(super) fn new(
        path: &Path,
        log: Arc<RobotLog>,
        handles: Vec<MessageHandle>,
    ) -> Result<(Self, String), SequenceError> {
        let mut images = Self {
            path: path.to_path_buf(),
            log,
            handles,
            size: (0, 0),
        };
        let Some(first) = images.handles.first() else {
            return Err(SequenceError::File {
                path: images.path,
                expected: "at least one image".into(),
                found: "none".into(),
            });
        };
        let frame = match images.log.message(first)? {
            Message::Image(image) => image.header.frame_id,
            Message::CompressedImage(image) => image.header.frame_id,
            _ => String::new(),
        };
        let decoded = images.decoded(0)?;
        images.size = (decoded.width(), decoded.height());
        Ok((images, frame))
    }

    fn fault(&self, index: usize, found: String) -> SequenceError {
        let seconds = self.handles[index].log_time_ns() as f64 * 1e-9;
        SequenceError::File {
            path: self.path.clone(),
            expected: format!("a whole image, number {index}, recorded at {seconds:.3} s"),
            found,
        }
    }
}

impl ImageSource for LogImages {
    fn len(&self) -> usize {
        self.handles.len()
    }

    fn name(&self, index: usize) -> String {
        format!("{index:06}")
    }

    fn path(&self, _index: usize) -> &Path {
        &self.path
    }

    fn size(&self, _index: usize) -> Result<(u32, u32), SequenceError> {
        Ok(self.size)
    }

    fn decoded(&self, index: usize) -> Result<DynamicImage, SequenceError> {
        let image = match self.log.message(&self.handles[index])? {
            Message::Image(image) => image,
            Message::CompressedImage(image) => {
                return decoded_in_memory(&image.data).map_err(|error| {
                    let text = error.to_string().lines().collect::<Vec<_>>().join(" ");
                    self.fault(index, format!("{text} (format {:?})", image.format))
                });
            }
            _ => return Err(self.fault(index, "another message".into())),
        };
        let pixels = image
            .pixels()
            .map_err(|error| self.fault(index, error.to_string()))?;
        let (width, height) = (image.width, image.height);
        let decoded = match pixels {
            Pixels::Grey8(pixels) => GrayImage::from_raw(width, height, pixels).map(Into::into),
            Pixels::Grey16(pixels) => {
                ImageBuffer::from_raw(width, height, pixels).map(DynamicImage::ImageLuma16)
            }
            Pixels::Rgb8(pixels) => RgbImage::from_raw(width, height, pixels).map(Into::into),
        };
        decoded.ok_or_else(|| self.fault(index, "fewer pixels than its size".into()))
    }
}
