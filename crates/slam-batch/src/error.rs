//! Why a batch has no solution.

use estimation_base::Readable;
use mono_geometry::GeometryError;
use thiserror::Error;

/// Why a problem was not solved.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum BatchError {
    /// Nothing can be learned from fewer than two keyframes.
    #[error("a batch needs at least 2 keyframes, found {found}")]
    TooFewKeyframes {
        /// Keyframes of the problem.
        found: usize,
    },
    /// The first keyframe comes after a motion: nothing fixes where the drive starts.
    #[error("the first keyframe must start a drive, it has a motion before it")]
    NoStart,
    /// A sighting names a keyframe that is not there, or keyframes out of order.
    #[error(
        "landmark {landmark}: sighting at keyframe {keyframe}, expected ascending keyframes below {keyframes}"
    )]
    Sighting {
        /// Identity of the landmark.
        landmark: u32,
        /// Keyframe of the sighting.
        keyframe: usize,
        /// Number of keyframes.
        keyframes: usize,
    },
    /// A number of the problem is outside its range.
    #[error("{name} is {}, expected {required}", Readable(*.value))]
    OutOfRange {
        /// Name with unit.
        name: &'static str,
        /// Value given.
        value: f64,
        /// Range required.
        required: &'static str,
    },
    /// No sighting of a landmark fixes anything.
    #[error("no landmark was seen from two keyframes")]
    NoTracks,
    /// The geometry refused a camera, a row of odometry or a factorisation.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
}
