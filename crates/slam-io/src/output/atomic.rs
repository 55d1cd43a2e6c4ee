//! Files that appear whole or not at all: temporary name, sync, rename.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

use super::error::OutputError;
use super::target::{Target, parent_of, temporary_name, write_through};

/// A file that is complete on disk under a temporary name, removed unless committed; or the bytes for a device or pipe.
#[derive(Debug)]
pub(super) struct PendingFile {
    target: PathBuf,
    state: Pending,
}

#[derive(Debug)]
enum Pending {
    Written { temporary: PathBuf },
    Through { bytes: Vec<u8> },
}

impl PendingFile {
    /// Writes and syncs `bytes` beside the place behind `target`.
    pub(super) fn write(target: &Path, bytes: &[u8]) -> Result<Self, OutputError> {
        let file = match Target::of(target)? {
            Target::File(file) => file,
            Target::Stream(stream) => {
                return Ok(PendingFile {
                    target: stream,
                    state: Pending::Through {
                        bytes: bytes.to_vec(),
                    },
                });
            }
        };
        let name = file.file_name().unwrap_or_default().to_os_string();
        let temporary = file.with_file_name(temporary_name(name));
        let pending = PendingFile {
            target: file,
            state: Pending::Written {
                temporary: temporary.clone(),
            },
        };
        File::create(&temporary)
            .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
            .map_err(|source| OutputError::io(target, "written", source))?;
        Ok(pending)
    }
}

impl Drop for PendingFile {
    fn drop(&mut self) {
        if let Pending::Written { temporary } = &self.state {
            // After a commit there is nothing under this name; otherwise it is best effort.
            drop(fs::remove_file(temporary));
        }
    }
}

/// Gives every file its final name, then syncs the folders that hold the names.
pub(super) fn commit(pending: Vec<PendingFile>) -> Result<(), OutputError> {
    let mut folders = BTreeSet::new();
    for file in pending {
        match &file.state {
            Pending::Through { bytes } => write_through(&file.target, bytes)?,
            Pending::Written { temporary } => {
                fs::rename(temporary, &file.target).map_err(|source| {
                    OutputError::io(&file.target, "renamed into place", source)
                })?;
                folders.insert(parent_of(&file.target).to_path_buf());
            }
        }
    }
    // Only Unix opens folders as files; elsewhere the rename is already durable enough.
    #[cfg(unix)]
    for dir in &folders {
        File::open(dir)
            .and_then(|folder| folder.sync_all())
            .map_err(|source| OutputError::io(dir, "synced", source))?;
    }
    Ok(())
}
