//! Everything that can go wrong when a scene is specified, written or read.

use estimation_base::Readable;
use mono_geometry::GeometryError;
use std::io;
use std::path::PathBuf;

/// A scene that cannot be built, or a folder that cannot be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// Too few or too many frames.
    #[error("number of frames {given}, required: 2 to {most}")]
    Frames {
        /// The number given.
        given: usize,
        /// The largest number allowed.
        most: usize,
    },
    /// A noise that is negative, too large or not a number.
    #[error("{name} {}, required: 0 to {}", Readable(*.given), Readable(*.most))]
    Noise {
        /// The noise.
        name: &'static str,
        /// The level given, in the unit of that noise.
        given: f64,
        /// The largest level allowed.
        most: f64,
    },
    /// A number outside its range, or not a number.
    #[error("{name} {}, required: {} to {}", Readable(*.given), Readable(*.low), Readable(*.high))]
    OutOfRange {
        /// The number's name.
        name: &'static str,
        /// The value given.
        given: f64,
        /// The smallest value allowed.
        low: f64,
        /// The largest value allowed.
        high: f64,
    },
    /// The folder already holds a sequence.
    #[error("{} already holds a sequence, required: a folder without images", .0.display())]
    Occupied(PathBuf),
    /// A file or folder cannot be written.
    #[error("cannot write {}: {source}", .file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// A file cannot be read.
    #[error("cannot read {}: {source}", .file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// A file is not the `scene.json` of a sequence.
    #[error("{} is not a scene description: {source}", .file.display())]
    NoDescription {
        /// The file.
        file: PathBuf,
        /// The reason.
        source: serde_json::Error,
    },
    /// An image cannot be encoded.
    #[error("cannot encode {}: {source}", .file.display())]
    Image {
        /// The file.
        file: PathBuf,
        /// The reason.
        source: image::ImageError,
    },
    /// The image size leaves no camera.
    #[error(transparent)]
    Camera(#[from] GeometryError),
}
