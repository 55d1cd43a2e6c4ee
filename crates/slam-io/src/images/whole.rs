//! Images that end in the middle: found before a run, and cheaply.
//!
//! A PNG ends with its `IEND` chunk and a JPEG with its end-of-image marker. A file whose last bytes hold neither is
//! decoded to be sure; the others are decoded when they are needed. Some cameras append data of their own, therefore a
//! few thousand bytes are searched.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use super::grey::file_decoded;
use crate::error::SequenceError;

/// Bytes at the end of a file in which the end of its picture is searched.
const TAIL_BYTES: u64 = 4096;

/// Images that are whole, and what was left out.
#[derive(Debug)]
pub(crate) struct WholeFiles {
    /// The files that are whole.
    pub(crate) files: Vec<PathBuf>,
    /// The fault of the last file, which was left out.
    pub(crate) cut: Option<SequenceError>,
}

/// The files, but for a last one that was cut while it was written.
///
/// # Errors
/// The fault of a broken file that is not the last one, or of the only one.
pub(crate) fn whole_files(mut files: Vec<PathBuf>) -> Result<WholeFiles, SequenceError> {
    let mut cut = None;
    for (index, path) in files.iter().enumerate() {
        if seems_whole(path) {
            continue;
        }
        if let Err(fault) = file_decoded(path) {
            let last = index + 1 == files.len() && index > 0;
            if !last || matches!(fault, SequenceError::Read { .. }) {
                return Err(fault);
            }
            cut = Some(fault);
        }
    }
    if cut.is_some() {
        files.pop();
    }
    Ok(WholeFiles { files, cut })
}

/// Whether a look at both ends of the file finds nothing wrong.
fn seems_whole(path: &Path) -> bool {
    let look = || -> std::io::Result<bool> {
        let mut file = File::open(path)?;
        let mut head = [0; 4];
        if file.read_exact(&mut head).is_err() {
            return Ok(false);
        }
        let end: &[u8] = match head {
            [0x89, b'P', b'N', b'G'] => b"IEND\xaeB`\x82",
            [0xff, 0xd8, ..] => &[0xff, 0xd9],
            _ => return Ok(true),
        };
        let length = file.metadata()?.len();
        file.seek(SeekFrom::Start(length.saturating_sub(TAIL_BYTES)))?;
        let mut tail = Vec::new();
        file.take(TAIL_BYTES).read_to_end(&mut tail)?;
        Ok(tail.windows(end.len()).any(|window| window == end))
    };
    look().unwrap_or(false)
}
