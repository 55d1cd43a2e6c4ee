//! The table of contents of one file of a log, which every container format is read into.

use std::borrow::Cow;
use std::collections::BTreeMap;

use crate::decompress::{Compression, decompress};
use crate::error::{LogError, Mismatch};
use crate::source::Source;

/// How the bytes of a message are arranged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Serialisation {
    /// ROS 1: little endian, packed.
    Ros1,
    /// ROS 2: CDR with its four bytes of encapsulation.
    Cdr,
}

/// A topic of one file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Channel {
    pub(crate) topic: String,
    /// Name of the type as the file has it.
    pub(crate) type_name: String,
    /// `None`: a serialisation that is not read.
    pub(crate) serialisation: Option<Serialisation>,
}

/// A block of messages that is compressed as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Chunk {
    /// Place of the stored bytes in the file.
    pub(crate) offset: u64,
    /// Stored bytes.
    pub(crate) stored: u64,
    /// Bytes after decompression.
    pub(crate) size: u64,
    pub(crate) compression: Compression,
    /// CRC-32 after decompression, zero where there is none.
    pub(crate) crc: u32,
}

impl Chunk {
    /// Reads and decompresses the chunk, and compares it with its CRC.
    pub(crate) fn load(&self, source: &Source) -> Result<Vec<u8>, LogError> {
        let damaged = |mismatch| source.damaged(self.offset, mismatch);
        let stored = source.read(self.offset, self.stored)?;
        let bytes = decompress(&stored, self.compression, self.size).map_err(damaged)?;
        let crc = if self.crc == 0 {
            0
        } else {
            crc32fast::hash(&bytes)
        };
        if crc != self.crc {
            return Err(damaged(Mismatch::new(
                format!("a chunk with CRC {:08x}", self.crc),
                format!("{crc:08x}"),
            )));
        }
        Ok(bytes)
    }
}

/// The place of a message in its file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Place {
    /// A record at this byte of the file.
    File(u64),
    /// A record at this byte of a chunk after decompression.
    Chunk {
        /// Number of the chunk.
        chunk: u32,
        /// Byte in the chunk.
        offset: u64,
    },
    /// A row of a table.
    Row(i64),
}

/// A message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Entry {
    /// Key of its channel.
    pub(crate) channel: u32,
    pub(crate) time_ns: i64,
    pub(crate) place: Place,
}

/// Everything that was found in one file.
#[derive(Debug, Default)]
pub(crate) struct Contents {
    pub(crate) channels: BTreeMap<u32, Channel>,
    pub(crate) chunks: Vec<Chunk>,
    pub(crate) entries: Vec<Entry>,
    /// Sentences about a file that is not whole.
    pub(crate) notes: Vec<String>,
}

/// The records around a message: those of the file or those of one chunk after decompression.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Records<'a> {
    /// The file itself.
    File(&'a Source),
    /// A chunk.
    Chunk {
        /// The file.
        source: &'a Source,
        /// Where the chunk's stored bytes are, for messages.
        at: u64,
        /// The chunk after decompression.
        bytes: &'a [u8],
    },
}

impl<'a> Records<'a> {
    /// `count` bytes from `offset`.
    pub(crate) fn get(&self, offset: u64, count: u64) -> Result<Cow<'a, [u8]>, LogError> {
        match *self {
            Self::File(source) => Ok(Cow::Owned(source.read(offset, count)?)),
            Self::Chunk { bytes, .. } => {
                let from = usize::try_from(offset).unwrap_or(usize::MAX);
                let to = from.saturating_add(usize::try_from(count).unwrap_or(usize::MAX));
                bytes.get(from..to).map(Cow::Borrowed).ok_or_else(|| {
                    self.damaged(
                        offset,
                        Mismatch::new(
                            format!("{count} bytes from byte {offset} of a chunk"),
                            format!("a chunk of {} bytes", bytes.len()),
                        ),
                    )
                })
            }
        }
    }

    /// A fault at `offset`; in a chunk the place is that of the chunk.
    pub(crate) fn damaged(&self, offset: u64, mismatch: Mismatch) -> LogError {
        match *self {
            Self::File(source) => source.damaged(offset, mismatch),
            Self::Chunk { source, at, .. } => source.damaged(at, mismatch),
        }
    }
}
