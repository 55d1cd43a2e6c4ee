//! Reading and writing of files, with the file's name in every error.

use crate::error::SceneError;
use std::fs;
use std::path::Path;

/// Creates a folder and its parents.
pub(crate) fn create_folder(folder: &Path) -> Result<(), SceneError> {
    fs::create_dir_all(folder).map_err(|source| SceneError::Write {
        file: folder.to_path_buf(),
        source,
    })
}

/// Writes a file under a temporary name and renames it when it is complete.
pub(crate) fn write_file(file: &Path, bytes: &[u8]) -> Result<(), SceneError> {
    let mut unfinished = file.as_os_str().to_owned();
    unfinished.push(".part");
    fs::write(&unfinished, bytes)
        .and_then(|()| fs::rename(&unfinished, file))
        .map_err(|source| SceneError::Write {
            file: file.to_path_buf(),
            source,
        })
}

/// The text of a file.
pub(crate) fn read_file(file: &Path) -> Result<String, SceneError> {
    fs::read_to_string(file).map_err(|source| SceneError::Read {
        file: file.to_path_buf(),
        source,
    })
}
