//! Tables of an SQLite 3 file, read only: as much of the format as a recorder's database needs, without SQLite.
//!
//! Source: the file format at sqlite.org/fileformat2.html. A table is a B-tree of pages; a leaf holds rows (`rowid`,
//! record), a record is a list of types and then of values, and the end of a long row lies in a chain of overflow pages.
//! Pages that a recorder had not yet moved from its write-ahead log (`-wal`) into the database are read from there
//! ([`wal`]). Indexes, `WITHOUT ROWID` tables and virtual tables are not read.
//!
//! Nothing in the file is believed: page numbers, cell places and lengths are compared with the page and the file, and no
//! walk visits more pages than there are, so that a ring of pages ends.

mod record;
mod wal;

use std::path::Path;

use crate::error::{LogError, Mismatch};
use crate::source::Source;
use record::{Row, varint};
use wal::WriteAheadLog;

pub(crate) use record::Value;

/// First bytes of a database.
pub(crate) const MAGIC: &[u8] = b"SQLite format 3\0";

/// Bytes of the file header, before the first page's own.
const FILE_HEADER: usize = 100;
const LEAF: u8 = 0x0d;
const INTERIOR: u8 = 0x05;
/// Deepest believed tree; the format's largest file needs 20.
const DEEPEST: usize = 40;

/// An open database.
#[derive(Debug)]
pub(crate) struct Database {
    source: Source,
    wal: Option<WriteAheadLog>,
    page_size: u64,
    /// Bytes of a page that hold contents.
    usable: usize,
    pages: u64,
}

/// A table's root page and the names of its columns, in order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Table {
    pub(crate) root: u64,
    pub(crate) columns: Vec<String>,
}

impl Table {
    /// Position of a column.
    pub(crate) fn column(&self, name: &str) -> Option<usize> {
        self.columns
            .iter()
            .position(|column| column.eq_ignore_ascii_case(name))
    }
}

impl Database {
    /// Opens the database in `source`; its write-ahead log is looked for beside it.
    pub(crate) fn open(source: Source) -> Result<Self, LogError> {
        let damaged = |expected: &str, found: String| {
            source.damaged(0, Mismatch::new(expected.to_string(), found))
        };
        let header = source.read(0, FILE_HEADER as u64)?;
        if !header.starts_with(MAGIC) {
            return Err(damaged("an SQLite 3 database", "other bytes".into()));
        }
        let page_size = match u16::from_be_bytes([header[16], header[17]]) {
            1 => 65536,
            size if size >= 512 && size.is_power_of_two() => u64::from(size),
            size => return Err(damaged("a page size of 512 to 65536", size.to_string())),
        };
        let reserved = usize::from(header[20]);
        let usable = usize::try_from(page_size).unwrap_or(0) - reserved;
        if usable < 480 {
            return Err(damaged(
                "480 or more usable bytes a page",
                usable.to_string(),
            ));
        }
        if !matches!(header[56..60], [0, 0, 0, 0 | 1]) {
            return Err(damaged("text in UTF-8", "text in UTF-16".into()));
        }
        let wal = WriteAheadLog::beside(&source, page_size)?;
        let stored = source.length().div_ceil(page_size);
        let pages = stored.max(wal.as_ref().map_or(0, WriteAheadLog::pages));
        Ok(Self {
            source,
            wal,
            page_size,
            usable,
            pages,
        })
    }

    /// The file.
    pub(crate) fn path(&self) -> &Path {
        self.source.path()
    }

    /// The table of a name.
    pub(crate) fn table(&self, name: &str) -> Result<Option<Table>, LogError> {
        let mut found = None;
        self.walk(1, u64::MAX, &mut |_, row| {
            let values = row.values()?;
            if let [
                Value::Text(kind),
                Value::Text(own),
                _,
                Value::Integer(root),
                Value::Text(sql),
                ..,
            ] = &values[..]
                && kind == "table"
                && own.eq_ignore_ascii_case(name)
            {
                found = Some(Table {
                    root: u64::try_from(*root).unwrap_or(0),
                    columns: columns(sql),
                });
            }
            Ok(())
        })?;
        Ok(found)
    }

