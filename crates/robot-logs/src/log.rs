//! A log as a list of topics and of messages in the order of their times.

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use crate::contents::{Chunk, Contents, Place, Records, Serialisation};
use crate::db3::Messages;
use crate::decompress::{Compression, zstd_message};
use crate::error::{LogError, Mismatch};
use crate::folder;
use crate::message::{self, Message, MessageKind};
use crate::source::Source;
use crate::sqlite::{self, Database};
use crate::{mcap, rosbag1};

/// First bytes of a file compressed as a whole by Zstandard.
const ZSTD_MAGIC: &[u8] = &[0x28, 0xb5, 0x2f, 0xfd];
/// Bytes that hold the encapsulation and the time stamp of a message with a header.
const STAMP_BYTES: u64 = 16;

/// The container of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LogFormat {
    /// A ROS 1 bag.
    Rosbag1,
    /// An MCAP file.
    Mcap,
    /// A ROS 2 bag in SQLite.
    Sqlite,
}

impl fmt::Display for LogFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rosbag1 => "ROS 1 bag",
            Self::Mcap => "MCAP file",
            Self::Sqlite => "ROS 2 bag (sqlite3)",
        })
    }
}

/// A topic of a log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topic {
    /// Name, as `/camera/image_raw`.
    pub name: String,
    /// Name of the type as the log has it, as `sensor_msgs/msg/Image`.
    pub type_name: String,
    /// The type, if it is one of those that are read.
    pub kind: Option<MessageKind>,
    /// Number of messages.
    pub messages: usize,
    /// Log time of the first message in nanoseconds; zero without messages.
    pub first_ns: i64,
    /// Log time of the last message in nanoseconds; zero without messages.
    pub last_ns: i64,
    serialisation: Option<Serialisation>,
}

/// A message of a log: its topic, its time, and where its bytes are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MessageHandle {
    time_ns: i64,
    topic: u32,
    part: u32,
    place: Place,
}

impl MessageHandle {
    /// Time at which the recorder received the message, in nanoseconds.
    pub fn log_time_ns(&self) -> i64 {
        self.time_ns
    }

    /// Index of the topic in [`RobotLog::topics`].
    pub fn topic(&self) -> usize {
        self.topic as usize
    }
}

/// An open log; messages are read and decoded on demand.
#[derive(Debug)]
pub struct RobotLog {
    format: LogFormat,
    topics: Vec<Topic>,
    parts: Vec<Part>,
    /// Messages of the types that are read, in the order of their times.
    handles: Vec<MessageHandle>,
    notes: Vec<String>,
    /// The chunk read last.
    cache: Mutex<Option<CachedChunk>>,
}

/// Part and number of a chunk, and its bytes.
type CachedChunk = ((u32, u32), Arc<Vec<u8>>);

/// One file.
#[derive(Debug)]
struct Part {
    path: PathBuf,
    store: Store,
    zstd_messages: bool,
}

/// A container with what is needed to find a message.
#[derive(Debug)]
enum Store {
    Rosbag1(Source, Vec<Chunk>),
    Mcap(Source, Vec<Chunk>),
    Sqlite(Messages),
}

impl RobotLog {
    /// Whether `path` is a file that begins like a log, or a folder that holds one.
    pub fn recognises(path: &Path) -> bool {
        if path.is_dir() {
            return folder::is_log(path);
        }
        let magic = Source::open(path).and_then(|source| head(&source));
        magic.is_ok_and(|magic| LogFormat::of(&magic).is_some())
    }

    /// Opens a log: a `.bag`, `.mcap` or `.db3` file, whatever its name is, or a folder with the files of one.
    ///
    /// The records are walked once, over the data of chunks without reading them; memory grows with the number of
    /// messages, 40 bytes each, not with their sizes.
    ///
    /// # Errors
    /// [`LogError`] when a file cannot be read, is no log, is compressed as a whole, or is damaged before its first
    /// message. A file that is damaged later is read up to there, with a sentence in [`RobotLog::notes`].
    pub fn open(path: &Path) -> Result<Self, LogError> {
        let metadata = path.file_name().is_some_and(|name| name == "metadata.yaml");
        let folder = match path.parent() {
            Some(parent) if metadata && !parent.as_os_str().is_empty() => parent,
            Some(_) if metadata => Path::new("."),
            _ => path,
        };
        if !folder.is_dir() {
            return Self::of_sources(vec![Source::open(path)?], false);
        }
        let files = folder::files(folder)?;
        let sources = files.paths.iter().map(|path| Source::open(path));
        Self::of_sources(sources.collect::<Result<_, _>>()?, files.zstd_messages)
    }

    /// Opens a log that is held in memory; `name` stands for its path in messages.
    ///
    /// # Errors
    /// As [`RobotLog::open`].
    pub fn from_bytes(name: &str, bytes: Vec<u8>) -> Result<Self, LogError> {
        Self::of_sources(vec![Source::in_memory(Path::new(name), bytes)], false)
    }

