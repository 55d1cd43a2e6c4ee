//! The reasons for which a run ends early.

use mono_geometry::GeometryError;
use slam_io::SequenceError;
use slam_pipeline::SlamError;
use slam_pipeline::config::ConfigError;
use thiserror::Error;
use vision_sift::SiftError;

/// Why a run ended early.
#[derive(Debug, Error)]
pub enum RunError {
    /// The sequence could not be read.
    #[error(transparent)]
    Sequence(#[from] SequenceError),
    /// The camera file describes no camera.
    #[error("camera.toml: {0}")]
    Camera(#[from] GeometryError),
    /// A standard deviation of the camera file is out of range.
    #[error("[sigma] of camera.toml: {0}")]
    Sigma(#[from] ConfigError),
    /// SIFT refused its parameters or an image.
    #[error(transparent)]
    Features(#[from] SiftError),
    /// The filter failed.
    #[error(transparent)]
    Slam(#[from] SlamError),
    /// Bytes that are no stored state of the run.
    #[error("no state of this run: {0}")]
    State(String),
    /// The threads could not be started.
    #[error("thread pool: {0}")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}