    /// Calls `each` with the `rowid` and every row of the tree at page `root`, in the order of the `rowid`; of each record
    /// at least the first `bytes`. A fault ends the walk; the rows before it have been given.
    pub(crate) fn walk(
        &self,
        root: u64,
        bytes: u64,
        each: &mut dyn FnMut(i64, &Row) -> Result<(), Mismatch>,
    ) -> Result<(), LogError> {
        let mut visited = 0;
        let mut waiting = vec![(root, 0)];
        while let Some((number, depth)) = waiting.pop() {
            visited += 1;
            if visited > self.pages || depth > DEEPEST {
                return Err(self.damaged(
                    number,
                    Mismatch::new("a tree of pages", "pages that refer to one another"),
                ));
            }
            let page = self.page(number)?;
            if page.leaf {
                for cell in 0..page.cells {
                    let row = self.row(&page, cell, bytes)?;
                    each(row.rowid, &row).map_err(|mismatch| self.damaged(number, mismatch))?;
                }
            } else {
                let children = page
                    .children()
                    .map_err(|mismatch| self.damaged(number, mismatch))?;
                waiting.extend(
                    children
                        .into_iter()
                        .rev()
                        .map(|(child, _)| (child, depth + 1)),
                );
            }
        }
        Ok(())
    }

    /// The row `rowid` of the tree at page `root`, whole or at least its first `bytes`.
    pub(crate) fn find(&self, root: u64, rowid: i64, bytes: u64) -> Result<Option<Row>, LogError> {
        let mut number = root;
        for _ in 0..DEEPEST {
            let page = self.page(number)?;
            let damaged = |mismatch| self.damaged(number, mismatch);
            if page.leaf {
                for cell in 0..page.cells {
                    let (own, _) = page.rowid(cell).map_err(damaged)?;
                    if own == rowid {
                        return self.row(&page, cell, bytes).map(Some);
                    }
                }
                return Ok(None);
            }
            let children = page.children().map_err(damaged)?;
            match children
                .iter()
                .find(|(_, largest)| largest.is_none_or(|largest| rowid <= largest))
            {
                Some(&(child, _)) => number = child,
                None => return Ok(None),
            }
        }
        Err(self.damaged(
            number,
            Mismatch::new("a tree of pages", "pages that refer to one another"),
        ))
    }

    /// A fault on page `number`.
    pub(crate) fn damaged(&self, number: u64, mismatch: Mismatch) -> LogError {
        let offset = number.saturating_sub(1).saturating_mul(self.page_size);
        self.source.damaged(offset, mismatch)
    }

    /// Bytes of a page, from the write-ahead log where it has a newer copy.
    fn bytes(&self, number: u64) -> Result<Vec<u8>, LogError> {
        if number == 0 || number > self.pages {
            return Err(self.damaged(
                number,
                Mismatch::new(
                    format!("a page from 1 to {}", self.pages),
                    format!("page {number}"),
                ),
            ));
        }
        match self.wal.as_ref().map(|wal| wal.page(number)) {
            Some(Some(page)) => page,
            _ => self
                .source
                .read((number - 1) * self.page_size, self.page_size),
        }
    }

    fn page(&self, number: u64) -> Result<Page, LogError> {
        let bytes = self.bytes(number)?;
        let header = if number == 1 { FILE_HEADER } else { 0 };
        let leaf = match bytes[header] {
            LEAF => true,
            INTERIOR => false,
            kind => {
                return Err(self.damaged(
                    number,
                    Mismatch::new(
                        "a page of a table (kind 5 or 13)",
                        format!("kind {kind} on page {number}"),
                    ),
                ));
            }
        };
        let cells = usize::from(u16::from_be_bytes([bytes[header + 3], bytes[header + 4]]));
        let pointers = header + if leaf { 8 } else { 12 };
        if pointers + 2 * cells > bytes.len() {
            return Err(self.damaged(
                number,
                Mismatch::new("cells within the page", format!("{cells} cells")),
            ));
        }
        Ok(Page {
            number,
            bytes,
            header,
            leaf,
            cells,
            pointers,
        })
    }

    /// A row of a leaf; of its record at least the first `wanted` bytes, or all where they are fewer.
    fn row(&self, page: &Page, cell: usize, wanted: u64) -> Result<Row, LogError> {
        let damaged = |mismatch| self.damaged(page.number, mismatch);
        let (rowid, (length, start)) = page.rowid(cell).map_err(damaged)?;
        let length = usize::try_from(length)
            .ok()
            .filter(|&length| length as u64 <= self.pages * self.page_size)
            .ok_or_else(|| {
                damaged(Mismatch::new(
                    format!("a row within the {} pages", self.pages),
                    format!("one of {length} bytes"),
                ))
            })?;
        let local = local_bytes(self.usable, length);
        let short = || {
            damaged(Mismatch::new(
                format!("a row of {length} bytes"),
                "the end of its page",
            ))
        };
        let mut bytes = page
            .bytes
            .get(start..start + local)
            .ok_or_else(short)?
            .to_vec();
        if local < length {
            let mut next = be_u32(&page.bytes, start + local).ok_or_else(short)?;
            while bytes.len() < length && (bytes.len() as u64) < wanted {
                let overflow = self.bytes(next)?;
                let count = (length - bytes.len()).min(self.usable - 4);
                bytes.extend_from_slice(&overflow[4..4 + count]);
                next = be_u32(&overflow, 0).ok_or_else(short)?;
            }
        }
        Ok(Row {
            rowid,
            length,
            bytes,
        })
    }
}

