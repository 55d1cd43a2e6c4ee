//! Files that appear whole or not at all: temporary name, sync, rename.

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

use super::error::OutputError;

/// A file that is complete on disk under a temporary name; removed unless committed.
#[derive(Debug)]
pub(super) struct PendingFile {
    temporary: PathBuf,
    target: PathBuf,
}

impl PendingFile {
    /// Writes and syncs `bytes` beside `target`.
    pub(super) fn write(target: &Path, bytes: &[u8]) -> Result<Self, OutputError> {
        let mut name = target.file_name().unwrap_or_default().to_os_string();
        name.push(format!(".{}.tmp", std::process::id()));
        let pending = PendingFile {
            temporary: target.with_file_name(name),
            target: target.to_path_buf(),
        };
        File::create(&pending.temporary)
            .and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
            .map_err(|source| OutputError::io(target, "written", source))?;
        Ok(pending)
    }
}

impl Drop for PendingFile {
    fn drop(&mut self) {
        // After a commit there is nothing under this name; otherwise it is best effort.
        drop(fs::remove_file(&self.temporary));
    }
}

/// Gives every file its final name, then syncs the folder that holds the names.
pub(super) fn commit(pending: Vec<PendingFile>, dir: &Path) -> Result<(), OutputError> {
    for file in pending {
        fs::rename(&file.temporary, &file.target)
            .map_err(|source| OutputError::io(&file.target, "renamed into place", source))?;
    }
    // Only Unix opens folders as files; elsewhere the rename is already durable enough.
    #[cfg(unix)]
    File::open(dir)
        .and_then(|folder| folder.sync_all())
        .map_err(|source| OutputError::io(dir, "synced", source))?;
    #[cfg(not(unix))]
    let _ = dir;
    Ok(())
}
