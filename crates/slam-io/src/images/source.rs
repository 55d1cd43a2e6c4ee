//! The images of a sequence, wherever they are kept.

use std::fmt::Debug;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use image::DynamicImage;

use super::grey::{GreyImage, file_decoded, file_size};
use super::levels::Levels;
use crate::camera::CameraFile;
use crate::error::SequenceError;
use crate::warning::Warning;

/// Frames whose levels decide about the mapping to eight bits.
const LOOKED_AT: usize = 7;

/// Where images come from: files of a folder, messages of a log.
pub(crate) trait ImageSource: Debug + Send + Sync {
    /// Number of images.
    fn len(&self) -> usize;

    /// How image `index < len` is called in messages and results.
    fn name(&self, index: usize) -> String;

    /// File of image `index < len`, also for messages: of a log the log itself.
    fn path(&self, index: usize) -> &Path;

    /// Columns and rows of image `index < len`, if possible without decoding it.
    fn size(&self, index: usize) -> Result<(u32, u32), SequenceError>;

    /// The pixels of image `index < len` as they were recorded.
    fn decoded(&self, index: usize) -> Result<DynamicImage, SequenceError>;
}

/// The images of a sequence in the order in which they were taken; pixels are decoded on demand.
///
/// All images go through the same mapping to eight bits: as it is for images that use their range, stretched where they
/// use less than a quarter of it (12-bit and thermal cameras in 16-bit files, low contrast).
#[derive(Debug, Clone)]
pub struct Images {
    source: Arc<dyn ImageSource>,
    levels: Levels,
}

impl Images {
    /// Decodes some images, spread over the sequence, to find the levels in use; those that cannot be decoded do not
    /// count here.
    pub(crate) fn new(source: Arc<dyn ImageSource>) -> Self {
        let count = source.len();
        let looked_at = count.min(LOOKED_AT);
        let frames: Vec<DynamicImage> = (0..looked_at)
            .map(|k| k * (count - 1) / (looked_at - 1).max(1))
            .filter_map(|index| source.decoded(index).ok())
            .collect();
        Self {
            levels: Levels::of(&frames),
            source,
        }
    }

    /// Number of images.
    pub fn len(&self) -> usize {
        self.source.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How an image is called: the name of its file. Empty when there is no image `index`.
    pub fn name(&self, index: usize) -> String {
        if index < self.len() {
            self.source.name(index)
        } else {
            String::new()
        }
    }

    /// The file in which image `index` is; of a recorded log the log.
    pub fn path(&self, index: usize) -> Option<&Path> {
        (index < self.len()).then(|| self.source.path(index))
    }

    /// Columns and rows of an image.
    ///
    /// # Errors
    /// [`SequenceError`] when the image cannot be read or there is no image `index`.
    pub fn size(&self, index: usize) -> Result<(u32, u32), SequenceError> {
        self.check_index(index)?;
        self.source.size(index)
    }

    /// Decodes image `index` to 8-bit grey; colour becomes luma.
    ///
    /// # Errors
    /// [`SequenceError`] when it cannot be decoded or there is no image `index`.
    pub fn load(&self, index: usize) -> Result<GreyImage, SequenceError> {
        self.check_index(index)?;
        Ok(self.levels.grey(self.source.decoded(index)?))
    }

    /// Lower and upper grey level in use and the largest one that the files could hold (255 or 65535).
    pub fn levels(&self) -> Option<(u32, u32, u32)> {
        let (low, high) = self.levels.used?;
        Some((low, high, self.levels.top))
    }

    /// The warning about the levels.
    pub(crate) fn warning(&self) -> Option<Warning> {
        self.levels.warning()
    }

    /// Compares the size of every image with the camera's; `camera_name` is its file, for messages.
    pub(crate) fn check_sizes(
        &self,
        camera: &CameraFile,
        camera_name: &str,
    ) -> Result<(), SequenceError> {
        (0..self.len()).try_for_each(|index| {
            let (width, height) = self.source.size(index)?;
            self.check_size(index, width, height, camera, camera_name)
        })
    }

    /// Refuses an image of another size than the camera's.
    pub(crate) fn check_size(
        &self,
        index: usize,
        width: u32,
        height: u32,
        camera: &CameraFile,
        camera_name: &str,
    ) -> Result<(), SequenceError> {
        if (width, height) == (camera.width, camera.height) {
            return Ok(());
        }
        Err(SequenceError::File {
            path: self.source.path(index).to_path_buf(),
            expected: format!(
                "{}x{} pixels as {camera_name} says",
                camera.width, camera.height
            ),
            found: format!("{width}x{height}"),
        })
    }

    fn check_index(&self, index: usize) -> Result<(), SequenceError> {
        if index < self.len() {
            return Ok(());
        }
        Err(SequenceError::NoSuchFrame {
            index,
            frames: self.len(),
        })
    }
}

/// Image files.
#[derive(Debug)]
pub(crate) struct ImageFiles(pub(crate) Vec<PathBuf>);

impl ImageSource for ImageFiles {
    fn len(&self) -> usize {
        self.0.len()
    }

    fn name(&self, index: usize) -> String {
        let name = self.0[index].file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    }

    fn path(&self, index: usize) -> &Path {
        &self.0[index]
    }

    fn size(&self, index: usize) -> Result<(u32, u32), SequenceError> {
        file_size(&self.0[index])
    }

    fn decoded(&self, index: usize) -> Result<DynamicImage, SequenceError> {
        file_decoded(&self.0[index])
    }
}
