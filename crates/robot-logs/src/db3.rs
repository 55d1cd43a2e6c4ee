//! ROS 2 bags in SQLite: a table of topics and a table of messages.
//!
//! Source: `rosbag2_storage_default_plugins` (sqlite3), whose tables are `topics(id, name, type, serialization_format,
//! ...)` and `messages(id, topic_id, timestamp, data)`. Columns are found by their names, since later versions added some.

use crate::contents::{Channel, Contents, Entry, Place, Serialisation};
use crate::error::{LogError, Mismatch};
use crate::sqlite::{Database, Table, Value};

/// Bytes of a row that hold all of its columns but the message itself: a few numbers.
const ROW_HEAD: u64 = 64;

/// The places of the columns that are read.
#[derive(Debug)]
pub(crate) struct Messages {
    database: Database,
    table: Table,
    data: usize,
}

impl Messages {
    /// Reads the tables of a database.
    pub(crate) fn scan(database: Database) -> Result<(Self, Contents), LogError> {
        let mut contents = Contents::default();
        let (topics, [id, name, type_name, format]) = named_table(
            &database,
            "topics",
            ["id", "name", "type", "serialization_format"],
        )?;
        database.walk(topics.root, u64::MAX, &mut |rowid, row| {
            let values = row.values()?;
            let text = |index: usize| match values.get(index) {
                Some(Value::Text(text)) => text.clone(),
                _ => String::new(),
            };
            let key = integer(&values, id).unwrap_or(rowid);
            if let Ok(key) = u32::try_from(key) {
                contents.channels.insert(
                    key,
                    Channel {
                        topic: text(name),
                        type_name: text(type_name),
                        serialisation: (text(format) == "cdr").then_some(Serialisation::Cdr),
                    },
                );
            }
            Ok(())
        })?;
        let (table, [topic, time, data]) =
            named_table(&database, "messages", ["topic_id", "timestamp", "data"])?;
        let walked = database.walk(table.root, ROW_HEAD, &mut |rowid, row| {
            let values = row.values()?;
            let channel = integer(&values, topic).and_then(|id| u32::try_from(id).ok());
            if let (Some(channel), Some(time_ns)) = (channel, integer(&values, time)) {
                contents.entries.push(Entry {
                    channel,
                    time_ns,
                    place: Place::Row(rowid),
                });
            }
            Ok(())
        });
        if let Err(error) = walked {
            contents.notes.push(format!(
                "{error}: the {} messages before it are read, and `sqlite3 BAG.db3 .recover` saves what lies behind",
                contents.entries.len()
            ));
        }
        let messages = Self {
            database,
            table,
            data,
        };
        Ok((messages, contents))
    }

    /// The first `most` bytes of a message, or all where they are fewer.
    pub(crate) fn message(&self, rowid: i64, most: u64) -> Result<Vec<u8>, LogError> {
        let damaged = |mismatch| self.database.damaged(self.table.root, mismatch);
        let row = self
            .database
            .find(self.table.root, rowid, most.saturating_add(ROW_HEAD))?
            .ok_or_else(|| {
                damaged(Mismatch::new(
                    format!("message {rowid} in the table"),
                    "none",
                ))
            })?;
        match row.values().map_err(damaged)?.get(self.data) {
            Some(&Value::Blob { start, length }) => {
                let wanted = length.min(usize::try_from(most).unwrap_or(usize::MAX));
                let end = (start + wanted).min(row.bytes.len());
                Ok(row.bytes[start.min(end)..end].to_vec())
            }
            _ => Err(damaged(Mismatch::new(
                format!("the bytes of message {rowid}"),
                "another value",
            ))),
        }
    }
}

fn integer(values: &[Value], index: usize) -> Option<i64> {
    match values.get(index) {
        Some(Value::Integer(value)) => Some(*value),
        _ => None,
    }
}

/// A table of a recorder and the places of its columns.
fn named_table<const N: usize>(
    database: &Database,
    name: &str,
    columns: [&str; N],
) -> Result<(Table, [usize; N]), LogError> {
    let missing = |found: String| LogError::Kind {
        path: database.path().to_path_buf(),
        expected: format!("a ROS 2 bag with a table {name:?}"),
        found,
    };
    let table = database
        .table(name)?
        .ok_or_else(|| missing("a database without it".into()))?;
    let mut places = [0; N];
    for (place, column) in places.iter_mut().zip(columns) {
        *place = table
            .column(column)
            .ok_or_else(|| missing(format!("one without column {column:?}")))?;
    }
    Ok((table, places))
}
