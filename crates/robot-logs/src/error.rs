//! Reasons why a log or one of its messages cannot be read.

use std::io;
use std::path::PathBuf;

/// Why a log or one of its messages cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The operating system refused to read a file or folder.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The file is no log, or one of a kind that is not read.
    #[error("{}: expected {expected}, found {found}", path.display())]
    Kind {
        /// The file or folder.
        path: PathBuf,
        /// The expected contents.
        expected: String,
        /// The contents found, and the command that makes them readable where there is one.
        found: String,
    },
    /// The bytes at one place are not those of the format.
    #[error("{}, byte {offset}: expected {expected}, found {found}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Position in the file, from zero.
        offset: u64,
        /// The expected contents.
        expected: String,
        /// The contents found.
        found: String,
    },
    /// A message whose bytes are not those of its type.
    #[error("{}, topic {topic}, message at {time_s:.6} s: expected {expected}, found {found}", path.display())]
    Message {
        /// The file.
        path: PathBuf,
        /// Name of the topic.
        topic: String,
        /// Log time in seconds.
        time_s: f64,
        /// The expected contents.
        expected: String,
        /// The contents found.
        found: String,
    },
}

/// The expected and the found contents, before a file and a place are known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Mismatch {
    /// The expected contents.
    pub(crate) expected: String,
    /// The contents found.
    pub(crate) found: String,
}

impl Mismatch {
    /// Both halves of the sentence.
    pub(crate) fn new(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self {
            expected: expected.into(),
            found: found.into(),
        }
    }
}