    fn of_sources(sources: Vec<Source>, zstd_messages: bool) -> Result<Self, LogError> {
        let mut log = Self {
            format: LogFormat::Mcap,
            topics: Vec::new(),
            parts: Vec::new(),
            handles: Vec::new(),
            notes: Vec::new(),
            cache: Mutex::new(None),
        };
        for source in sources {
            log.add(source, zstd_messages)?;
        }
        // Equal times stay in the order of the file.
        log.handles
            .sort_by_key(|handle| (handle.time_ns, handle.part, handle.place));
        Ok(log)
    }

    /// Takes in one file.
    fn add(&mut self, source: Source, zstd_messages: bool) -> Result<(), LogError> {
        let path = source.path().to_path_buf();
        let wrong = |found: &str| LogError::Kind {
            path: path.clone(),
            expected: "a ROS 1 bag, an MCAP file or an SQLite file of a ROS 2 bag".into(),
            found: found.into(),
        };
        let magic = head(&source)?;
        let format = LogFormat::of(&magic).ok_or_else(|| {
            wrong(if magic.is_empty() {
                "an empty file"
            } else if magic.starts_with(ZSTD_MAGIC) {
                "a file compressed as a whole by zstd; `zstd -d` unpacks it"
            } else {
                "other bytes"
            })
        })?;
        self.format = format;
        let (store, contents) = match format {
            LogFormat::Rosbag1 => {
                let contents = rosbag1::scan(&source)?;
                (Store::Rosbag1(source, contents.chunks.clone()), contents)
            }
            LogFormat::Mcap => {
                let contents = mcap::scan(&source)?;
                (Store::Mcap(source, contents.chunks.clone()), contents)
            }
            LogFormat::Sqlite => {
                let (messages, contents) = Messages::scan(Database::open(source)?)?;
                (Store::Sqlite(messages), contents)
            }
        };
        let Contents {
            channels,
            entries,
            notes,
            ..
        } = contents;
        if entries.is_empty()
            && let Some(note) = notes.first()
        {
            return Err(LogError::Kind {
                path,
                expected: "a log with messages".into(),
                found: format!("none that can be read ({note})"),
            });
        }
        self.notes.extend(notes);
        let part = u32::try_from(self.parts.len()).unwrap_or(u32::MAX);
        let mut places = BTreeMap::new();
        for (key, channel) in channels {
            let kind = MessageKind::from_type_name(&channel.type_name)
                .filter(|_| channel.serialisation.is_some());
            let known = self.topics.iter().position(|topic| {
                topic.name == channel.topic
                    && topic.type_name == channel.type_name
                    && topic.serialisation == channel.serialisation
            });
            let index = known.unwrap_or_else(|| {
                self.topics.push(Topic {
                    name: channel.topic,
                    type_name: channel.type_name,
                    kind,
                    messages: 0,
                    first_ns: 0,
                    last_ns: 0,
                    serialisation: channel.serialisation,
                });
                self.topics.len() - 1
            });
            places.insert(key, index);
        }
        let mut strangers = 0_usize;
        for entry in entries {
            let Some(&index) = places.get(&entry.channel) else {
                strangers += 1;
                continue;
            };
            let topic = &mut self.topics[index];
            if topic.messages == 0 {
                (topic.first_ns, topic.last_ns) = (entry.time_ns, entry.time_ns);
            }
            topic.messages += 1;
            topic.first_ns = topic.first_ns.min(entry.time_ns);
            topic.last_ns = topic.last_ns.max(entry.time_ns);
            if topic.kind.is_some() {
                self.handles.push(MessageHandle {
                    time_ns: entry.time_ns,
                    topic: u32::try_from(index).unwrap_or(u32::MAX),
                    part,
                    place: entry.place,
                });
            }
        }
        if strangers > 0 {
            self.notes.push(format!(
                "{}: {strangers} messages of topics that are described nowhere are left out",
                path.display()
            ));
        }
        self.parts.push(Part {
            path,
            store,
            zstd_messages,
        });
        Ok(())
    }

    /// The container of the log.
    pub fn format(&self) -> LogFormat {
        self.format
    }

    /// All topics, those of types that are not read included.
    pub fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// Sentences about files that are damaged or were not finished.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The files.
    pub fn files(&self) -> impl Iterator<Item = &Path> {
        self.parts.iter().map(|part| part.path.as_path())
    }

    /// Messages of the topics with these indices, in the order of their log times. Topics of types that are not read give
    /// none. Time O(messages of the log).
    pub fn handles(&self, topics: &[usize]) -> impl Iterator<Item = MessageHandle> {
        self.handles
            .iter()
            .filter(|handle| topics.contains(&handle.topic()))
            .copied()
    }

    /// The time stamp in the header of a message, in nanoseconds, zero where the sender did not set it; `None` where the
    /// type has no header. Of a message that is not in a compressed chunk only the first bytes are read.
    ///
    /// # Errors
    /// [`LogError`] when the bytes cannot be read or are too few.
    pub fn stamp_ns(&self, handle: &MessageHandle) -> Result<Option<i64>, LogError> {
        let (kind, serialisation) = self.type_of(handle)?;
        if !kind.has_header() {
            return Ok(None);
        }
        let bytes = self.read(handle, STAMP_BYTES)?;
        message::stamp(serialisation, &bytes)
            .map(Some)
            .map_err(|mismatch| self.fault(handle, mismatch))
    }

