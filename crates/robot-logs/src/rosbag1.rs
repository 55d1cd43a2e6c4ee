//! ROS 1 bags of version 2.0: records with named fields, messages in chunks, an index behind each chunk.
//!
//! A file is `#ROSBAG V2.0`, a bag header, chunks (`op` 5) each followed by one index record (`op` 4) per connection, and
//! at the end the connections (`op` 7) and chunk infos (`op` 6) again. A record is a length, a header of `name=value`
//! fields with their lengths, a length, data. Source: the format's description at wiki.ros.org/Bags/Format/2.0.
//!
//! The file is walked record by record from its beginning: the data of a chunk is stepped over, its index read. A chunk
//! without index (the recorder was killed) is decompressed and walked itself. So a bag needs no index of its own, and one
//! that is cut is read as far as it goes.

use crate::bytes::Cursor;
use crate::contents::{Channel, Chunk, Contents, Entry, Place, Records, Serialisation};
use crate::decompress::Compression;
use crate::error::{LogError, Mismatch};
use crate::source::{Scan, Source};

/// First bytes of a bag of any version.
pub(crate) const MAGIC: &[u8] = b"#ROSBAG V";
/// First bytes of a bag of version 2.0, the line end included.
const MAGIC_2: &[u8] = b"#ROSBAG V2.0\n";

const OP_MESSAGE: u8 = 2;
const OP_BAG_HEADER: u8 = 3;
const OP_INDEX: u8 = 4;
const OP_CHUNK: u8 = 5;
const OP_CHUNK_INFO: u8 = 6;
const OP_CONNECTION: u8 = 7;

/// Longest believed header of a record, in bytes; that of a connection holds a topic, no message definition.
const LONGEST_HEADER: u64 = 1 << 20;

/// Reads the table of contents.
pub(crate) fn scan(source: &Source) -> Result<Contents, LogError> {
    let magic = source.read(0, source.length().min(MAGIC_2.len() as u64))?;
    if magic != MAGIC_2 {
        let version: String = String::from_utf8_lossy(&magic)
            .chars()
            .skip(MAGIC.len())
            .take_while(|sign| !sign.is_control())
            .collect();
        return Err(LogError::Kind {
            path: source.path().to_path_buf(),
            expected: "a ROS 1 bag of version 2.0".into(),
            found: format!("version {version:?}; `rosbag fix` writes the new one"),
        });
    }
    let mut contents = Contents::default();
    let mut indexed: Vec<bool> = Vec::new();
    let mut scan = Scan::new(source);
    let mut at = MAGIC_2.len() as u64;
    let mut fault = None;
    while at < source.length() {
        match step(source, &mut scan, at, &mut contents, &mut indexed) {
            Ok(next) => at = next,
            Err(error) => {
                fault = Some(error);
                break;
            }
        }
    }
    fill_gaps(source, &mut contents, &indexed);
    if let Some(error) = fault {
        contents.notes.push(format!(
            "{error}: the {} messages before it are read, and `rosbag reindex` mends a bag whose recorder was stopped hard",
            contents.entries.len()
        ));
    }
    Ok(contents)
}

/// Takes in one record of the file; returns the place behind it.
fn step(
    source: &Source,
    scan: &mut Scan<'_>,
    at: u64,
    contents: &mut Contents,
    indexed: &mut Vec<bool>,
) -> Result<u64, LogError> {
    let damaged = |mismatch| source.damaged(at, mismatch);
    let header_length = length(scan.get(at, 4)?);
    if header_length > LONGEST_HEADER {
        return Err(damaged(Mismatch::new(
            format!("a record header of at most {LONGEST_HEADER} bytes"),
            format!("{header_length}"),
        )));
    }
    let fields = Fields::parse(scan.get(at + 4, header_length)?).map_err(damaged)?;
    let data_at = at + 4 + header_length + 4;
    let data_length = length(scan.get(data_at - 4, 4)?);
    let end = data_at + data_length;
    if end > source.length() {
        return Err(damaged(Mismatch::new(
            format!("a record of {data_length} bytes"),
            format!("{} left", source.length() - data_at),
        )));
    }
    match fields.op {
        OP_CHUNK => {
            let name = String::from_utf8_lossy(fields.compression.as_deref().unwrap_or_default());
            contents.chunks.push(Chunk {
                offset: data_at,
                stored: data_length,
                size: u64::from(fields.size.unwrap_or_default()),
                compression: Compression::from_name(&name).map_err(damaged)?,
                crc: 0,
            });
            indexed.push(data_length == 0);
        }
        OP_INDEX => {
            let data = scan.get(data_at, data_length)?;
            let chunk =
                contents.chunks.len().checked_sub(1).ok_or_else(|| {
                    damaged(Mismatch::new("a chunk before its index", "the index"))
                })?;
            let channel = fields.connection().map_err(damaged)?;
            for row in data.chunks_exact(12) {
                let mut cursor = Cursor::new(row);
                let time_ns = time(&mut cursor).map_err(damaged)?;
                contents.entries.push(Entry {
                    channel,
                    time_ns,
                    place: Place::Chunk {
                        chunk: u32::try_from(chunk).unwrap_or(u32::MAX),
                        offset: u64::from(cursor.u32().map_err(damaged)?),
                    },
                });
            }
            indexed[chunk] = true;
        }
        OP_CONNECTION => {
            let data = scan.get(data_at, data_length)?;
            connection(&fields, data, contents).map_err(damaged)?;
        }
        // The chunk that a killed recorder was filling has length zero; its messages follow as records of the file.
        OP_MESSAGE => contents.entries.push(Entry {
            channel: fields.connection().map_err(damaged)?,
            time_ns: fields.time_ns.unwrap_or_default(),
            place: Place::File(at),
        }),
        OP_BAG_HEADER | OP_CHUNK_INFO => {}
        other => {
            return Err(damaged(Mismatch::new(
                "a record of a bag (op 2 to 7)",
                format!("op {other}"),
            )));
        }
    }
    Ok(end)
}

