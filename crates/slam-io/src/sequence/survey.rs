//! Everything that was found in a sequence, piece by piece: a fault of one does not hide the others.

use std::path::PathBuf;

use mono_geometry::Se2;

use super::options::SequenceFormat;
use super::rows::Odometry;
use crate::camera::CameraFile;
use crate::error::SequenceError;
use crate::images::Images;
use crate::warning::Warning;

/// A piece of a sequence, or the sentence that says why it cannot be had.
pub type Part<T> = Result<T, SequenceError>;

/// Findings about a sequence, before it is asked whether a run is possible.
#[derive(Debug)]
pub struct Survey {
    /// Last part of the path.
    pub name: String,
    /// The folder or file.
    pub root: PathBuf,
    /// Its layout.
    pub format: SequenceFormat,
    /// The images, in order.
    pub images: Part<Images>,
    /// Seconds, one per image.
    pub times_s: Part<Vec<f64>>,
    /// Calibration and mount.
    pub camera: Part<CameraFile>,
    /// The file that the calibration was read from, for messages.
    pub camera_name: String,
    /// Whether all images have the size that the calibration is for.
    pub sizes: Part<()>,
    /// Speeds and turn rates.
    pub odometry: Part<Odometry>,
    /// Reference path of the body, relative to the body pose of the first frame; `None` when there is none.
    pub reference: Part<Option<Vec<(f64, Se2)>>>,
    /// Remarks that do not hinder a run.
    pub warnings: Vec<Warning>,
    /// `camera.toml`, where the calibration is exactly its contents.
    pub(crate) camera_file: Option<PathBuf>,
}

impl Survey {
    /// The sentences about everything that hinders a run.
    pub fn faults(&self) -> Vec<&SequenceError> {
        [
            self.images.as_ref().err(),
            self.times_s.as_ref().err(),
            self.camera.as_ref().err(),
            self.sizes.as_ref().err(),
            self.odometry.as_ref().err(),
            self.reference.as_ref().err(),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}