    /// Reads and decodes a message. One chunk after decompression is kept, so that messages read in their order cost each
    /// chunk once.
    ///
    /// # Errors
    /// [`LogError`] when the bytes cannot be read or are not those of the type.
    pub fn message(&self, handle: &MessageHandle) -> Result<Message, LogError> {
        let (kind, serialisation) = self.type_of(handle)?;
        let bytes = self.read(handle, u64::MAX)?;
        message::decode(kind, serialisation, &bytes)
            .map_err(|mismatch| self.fault(handle, mismatch))
    }

    fn type_of(&self, handle: &MessageHandle) -> Result<(MessageKind, Serialisation), LogError> {
        let topic = self.topics.get(handle.topic());
        topic
            .and_then(|topic| topic.kind.zip(topic.serialisation))
            .ok_or_else(|| self.fault(handle, Mismatch::new("a message of this log", "another")))
    }

    fn fault(&self, handle: &MessageHandle, mismatch: Mismatch) -> LogError {
        let path = self.parts.get(handle.part as usize);
        let topic = self.topics.get(handle.topic());
        LogError::Message {
            path: path.map(|part| part.path.clone()).unwrap_or_default(),
            topic: topic.map(|topic| topic.name.clone()).unwrap_or_default(),
            time_s: handle.time_ns as f64 * 1e-9,
            expected: mismatch.expected,
            found: mismatch.found,
        }
    }

    /// The first `most` bytes of a message, or all where they are fewer.
    fn read(&self, handle: &MessageHandle, most: u64) -> Result<Vec<u8>, LogError> {
        let part = self
            .parts
            .get(handle.part as usize)
            .ok_or_else(|| self.fault(handle, Mismatch::new("a message of this log", "another")))?;
        // Only the whole can be decompressed.
        let wanted = if part.zstd_messages { u64::MAX } else { most };
        let bytes = match (&part.store, handle.place) {
            (Store::Rosbag1(source, chunks), place) => {
                self.read_record(source, chunks, handle.part, place, wanted, rosbag1::locate)?
            }
            (Store::Mcap(source, chunks), place) => {
                self.read_record(source, chunks, handle.part, place, wanted, mcap::locate)?
            }
            (Store::Sqlite(messages), Place::Row(row)) => messages.message(row, wanted)?,
            (Store::Sqlite(_), _) => {
                return Err(self.fault(handle, Mismatch::new("a row", "another place")));
            }
        };
        if part.zstd_messages {
            return zstd_message(&bytes).map_err(|mismatch| self.fault(handle, mismatch));
        }
        Ok(bytes)
    }

    /// The first `most` bytes of the message record at `place`.
    fn read_record(
        &self,
        source: &Source,
        chunks: &[Chunk],
        part: u32,
        place: Place,
        most: u64,
        locate: fn(Records<'_>, u64) -> Result<(u64, u64), LogError>,
    ) -> Result<Vec<u8>, LogError> {
        let outside = || source.damaged(0, Mismatch::new("a chunk of this log", "another"));
        let read = |records: Records<'_>, offset| {
            let (at, length) = locate(records, offset)?;
            Ok(records.get(at, length.min(most))?.into_owned())
        };
        match place {
            Place::File(offset) => read(Records::File(source), offset),
            Place::Chunk { chunk, offset } => {
                let description = chunks.get(chunk as usize).ok_or_else(outside)?;
                if description.compression == Compression::None {
                    if offset >= description.stored {
                        return Err(outside());
                    }
                    return read(Records::File(source), description.offset + offset);
                }
                let bytes = self.chunk(source, (part, chunk), description)?;
                let at = description.offset;
                read(
                    Records::Chunk {
                        source,
                        at,
                        bytes: &bytes,
                    },
                    offset,
                )
            }
            Place::Row(_) => Err(outside()),
        }
    }

    /// A chunk after decompression, from the cache if it was the last one.
    fn chunk(
        &self,
        source: &Source,
        key: (u32, u32),
        chunk: &Chunk,
    ) -> Result<Arc<Vec<u8>>, LogError> {
        let mut cache = self.cache.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((cached, bytes)) = &*cache
            && *cached == key
        {
            return Ok(Arc::clone(bytes));
        }
        *cache = None;
        let bytes = Arc::new(chunk.load(source)?);
        *cache = Some((key, Arc::clone(&bytes)));
        Ok(bytes)
    }
}

impl LogFormat {
    /// The format of the first bytes of a file.
    fn of(magic: &[u8]) -> Option<Self> {
        if magic.starts_with(rosbag1::MAGIC) {
            Some(Self::Rosbag1)
        } else if magic.starts_with(mcap::MAGIC) {
            Some(Self::Mcap)
        } else if magic.starts_with(sqlite::MAGIC) {
            Some(Self::Sqlite)
        } else {
            None
        }
    }
}

/// The first bytes of a file.
fn head(source: &Source) -> Result<Vec<u8>, LogError> {
    source.read(0, source.length().min(sqlite::MAGIC.len() as u64))
}
