//! Storage of numbered descriptors in blocks of rows.
//!
//! `push` and `swap_remove` keep the rows without gaps. [`crate::row_scan`] searches them.

use crate::Descriptor;
use crate::row_block::{LANES, RowBlock};

/// Up to this many blocks, memory grows block by block; beyond, it doubles. Many short lists would waste a third of it.
const EXACT_BLOCKS: usize = 16;

/// Descriptors under ids, in the order of their positions.
///
/// The ids are not checked: the owner of the rows keeps them unique.
#[derive(Debug, Clone)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(into = "StoredRows", try_from = "StoredRows")
)]
pub(crate) struct Rows {
    blocks: Vec<RowBlock>,
    ids: Vec<u32>,
    /// Whether the ids ascend with the position.
    sorted: bool,
}

/// Rows as they are stored.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
struct StoredRows {
    ids: Vec<u32>,
    /// Descriptors by position, one after the other.
    descriptors: Vec<u8>,
    sorted: bool,
}

#[cfg(feature = "serde")]
impl From<Rows> for StoredRows {
    fn from(rows: Rows) -> Self {
        Self {
            descriptors: (0..rows.len())
                .flat_map(|row| rows.descriptor(row))
                .collect(),
            ids: rows.ids,
            sorted: rows.sorted,
        }
    }
}

#[cfg(feature = "serde")]
impl TryFrom<StoredRows> for Rows {
    type Error = crate::IndexError;

    fn try_from(stored: StoredRows) -> Result<Self, crate::IndexError> {
        let (descriptors, rest) = stored.descriptors.as_chunks();
        if !rest.is_empty() || descriptors.len() != stored.ids.len() {
            return Err(crate::IndexError::Stored("every id has 128 bytes"));
        }
        let mut rows = Self::default();
        rows.reserve(stored.ids.len());
        for (id, descriptor) in stored.ids.iter().zip(descriptors) {
            rows.push(*id, descriptor);
        }
        // Rows that were out of order once are taken for unsorted ones.
        rows.sorted &= stored.sorted;
        Ok(rows)
    }
}

impl Default for Rows {
    fn default() -> Self {
        Self {
            blocks: Vec::new(),
            ids: Vec::new(),
            sorted: true,
        }
    }
}

impl Rows {
    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.ids.len()
    }

    /// The ids by position.
    pub(crate) fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// The position of an id, looked for from the front. O(rows).
    pub(crate) fn position(&self, id: u32) -> Option<usize> {
        self.ids.iter().position(|&other| other == id)
    }

    /// The descriptor at a position below `len`.
    pub(crate) fn descriptor(&self, position: usize) -> Descriptor {
        self.blocks[position / LANES].get(position % LANES)
    }

    /// Makes room for `rows` more rows.
    pub(crate) fn reserve(&mut self, rows: usize) {
        self.blocks.reserve_exact(rows.div_ceil(LANES));
        self.ids.reserve_exact(rows.next_multiple_of(LANES));
    }

    /// Adds a row at the end.
    pub(crate) fn push(&mut self, id: u32, descriptor: &Descriptor) {
        let position = self.ids.len();
        if position.is_multiple_of(LANES) {
            if self.blocks.len() < EXACT_BLOCKS {
                self.blocks.reserve_exact(1);
                self.ids.reserve_exact(LANES);
            }
            self.blocks.push(RowBlock::EMPTY);
        }
        self.blocks[position / LANES].set(position % LANES, descriptor);
        self.sorted &= self.ids.last().is_none_or(|&last| last < id);
        self.ids.push(id);
    }

    /// Whether the ids ascend with the position.
    pub(crate) fn is_sorted(&self) -> bool {
        self.sorted
    }

    /// The rows in blocks; lanes of the last block past [`Self::len`] hold arbitrary values.
    pub(crate) fn blocks(&self) -> &[RowBlock] {
        &self.blocks
    }

    /// Removes the row at a position below `len`; the last row takes its place.
    pub(crate) fn swap_remove(&mut self, position: usize) {
        let last = self.ids.len() - 1;
        if position != last {
            let moved = self.descriptor(last);
            self.blocks[position / LANES].set(position % LANES, &moved);
        }
        self.ids.swap_remove(position);
        self.blocks.truncate(last.div_ceil(LANES));
        self.sorted = last <= 1 || (self.sorted && position == last);
    }

    /// Bytes on the heap.
    pub(crate) fn memory_usage(&self) -> usize {
        self.blocks.capacity() * size_of::<RowBlock>() + self.ids.capacity() * size_of::<u32>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn removal_moves_the_last_row_and_order_is_known() {
        let mut rows = Rows::default();
        let descriptor = |id: u32| [id as u8; 128];
        for id in 0..33 {
            rows.push(id, &descriptor(id));
        }
        rows.swap_remove(32);
        assert!(rows.sorted && rows.len() == 32);
        rows.swap_remove(3);
        assert!(!rows.sorted);
        assert_eq!(rows.ids()[3], 31);
        for (position, &id) in rows.ids().iter().enumerate() {
            assert_eq!(rows.descriptor(position), descriptor(id));
        }
        while rows.len() > 1 {
            rows.swap_remove(0);
        }
        assert!(rows.sorted && rows.len() == 1);
        rows.swap_remove(0);
        assert!(rows.sorted && rows.blocks.is_empty());
    }
}
