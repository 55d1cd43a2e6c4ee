//! How a sequence is to be read.

use std::fmt;
use std::path::PathBuf;

/// The layout of a sequence on disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SequenceFormat {
    /// `images/`, `times.txt`, `camera.toml`, `odometry.csv`.
    Native,
    /// Images directly in the folder, the text files of the native layout beside them as far as there are any.
    Images,
}

impl SequenceFormat {
    /// All formats.
    pub const ALL: [SequenceFormat; 2] = [SequenceFormat::Native, SequenceFormat::Images];

    /// The name that `--format` takes.
    pub fn name(self) -> &'static str {
        match self {
            SequenceFormat::Native => "native",
            SequenceFormat::Images => "images",
        }
    }
}

impl fmt::Display for SequenceFormat {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

/// How a sequence is to be read; the default looks for itself.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct OpenOptions {
    /// Its layout; `None` finds it by looking.
    pub format: Option<SequenceFormat>,
    /// A calibration (any format of [`read_calibration`](crate::read_calibration)) in place of the sequence's own.
    pub camera: Option<PathBuf>,
}
