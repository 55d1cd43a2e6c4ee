//! MCAP files: records of one byte of kind and eight bytes of length, messages in chunks or beside them.
//!
//! Source: the specification at mcap.dev/spec. The records of the file are walked from its beginning; the data of a
//! chunk is stepped over and its message indexes behind it are read. The summary at the end is walked like the rest and
//! is not needed: a chunk without message index, or with channels that stand nowhere else, is decompressed and walked
//! itself. So a file whose recorder was killed is read as far as it goes.

use std::collections::BTreeMap;

use crate::bytes::Cursor;
use crate::contents::{Channel, Chunk, Contents, Entry, Place, Records, Serialisation};
use crate::decompress::Compression;
use crate::error::{LogError, Mismatch};
use crate::source::{Scan, Source};

/// First and last bytes of a file.
pub(crate) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

const OP_FOOTER: u8 = 0x02;
const OP_SCHEMA: u8 = 0x03;
const OP_CHANNEL: u8 = 0x04;
const OP_MESSAGE: u8 = 0x05;
const OP_CHUNK: u8 = 0x06;
const OP_MESSAGE_INDEX: u8 = 0x07;

/// Bytes of a message before its data: channel, sequence, log time, publish time.
const MESSAGE_HEAD: u64 = 22;
/// Bytes of a chunk before the name of its compression: two times, size, CRC, length of the name.
const CHUNK_HEAD: u64 = 32;
/// Bytes of kind and length.
const RECORD_HEAD: u64 = 9;
/// Longest believed name of a compression, in bytes.
const LONGEST_NAME: u64 = 64;

/// Everything found so far, with the schemas that channels refer to.
#[derive(Debug, Default)]
struct Walk {
    contents: Contents,
    schemas: BTreeMap<u16, String>,
    /// Schema of each channel.
    schema_of: BTreeMap<u32, u16>,
    /// For each chunk whether a message index followed.
    indexed: Vec<bool>,
    whole: bool,
}

/// Reads the table of contents.
pub(crate) fn scan(source: &Source) -> Result<Contents, LogError> {
    let mut walk = Walk::default();
    let mut scan = Scan::new(source);
    let mut at = MAGIC.len() as u64;
    let mut fault = None;
    while at < source.length() && !walk.whole {
        match walk.step(source, &mut scan, at) {
            Ok(next) => at = next,
            Err(error) => {
                fault = Some(error);
                break;
            }
        }
    }
    walk.fill_gaps(source);
    let whole = walk.whole;
    let mut contents = walk.finish();
    let end = match fault {
        Some(error) => Some(error.to_string()),
        None if !whole => Some(format!(
            "{}, byte {at}: expected the end record of an MCAP file, found the end of the file",
            source.path().display()
        )),
        None => None,
    };
    if let Some(end) = end {
        contents.notes.push(format!(
            "{end}: the {} messages before it are read, and `mcap recover` mends a file whose recorder was stopped hard",
            contents.entries.len()
        ));
    }
    Ok(contents)
}

impl Walk {
    /// Takes in one record of the file; returns the place behind it.
    fn step(&mut self, source: &Source, scan: &mut Scan<'_>, at: u64) -> Result<u64, LogError> {
        let damaged = |mismatch| source.damaged(at, mismatch);
        let mut head = Cursor::new(scan.get(at, RECORD_HEAD)?);
        let op = head.u8().map_err(damaged)?;
        let length = head.u64().map_err(damaged)?;
        let body = at + RECORD_HEAD;
        let left = source.length() - body;
        if length > left {
            return Err(damaged(Mismatch::new(
                format!("a record of {length} bytes"),
                format!("{left} left"),
            )));
        }
        match op {
            OP_CHUNK => {
                let chunk = chunk(scan, body, length).map_err(|error| match error {
                    Fault::Log(error) => error,
                    Fault::Bytes(mismatch) => damaged(mismatch),
                })?;
                self.indexed.push(chunk.stored == 0);
                self.contents.chunks.push(chunk);
            }
            OP_MESSAGE_INDEX => {
                let index = self.indexed.len().checked_sub(1).ok_or_else(|| {
                    damaged(Mismatch::new("a chunk before its index", "the index"))
                })?;
                self.message_index(scan.get(body, length)?, index)
                    .map_err(damaged)?;
            }
            OP_MESSAGE => {
                let mut head = Cursor::new(scan.get(body, MESSAGE_HEAD.min(length))?);
                self.message(&mut head, Place::File(at)).map_err(damaged)?;
            }
            OP_SCHEMA | OP_CHANNEL => self
                .definition(op, scan.get(body, length)?)
                .map_err(damaged)?,
            OP_FOOTER => self.whole = true,
            _ => {}
        }
        Ok(body + length)
    }

    fn definition(&mut self, op: u8, body: &[u8]) -> Result<(), Mismatch> {
        let mut cursor = Cursor::new(body);
        let id = cursor.u16()?;
        if op == OP_SCHEMA {
            self.schemas.insert(id, cursor.text()?);
            return Ok(());
        }
        let schema = cursor.u16()?;
        let topic = cursor.text()?;
        let serialisation = match cursor.text()?.as_str() {
            "cdr" => Some(Serialisation::Cdr),
            "ros1" => Some(Serialisation::Ros1),
            _ => None,
        };
        self.schema_of.insert(u32::from(id), schema);
        self.contents.channels.insert(
            u32::from(id),
            Channel {
                topic,
                type_name: String::new(),
                serialisation,
            },
        );
        Ok(())
    }

