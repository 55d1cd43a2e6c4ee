//! Faults of writing results and of reading them back.

use std::io;
use std::path::{Path, PathBuf};

/// A fault of writing results or of reading them back.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The file system refused.
    #[error("{}: cannot be {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The attempted action: `created`, `written`, `read`, ...
        action: &'static str,
        /// The system's reason.
        source: io::Error,
    },
    /// The place for a result cannot be used; nothing was written.
    #[error("{}: results cannot go there: {reason}", path.display())]
    Unusable {
        /// The file or folder asked for.
        path: PathBuf,
        /// The reason.
        reason: String,
    },
    /// No folder of results.
    #[error("{}: no finished run: expected the folder that `mono-slam run SEQUENCE --out DIR` wrote, found {found}", path.display())]
    NoRun {
        /// The path given.
        path: PathBuf,
        /// Its contents.
        found: &'static str,
    },
    /// A result is NaN or infinite; nothing was written.
    #[error("results are not written: {what} is not finite")]
    NotFinite {
        /// Name of the first such result.
        what: String,
    },
    /// A file has other contents than it should have.
    #[error("{}: expected {expected}, found {found}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The expected contents.
        expected: String,
        /// The contents found.
        found: String,
    },
    /// A value could not be put into a file's format.
    #[error("results cannot be encoded: {reason}")]
    Encoding {
        /// The reason.
        reason: String,
    },
}

impl OutputError {
    pub(super) fn io(path: &Path, action: &'static str, source: io::Error) -> Self {
        OutputError::Io {
            path: path.to_path_buf(),
            action,
            source,
        }
    }

    pub(super) fn malformed(
        path: &Path,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        OutputError::Malformed {
            path: path.to_path_buf(),
            expected: expected.into(),
            found: found.into(),
        }
    }

    pub(super) fn encoding(error: impl std::fmt::Display) -> Self {
        OutputError::Encoding {
            reason: error.to_string(),
        }
    }
}