/// One page of a table.
struct Page {
    number: u64,
    bytes: Vec<u8>,
    header: usize,
    leaf: bool,
    cells: usize,
    pointers: usize,
}

impl Page {
    /// Place of a cell.
    fn cell(&self, index: usize) -> usize {
        let at = self.pointers + 2 * index;
        usize::from(u16::from_be_bytes([self.bytes[at], self.bytes[at + 1]]))
    }

    /// The `rowid` of a leaf's cell, the length of its record and where that begins.
    fn rowid(&self, index: usize) -> Result<(i64, (u64, usize)), Mismatch> {
        let mut at = self.cell(index);
        let length = varint(&self.bytes, &mut at)?;
        let rowid = varint(&self.bytes, &mut at)?;
        Ok((rowid.cast_signed(), (length, at)))
    }

    /// The children of an interior page with their largest `rowid`, in order; the last one has no bound.
    fn children(&self) -> Result<Vec<(u64, Option<i64>)>, Mismatch> {
        let missing = || Mismatch::new("a cell within its page", "one behind its end");
        let mut children = Vec::with_capacity(self.cells + 1);
        for index in 0..self.cells {
            let at = self.cell(index);
            let child = be_u32(&self.bytes, at).ok_or_else(missing)?;
            let largest = varint(&self.bytes, &mut (at + 4))?;
            children.push((child, Some(largest.cast_signed())));
        }
        let last = be_u32(&self.bytes, self.header + 8).ok_or_else(missing)?;
        children.push((last, None));
        Ok(children)
    }
}

/// Bytes of a record that lie on its leaf.
fn local_bytes(usable: usize, length: usize) -> usize {
    let most = usable - 35;
    if length <= most {
        return length;
    }
    let least = (usable - 12) * 32 / 255 - 23;
    let local = least + (length - least) % (usable - 4);
    if local <= most { local } else { least }
}

fn be_u32(bytes: &[u8], at: usize) -> Option<u64> {
    let four = bytes.get(at..at.checked_add(4)?)?;
    Some(u64::from(u32::from_be_bytes([
        four[0], four[1], four[2], four[3],
    ])))
}

/// Names of the columns of a `CREATE TABLE` statement.
fn columns(sql: &str) -> Vec<String> {
    let Some((_, inner)) = sql.split_once('(') else {
        return Vec::new();
    };
    let mut depth = 0;
    let mut parts = vec![String::new()];
    for sign in inner.chars() {
        match sign {
            '(' => depth += 1,
            ')' if depth == 0 => break,
            ')' => depth -= 1,
            ',' if depth == 0 => parts.push(String::new()),
            _ => {
                if let Some(part) = parts.last_mut() {
                    part.push(sign);
                }
            }
        }
    }
    parts
        .iter()
        .filter_map(|part| part.split_whitespace().next())
        .map(|name| name.trim_matches(['"', '`', '[', ']', '\'']).to_string())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_a_statement_are_found_with_quotes_and_defaults() {
        assert_eq!(
            columns(
                "CREATE TABLE t(id INTEGER PRIMARY KEY, \"name\" TEXT DEFAULT (x, y),\n  data BLOB NOT NULL)"
            ),
            ["id", "name", "data"]
        );
        assert!(columns("CREATE TABLE t").is_empty());
    }

    #[test]
    fn the_share_of_a_row_on_its_leaf_is_that_of_the_format() {
        // 4096-byte pages: at most 4061 bytes, at least 489, and then a multiple of 4092 in the overflow pages.
        assert_eq!(local_bytes(4096, 4061), 4061);
        assert_eq!(local_bytes(4096, 4062), 489);
        assert_eq!(local_bytes(4096, 4092 + 600), 600);
        assert_eq!(local_bytes(4096, 2 * 4092 + 4061), 4061);
        assert_eq!(local_bytes(4096, 2 * 4092 + 4062), 489);
    }
}