/// Decompresses the chunks that have no index, or hold messages of connections that stand nowhere else.
fn fill_gaps(source: &Source, contents: &mut Contents, indexed: &[bool]) {
    let mut wanted: Vec<bool> = indexed.iter().map(|&known| !known).collect();
    for entry in &contents.entries {
        if let Place::Chunk { chunk, .. } = entry.place
            && !contents.channels.contains_key(&entry.channel)
        {
            wanted[chunk as usize] = true;
        }
    }
    for (index, _) in wanted.iter().enumerate().filter(|(_, wanted)| **wanted) {
        let chunk = contents.chunks[index];
        let result = chunk.load(source).and_then(|bytes| {
            walk_chunk(&bytes, index, !indexed[index], contents)
                .map_err(|mismatch| source.damaged(chunk.offset, mismatch))
        });
        if let Err(error) = result {
            contents
                .notes
                .push(format!("{error}: this chunk is left out"));
        }
    }
}

/// Takes in the connections of a chunk and, where it has no index, its messages.
fn walk_chunk(
    bytes: &[u8],
    index: usize,
    with_messages: bool,
    contents: &mut Contents,
) -> Result<(), Mismatch> {
    let mut cursor = Cursor::new(bytes);
    while cursor.left() > 0 {
        let offset = cursor.position() as u64;
        let fields = Fields::parse(cursor.block()?)?;
        let data = cursor.block()?;
        match fields.op {
            OP_CONNECTION => connection(&fields, data, contents)?,
            OP_MESSAGE if with_messages => contents.entries.push(Entry {
                channel: fields.connection()?,
                time_ns: fields.time_ns.unwrap_or_default(),
                place: Place::Chunk {
                    chunk: u32::try_from(index).unwrap_or(u32::MAX),
                    offset,
                },
            }),
            _ => {}
        }
    }
    Ok(())
}

/// Place and length of the data of the message record at `offset`.
pub(crate) fn locate(records: Records<'_>, offset: u64) -> Result<(u64, u64), LogError> {
    let damaged = |mismatch| records.damaged(offset, mismatch);
    let header_length = length(&records.get(offset, 4)?);
    let header_at = offset.saturating_add(4);
    if header_length > LONGEST_HEADER {
        return Err(damaged(Mismatch::new(
            format!("a record header of at most {LONGEST_HEADER} bytes"),
            format!("{header_length}"),
        )));
    }
    let header = records.get(header_at, header_length)?;
    let op = Fields::parse(&header).map_err(damaged)?.op;
    if op != OP_MESSAGE {
        return Err(damaged(Mismatch::new(
            "a message (op 2)",
            format!("op {op}"),
        )));
    }
    let data_at = header_at + header_length + 4;
    Ok((data_at, length(&records.get(data_at - 4, 4)?)))
}

fn length(bytes: &[u8]) -> u64 {
    let mut four = [0; 4];
    four.copy_from_slice(&bytes[..4]);
    u64::from(u32::from_le_bytes(four))
}

/// Seconds and nanoseconds as nanoseconds.
fn time(cursor: &mut Cursor<'_>) -> Result<i64, Mismatch> {
    let seconds = i64::from(cursor.u32()?);
    Ok(seconds * 1_000_000_000 + i64::from(cursor.u32()?))
}

/// Takes in a connection; the topic of the record's header counts, the data hold the type.
fn connection(fields: &Fields, data: &[u8], contents: &mut Contents) -> Result<(), Mismatch> {
    let of_data = Fields::parse(data)?;
    let text = |bytes: &Option<Vec<u8>>| {
        String::from_utf8_lossy(bytes.as_deref().unwrap_or_default()).into_owned()
    };
    contents.channels.insert(
        fields.connection()?,
        Channel {
            topic: text(&fields.topic),
            type_name: text(&of_data.type_name),
            serialisation: Some(Serialisation::Ros1),
        },
    );
    Ok(())
}

/// The fields of a record's header that are read.
#[derive(Debug, Default)]
struct Fields {
    op: u8,
    conn: Option<u32>,
    time_ns: Option<i64>,
    size: Option<u32>,
    compression: Option<Vec<u8>>,
    topic: Option<Vec<u8>>,
    type_name: Option<Vec<u8>>,
}

impl Fields {
    fn parse(header: &[u8]) -> Result<Self, Mismatch> {
        let mut fields = Self::default();
        let mut cursor = Cursor::new(header);
        while cursor.left() > 0 {
            let field = cursor.block()?;
            let Some(equals) = field.iter().position(|&byte| byte == b'=') else {
                return Err(Mismatch::new("a field name=value", "no equals sign"));
            };
            let value = &field[equals + 1..];
            let mut number = Cursor::new(value);
            match &field[..equals] {
                b"op" => fields.op = number.u8()?,
                b"conn" => fields.conn = Some(number.u32()?),
                b"time" => fields.time_ns = Some(time(&mut number)?),
                b"size" => fields.size = Some(number.u32()?),
                b"compression" => fields.compression = Some(value.to_vec()),
                b"topic" => fields.topic = Some(value.to_vec()),
                b"type" => fields.type_name = Some(value.to_vec()),
                _ => {}
            }
        }
        Ok(fields)
    }

    fn connection(&self) -> Result<u32, Mismatch> {
        self.conn
            .ok_or_else(|| Mismatch::new("a record with a connection", "none"))
    }
}