    fn message_index(&mut self, body: &[u8], chunk: usize) -> Result<(), Mismatch> {
        let mut cursor = Cursor::new(body);
        let channel = u32::from(cursor.u16()?);
        let mut rows = Cursor::new(cursor.block()?);
        while rows.left() > 0 {
            let time_ns = signed(rows.u64()?);
            self.contents.entries.push(Entry {
                channel,
                time_ns,
                place: Place::Chunk {
                    chunk: u32::try_from(chunk).unwrap_or(u32::MAX),
                    offset: rows.u64()?,
                },
            });
        }
        self.indexed[chunk] = true;
        Ok(())
    }

    fn message(&mut self, head: &mut Cursor<'_>, place: Place) -> Result<(), Mismatch> {
        let channel = u32::from(head.u16()?);
        let _sequence = head.u32()?;
        let time_ns = signed(head.u64()?);
        let _published = head.u64()?;
        self.contents.entries.push(Entry {
            channel,
            time_ns,
            place,
        });
        Ok(())
    }

    /// Decompresses the chunks that have no index, or hold messages of channels that stand nowhere else.
    fn fill_gaps(&mut self, source: &Source) {
        let mut wanted: Vec<bool> = self.indexed.iter().map(|&known| !known).collect();
        for entry in &self.contents.entries {
            if let Place::Chunk { chunk, .. } = entry.place
                && !self.contents.channels.contains_key(&entry.channel)
            {
                wanted[chunk as usize] = true;
            }
        }
        for (index, _) in wanted.iter().enumerate().filter(|(_, wanted)| **wanted) {
            let chunk = self.contents.chunks[index];
            let result = chunk.load(source).and_then(|bytes| {
                self.walk_chunk(&bytes, index)
                    .map_err(|mismatch| source.damaged(chunk.offset, mismatch))
            });
            if let Err(error) = result {
                let note = format!("{error}: this chunk is left out");
                self.contents.notes.push(note);
            }
        }
    }

    fn walk_chunk(&mut self, bytes: &[u8], index: usize) -> Result<(), Mismatch> {
        let mut cursor = Cursor::new(bytes);
        while cursor.left() > 0 {
            let offset = cursor.position() as u64;
            let op = cursor.u8()?;
            let length = cursor.u64()?;
            let body = cursor.take(usize::try_from(length).unwrap_or(usize::MAX))?;
            match op {
                OP_SCHEMA | OP_CHANNEL => self.definition(op, body)?,
                OP_MESSAGE if !self.indexed[index] => {
                    let place = Place::Chunk {
                        chunk: u32::try_from(index).unwrap_or(u32::MAX),
                        offset,
                    };
                    self.message(&mut Cursor::new(body), place)?;
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// The contents with the names of the types filled in.
    fn finish(mut self) -> Contents {
        for (id, channel) in &mut self.contents.channels {
            if let Some(name) = self.schema_of.get(id).and_then(|id| self.schemas.get(id)) {
                channel.type_name.clone_from(name);
            }
        }
        self.contents
    }
}

/// Place and length of the data of the message record at `offset`.
pub(crate) fn locate(records: Records<'_>, offset: u64) -> Result<(u64, u64), LogError> {
    let damaged = |mismatch| records.damaged(offset, mismatch);
    let bytes = records.get(offset, RECORD_HEAD)?;
    let mut head = Cursor::new(&bytes);
    let op = head.u8().map_err(damaged)?;
    let length = head.u64().map_err(damaged)?;
    match length.checked_sub(MESSAGE_HEAD) {
        Some(data) if op == OP_MESSAGE => Ok((offset + RECORD_HEAD + MESSAGE_HEAD, data)),
        _ => Err(damaged(Mismatch::new(
            "a message record (kind 5)",
            format!("kind {op} with {length} bytes"),
        ))),
    }
}

enum Fault {
    Log(LogError),
    Bytes(Mismatch),
}

impl From<LogError> for Fault {
    fn from(error: LogError) -> Self {
        Self::Log(error)
    }
}

impl From<Mismatch> for Fault {
    fn from(mismatch: Mismatch) -> Self {
        Self::Bytes(mismatch)
    }
}

/// The head of a chunk whose record's body is at `body`; the stored bytes are not read.
fn chunk(scan: &mut Scan<'_>, body: u64, length: u64) -> Result<Chunk, Fault> {
    let mut head = Cursor::new(scan.get(body, CHUNK_HEAD.min(length))?);
    head.take(16)?;
    let size = head.u64()?;
    let crc = head.u32()?;
    let name_length = u64::from(head.u32()?);
    let head_length = CHUNK_HEAD + name_length + 8;
    if name_length > LONGEST_NAME || head_length > length {
        return Err(Mismatch::new(
            format!("a name of a compression of at most {LONGEST_NAME} bytes"),
            format!("{name_length} bytes"),
        )
        .into());
    }
    let mut tail = Cursor::new(scan.get(body + CHUNK_HEAD - 4, 4 + name_length + 8)?);
    let compression = Compression::from_name(&tail.text()?)?;
    let stored = tail.u64()?;
    if stored > length - head_length {
        return Err(Mismatch::new(
            format!("a chunk with {stored} stored bytes"),
            format!("{} left in its record", length - head_length),
        )
        .into());
    }
    Ok(Chunk {
        offset: body + head_length,
        stored,
        size,
        compression,
        crc,
    })
}

/// A time of the format, which has no sign; times after the year 2262 are cut.
fn signed(time_ns: u64) -> i64 {
    i64::try_from(time_ns).unwrap_or(i64::MAX)
}
