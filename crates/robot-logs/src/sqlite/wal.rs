//! The write-ahead log of an SQLite database: pages that were committed and not yet moved into the file.
//!
//! A recorder that was killed leaves it beside the database as `NAME-wal`. It is a header of 32 bytes and frames of a
//! header of 24 bytes and a page. A frame counts when its salts are those of the header, its running checksum is right,
//! and a commit follows. Source: sqlite.org/fileformat2.html, section 4.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::error::{LogError, Mismatch};
use crate::source::Source;

const HEADER: u64 = 32;
const FRAME_HEADER: u64 = 24;
/// First four bytes; the last bit says that checksums are of big-endian words.
const MAGIC: u32 = 0x377f_0682;

/// The committed pages of a write-ahead log.
#[derive(Debug)]
pub(super) struct WriteAheadLog {
    source: Source,
    page_size: u64,
    /// Place of the newest committed copy of a page.
    places: BTreeMap<u64, u64>,
    pages: u64,
}

impl WriteAheadLog {
    /// The log beside a database on disk; `None` where there is none or it holds no commit.
    pub(super) fn beside(database: &Source, page_size: u64) -> Result<Option<Self>, LogError> {
        let mut name = database.path().as_os_str().to_owned();
        name.push("-wal");
        let path = PathBuf::from(name);
        if database.in_memory_only() || !path.is_file() {
            return Ok(None);
        }
        Self::read(Source::open(&path)?, page_size)
    }

    fn read(source: Source, page_size: u64) -> Result<Option<Self>, LogError> {
        if source.length() < HEADER + FRAME_HEADER + page_size {
            return Ok(None);
        }
        let header = source.read(0, HEADER)?;
        let magic = word(&header, 0, true);
        if magic & !1 != MAGIC || u64::from(word(&header, 8, true)) != page_size {
            return Err(source.damaged(
                0,
                Mismatch::new(
                    format!("a write-ahead log of SQLite with pages of {page_size} bytes"),
                    "other bytes",
                ),
            ));
        }
        let big_endian = magic & 1 == 1;
        let mut sum = checksum((0, 0), &header[..24], big_endian);
        if sum != (word(&header, 24, true), word(&header, 28, true)) {
            return Ok(None);
        }
        let mut log = Self {
            page_size,
            places: BTreeMap::new(),
            pages: 0,
            source,
        };
        let mut uncommitted = Vec::new();
        let mut at = HEADER;
        while log.source.length() - at >= FRAME_HEADER + page_size {
            let frame = log.source.read(at, FRAME_HEADER + page_size)?;
            sum = checksum(sum, &frame[..8], big_endian);
            sum = checksum(sum, &frame[24..], big_endian);
            let same_salts = frame[8..16] == header[16..24];
            if !same_salts || sum != (word(&frame, 16, true), word(&frame, 20, true)) {
                break;
            }
            uncommitted.push((u64::from(word(&frame, 0, true)), at + FRAME_HEADER));
            let pages = u64::from(word(&frame, 4, true));
            if pages > 0 {
                log.places.extend(uncommitted.drain(..));
                log.pages = pages;
            }
            at += FRAME_HEADER + page_size;
        }
        Ok((log.pages > 0).then_some(log))
    }

    /// Pages of the database after the last commit.
    pub(super) fn pages(&self) -> u64 {
        self.pages
    }

    /// The newest committed copy of a page.
    pub(super) fn page(&self, number: u64) -> Option<Result<Vec<u8>, LogError>> {
        let place = self.places.get(&number)?;
        Some(self.source.read(*place, self.page_size))
    }
}

/// Four bytes at `at`.
fn word(bytes: &[u8], at: usize, big_endian: bool) -> u32 {
    let mut four = [0; 4];
    four.copy_from_slice(&bytes[at..at + 4]);
    if big_endian {
        u32::from_be_bytes(four)
    } else {
        u32::from_le_bytes(four)
    }
}

/// The running checksum over pairs of words.
fn checksum((mut first, mut second): (u32, u32), bytes: &[u8], big_endian: bool) -> (u32, u32) {
    for pair in bytes.chunks_exact(8) {
        first = first
            .wrapping_add(word(pair, 0, big_endian))
            .wrapping_add(second);
        second = second
            .wrapping_add(word(pair, 4, big_endian))
            .wrapping_add(first);
    }
    (first, second)
}
