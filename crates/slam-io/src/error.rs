//! Faults of sequence folders, camera files and trajectory files.

use std::io;
use std::path::PathBuf;

/// A fault of a sequence folder, a camera file or a trajectory file: the place, the expected and the found contents.
#[derive(Debug, thiserror::Error)]
pub enum SequenceError {
    /// The operating system refused to read a file or folder.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// A line of a text file is wrong.
    #[error("{}, line {line}: expected {expected}, found {found}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line number, from one.
        line: u64,
        /// The expected contents.
        expected: String,
        /// The contents found.
        found: String,
    },
    /// A file or folder as a whole is wrong.
    #[error("{}: expected {expected}, found {found}", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// The expected contents.
        expected: String,
        /// The contents found.
        found: String,
    },
    /// A file or folder that a sequence needs is not there.
    #[error("{}: not found; it holds {holds}", path.display())]
    Missing {
        /// The file or folder.
        path: PathBuf,
        /// Its contents, and the command that would write it.
        holds: String,
    },
    /// A recorded log is damaged, or none that is read.
    #[error(transparent)]
    Log(#[from] robot_logs::LogError),
    /// A frame was asked for that the sequence does not have.
    #[error("frame {index} was asked for, the sequence has {frames} frames")]
    NoSuchFrame {
        /// The index asked for.
        index: usize,
        /// Number of frames.
        frames: usize,
    },
    /// A calibration that a file format cannot hold.
    #[error("{format} has no place for {what}")]
    NoPlace {
        /// Name of the format.
        format: &'static str,
        /// The part of the calibration that it cannot hold.
        what: String,
    },
}
