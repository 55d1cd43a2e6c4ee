//! The bytes of one file of a log, read piece by piece, from the disk or from memory.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use crate::error::{LogError, Mismatch};

/// Bytes that a scan reads at once.
const WINDOW_BYTES: usize = 1 << 16;

/// One file of a log.
#[derive(Debug)]
pub(crate) struct Source {
    path: PathBuf,
    length: u64,
    bytes: Bytes,
}

#[derive(Debug)]
enum Bytes {
    Disk(Mutex<File>),
    Memory(Vec<u8>),
}

impl Source {
    /// Opens a file.
    pub(crate) fn open(path: &Path) -> Result<Self, LogError> {
        let unreadable = |source| LogError::Read {
            path: path.to_path_buf(),
            source,
        };
        let file = File::open(path).map_err(unreadable)?;
        let length = file.metadata().map_err(unreadable)?.len();
        Ok(Self {
            path: path.to_path_buf(),
            length,
            bytes: Bytes::Disk(Mutex::new(file)),
        })
    }

    /// Bytes in memory under the name `path`.
    pub(crate) fn in_memory(path: &Path, bytes: Vec<u8>) -> Self {
        Self {
            path: path.to_path_buf(),
            length: bytes.len() as u64,
            bytes: Bytes::Memory(bytes),
        }
    }

    /// Name of the file.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Whether no file is behind it.
    pub(crate) fn in_memory_only(&self) -> bool {
        matches!(self.bytes, Bytes::Memory(_))
    }

    /// Number of bytes.
    pub(crate) fn length(&self) -> u64 {
        self.length
    }

    /// `count` bytes from `offset`; the count is compared with the file's before memory is taken.
    pub(crate) fn read(&self, offset: u64, count: u64) -> Result<Vec<u8>, LogError> {
        let left = self.length.saturating_sub(offset);
        let size = usize::try_from(count).unwrap_or(usize::MAX);
        if count > left || size == usize::MAX {
            return Err(self.damaged(
                offset,
                Mismatch::new(format!("{count} more bytes"), format!("{left} left")),
            ));
        }
        match &self.bytes {
            Bytes::Memory(bytes) => {
                let start = usize::try_from(offset).unwrap_or(bytes.len());
                Ok(bytes[start..start + size].to_vec())
            }
            Bytes::Disk(file) => {
                let mut buffer = vec![0; size];
                let mut file = file
                    .lock()
                    .unwrap_or_else(std::sync::PoisonError::into_inner);
                file.seek(SeekFrom::Start(offset))
                    .and_then(|_| file.read_exact(&mut buffer))
                    .map_err(|source| LogError::Read {
                        path: self.path.clone(),
                        source,
                    })?;
                Ok(buffer)
            }
        }
    }

    /// A fault at a place of this file.
    pub(crate) fn damaged(&self, offset: u64, mismatch: Mismatch) -> LogError {
        LogError::Damaged {
            path: self.path.clone(),
            offset,
            expected: mismatch.expected,
            found: mismatch.found,
        }
    }
}

/// Small pieces of a file in rising order, read through a window.
#[derive(Debug)]
pub(crate) struct Scan<'a> {
    source: &'a Source,
    start: u64,
    window: Vec<u8>,
}

impl<'a> Scan<'a> {
    /// A scan of `source`.
    pub(crate) fn new(source: &'a Source) -> Self {
        Self {
            source,
            start: 0,
            window: Vec::new(),
        }
    }

    /// `count` bytes from `offset`.
    pub(crate) fn get(&mut self, offset: u64, count: u64) -> Result<&[u8], LogError> {
        let end = self.start + self.window.len() as u64;
        if offset < self.start || offset.saturating_add(count) > end {
            let left = self.source.length().saturating_sub(offset);
            let ahead = count.max(left.min(WINDOW_BYTES as u64));
            self.window = self.source.read(offset, ahead)?;
            self.start = offset;
        }
        // Both fit: the window holds them.
        let from = usize::try_from(offset - self.start).unwrap_or(usize::MAX);
        let to = from.saturating_add(usize::try_from(count).unwrap_or(usize::MAX));
        Ok(&self.window[from..to])
    }
}
