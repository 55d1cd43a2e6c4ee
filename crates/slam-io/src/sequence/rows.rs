//! Rows of odometry and where they came from.

use std::fmt;
use std::path::PathBuf;

/// One row: it holds from its time to the next row's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryRow {
    /// Time from which the row holds, seconds.
    pub t_s: f64,
    /// Forward speed, m/s.
    pub v_mps: f64,
    /// Turn rate about the body's z axis (left positive), rad/s.
    pub omega_radps: f64,
}

/// Odometry and where it came from.
#[derive(Debug, Clone, PartialEq)]
pub struct Odometry {
    /// Rows, times strictly increasing.
    pub rows: Vec<OdometryRow>,
    /// Where they came from.
    pub source: OdometrySource,
    /// The file that holds exactly these rows in the native form, if there is one.
    pub(crate) file: Option<PathBuf>,
}

/// Where the odometry of a sequence came from.
#[derive(Debug, Clone, PartialEq)]
pub enum OdometrySource {
    /// Speeds and turn rates of a file, named relative to the sequence.
    File(String),
    /// Counts of wheel encoders.
    Wheels,
    /// Speed and steering angle.
    Steering,
    /// Messages of a topic of a recorded log.
    Topic(String),
    /// Differences of the reference's poses with noise.
    GroundTruth {
        /// Noise of the speed, m/s per square root of a hertz.
        sigma_v: f64,
        /// Noise of the turn rate, rad/s per square root of a hertz.
        sigma_w: f64,
        /// Seed of the noise.
        seed: u64,
    },
    /// There is none: the motion is found from the images alone, up to scale.
    None,
}

impl fmt::Display for OdometrySource {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            OdometrySource::File(name) => formatter.write_str(name),
            OdometrySource::Wheels => formatter.write_str("wheel encoders"),
            OdometrySource::Steering => formatter.write_str("speed and steering angle"),
            OdometrySource::Topic(topic) => write!(formatter, "topic {topic}"),
            OdometrySource::GroundTruth {
                sigma_v,
                sigma_w,
                seed,
            } => write!(
                formatter,
                "ground truth with noise of {sigma_v} and {sigma_w}, seed {seed}"
            ),
            OdometrySource::None => formatter.write_str("none"),
        }
    }
}
