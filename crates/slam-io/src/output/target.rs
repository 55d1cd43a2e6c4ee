//! Where a file goes: links are followed, devices and pipes are written through, and both are known before the work.
//!
//! A result replaces a regular file or makes a new one. It must never replace anything else: as root, renaming a file
//! onto `/dev/null` destroys the device for the whole system. And a drive of an hour must not end with the news that its
//! folder cannot be written.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use super::error::OutputError;

/// Most symbolic links that are followed, as the kernel does.
const MOST_LINKS: usize = 40;

/// The place behind a path.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Target {
    /// A regular file, or none yet: written beside and renamed.
    File(PathBuf),
    /// A device, a pipe or the like: written through.
    Stream(PathBuf),
}

impl Target {
    /// The place behind `path`.
    pub(super) fn of(path: &Path) -> Result<Target, OutputError> {
        match fs::metadata(path) {
            Ok(found) if found.is_dir() => Err(unusable(path, "a folder is there")),
            Ok(found) if found.is_file() => Ok(match fs::canonicalize(path) {
                Ok(real) => Target::File(real),
                // A file that is open and has no name any more, as behind /dev/fd.
                Err(_) => Target::Stream(path.to_path_buf()),
            }),
            Ok(_) => Ok(Target::Stream(path.to_path_buf())),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                end_of_links(path).map(Target::File)
            }
            Err(error) => Err(unusable(path, reason(&error))),
        }
    }
}

/// The file that a chain of links names although it does not exist yet.
fn end_of_links(path: &Path) -> Result<PathBuf, OutputError> {
    let mut end = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        match fs::read_link(&end) {
            Ok(next) => end = parent_of(&end).join(next),
            Err(_) if end.file_name().is_none() => {
                return Err(unusable(path, "that is no name of a file"));
            }
            Err(_) => return Ok(end),
        }
    }
    Err(unusable(path, "its symbolic links have no end"))
}

/// Writes into what is no regular file.
pub(super) fn write_through(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    OpenOptions::new()
        .write(true)
        .open(path)
        .and_then(|mut stream| stream.write_all(bytes))
        .map_err(|source| OutputError::io(path, "written", source))
}

/// Checks before the work that a file can be written at `path`, and leaves everything as it is.
///
/// # Errors
/// [`OutputError::Unusable`] for a folder, a missing or read-only parent, a name that the system does not take.
pub fn check_output_file(path: &Path) -> Result<(), OutputError> {
    match Target::of(path)? {
        Target::Stream(_) => Ok(()),
        Target::File(file) => {
            let parent = parent_of(&file);
            if !parent.is_dir() {
                return Err(unusable(
                    path,
                    format!("the folder {} does not exist", parent.display()),
                ));
            }
            try_in(parent, path, file.file_name().map(OsString::from))
        }
    }
}

/// Checks before the work that files can be written into the folder `dir`, or that it can be made; makes nothing.
///
/// # Errors
/// [`OutputError::Unusable`] where something else has the name, or the folder or its nearest parent is read-only.
pub fn check_output_folder(dir: &Path) -> Result<(), OutputError> {
    let mut existing = dir;
    loop {
        match fs::metadata(existing) {
            Ok(found) if found.is_dir() => break,
            Ok(_) => {
                return Err(unusable(
                    dir,
                    format!("{} is no folder", existing.display()),
                ));
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                if fs::symlink_metadata(existing).is_ok() {
                    return Err(unusable(
                        dir,
                        format!("{} is a link to nothing", existing.display()),
                    ));
                }
                existing = parent_of(existing);
            }
            Err(error) => return Err(unusable(dir, reason(&error))),
        }
    }
    try_in(existing, dir, None)
}

/// Makes a file in a folder and removes it.
fn try_in(folder: &Path, asked: &Path, name: Option<OsString>) -> Result<(), OutputError> {
    let trial = folder.join(temporary_name(name.unwrap_or_default()));
    match File::create(&trial) {
        Ok(_) => {
            // It was made a moment ago; nobody misses it.
            drop(fs::remove_file(&trial));
            Ok(())
        }
        Err(error) => Err(unusable(asked, reason(&error))),
    }
}

/// A name beside that of a result, of this process alone.
pub(super) fn temporary_name(mut name: OsString) -> OsString {
    name.push(format!(".{}.tmp", std::process::id()));
    name
}

/// The folder of a path; that of a bare name is here.
pub(super) fn parent_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

fn unusable(path: &Path, reason: impl Into<String>) -> OutputError {
    OutputError::Unusable {
        path: path.to_path_buf(),
        reason: reason.into(),
    }
}

/// The system's reason without its number.
fn reason(error: &io::Error) -> String {
    let text = error.to_string();
    match text.split_once(" (os error") {
        Some((plain, _)) => plain.to_lowercase(),
        None => text,
    }
}
