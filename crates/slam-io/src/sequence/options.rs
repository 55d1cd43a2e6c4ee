//! How a sequence is to be read.

use std::fmt;
use std::path::PathBuf;

/// The layout of a sequence on disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SequenceFormat {
    /// `images/`, `times.txt`, `camera.toml`, `odometry.csv`.
    Native,
    /// EuRoC and TUM-VI: `mav0/cam0`.
    Euroc,
    /// TUM RGB-D: `rgb.txt`, `rgb/`, `groundtruth.txt`.
    TumRgbd,
    /// KITTI odometry: `image_0`, `times.txt`, `calib.txt`.
    Kitti,
    /// KITTI raw: `image_00/data`, `oxts`.
    KittiRaw,
    /// Images directly in the folder, the text files of the native layout beside them as far as there are any.
    Images,
    /// A ROS 1 bag, an MCAP file or a ROS 2 sqlite3 bag, as a file or a folder.
    Log,
}

impl SequenceFormat {
    /// All formats.
    pub const ALL: [SequenceFormat; 7] = [
        SequenceFormat::Native,
        SequenceFormat::Euroc,
        SequenceFormat::TumRgbd,
        SequenceFormat::Kitti,
        SequenceFormat::KittiRaw,
        SequenceFormat::Images,
        SequenceFormat::Log,
    ];

    /// The name that `--format` takes.
    pub fn name(self) -> &'static str {
        match self {
            SequenceFormat::Native => "native",
            SequenceFormat::Euroc => "euroc",
            SequenceFormat::TumRgbd => "tum",
            SequenceFormat::Kitti => "kitti",
            SequenceFormat::KittiRaw => "kitti-raw",
            SequenceFormat::Images => "images",
            SequenceFormat::Log => "bag",
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
    /// Topic of the images in a recorded log; `None` chooses.
    pub image_topic: Option<String>,
    /// Topic of the odometry in a recorded log; `None` chooses.
    pub odometry_topic: Option<String>,
    /// Where the odometry is to come from.
    pub odometry: OdometryChoice,
    /// Added to the times of the odometry, seconds: the clock of the camera minus that of the wheels.
    pub odometry_offset_s: f64,
    /// Images a second, for images without times.
    pub frames_per_second: Option<f64>,
}

/// Where the odometry of a sequence is to come from.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum OdometryChoice {
    /// The sequence's own files or messages.
    #[default]
    Found,
    /// Nowhere: the images alone tell the path, up to its scale. A missing calibration is guessed, and so is the frame rate;
    /// warnings say so.
    Without,
    /// The reference path with white noise added.
    GroundTruth {
        /// Noise of the way, metres per square root of a second.
        sigma_v: f64,
        /// Noise of the heading, radians per square root of a second.
        sigma_w: f64,
        /// Seed of the noise.
        seed: u64,
    },
}
