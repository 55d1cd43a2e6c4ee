//! The cell of each id.
//!
//! The position in the cell is not kept: a cell is short enough to be looked through, and a row that moves within its cell,
//! or stays in it when the cell is divided, then needs no write to the table, which would miss every cache.
//!
//! A hash table that doubles moves all its entries at once, tens of milliseconds at a million of them, in the
//! middle of some frame. Here the ids are spread over 256 small tables, which double one by one at different
//! times: the longest pause is that of one table, a 256th of the whole.
//!
//! The hash is the finaliser of MurmurHash3 (Appleby 2011), a bijection of 64-bit words in which every input bit
//! reaches every output bit; consecutive ids, the usual case, then fill the tables at random rather than in turn,
//! so that they do not all double in the same frame. The tables are looked up, never iterated.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// The number of tables, a power of two.
const TABLES: usize = 256;

/// The cell of each id. Insertion, removal and look-up are O(1); the longest pause of an insertion is O(n / 256).
#[derive(Debug, Clone)]
pub(crate) struct IdTable {
    tables: Vec<HashMap<u32, u32, BuildHasherDefault<Mixer>>>,
    len: usize,
}

impl Default for IdTable {
    fn default() -> Self {
        Self {
            tables: vec![HashMap::default(); TABLES],
            len: 0,
        }
    }
}

impl IdTable {
    pub(crate) fn len(&self) -> usize {
        self.len
    }

    pub(crate) fn get(&self, id: u32) -> Option<u32> {
        self.tables[table_of(id)].get(&id).copied()
    }

    /// Records the cell of an id, new or moved.
    pub(crate) fn set(&mut self, id: u32, cell: u32) {
        let before = self.tables[table_of(id)].insert(id, cell);
        self.len += usize::from(before.is_none());
    }

    pub(crate) fn remove(&mut self, id: u32) -> Option<u32> {
        let before = self.tables[table_of(id)].remove(&id);
        self.len -= usize::from(before.is_some());
        before
    }

    pub(crate) fn memory_usage(&self) -> usize {
        let entry = size_of::<(u32, u32)>();
        let entries: usize = self.tables.iter().map(HashMap::capacity).sum();
        entries * entry + self.tables.capacity() * size_of_val(&self.tables[0])
    }
}

/// The table of an id, from bits of the hash that the tables themselves use neither for positions (the lowest bits) nor
/// for tags (the highest).
fn table_of(id: u32) -> usize {
    (mix(id) >> 40) as usize % TABLES
}

/// The finaliser of MurmurHash3.
fn mix(id: u32) -> u64 {
    let mut word = u64::from(id);
    word = (word ^ (word >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
    word = (word ^ (word >> 33)).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    word ^ (word >> 33)
}

/// Hasher of one `u32`.
#[derive(Debug, Clone, Copy, Default)]
struct Mixer(u64);

impl Hasher for Mixer {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        // Keys of type `u32` never come this way; others are hashed byte by byte.
        for &byte in bytes {
            self.0 = mix(u32::from(byte) ^ self.0 as u32);
        }
    }

    fn write_u32(&mut self, id: u32) {
        self.0 = mix(id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[test]
    fn agrees_with_an_ordered_map_over_sets_moves_and_removals() {
        let mut table = IdTable::default();
        let mut model = BTreeMap::new();
        for step in 0..20_000_u32 {
            let id = step.wrapping_mul(2_654_435_761) % 3001;
            if step % 3 == 2 {
                assert_eq!(table.remove(id), model.remove(&id));
            } else {
                table.set(id, step);
                model.insert(id, step);
            }
            assert_eq!(table.len(), model.len());
        }
        for id in 0..3001 {
            assert_eq!(table.get(id), model.get(&id).copied());
        }
    }

    #[test]
    fn consecutive_ids_spread_evenly_but_do_not_fill_the_tables_in_step() {
        let mut counts = [0_i64; TABLES];
        for id in 0..100 * TABLES as u32 {
            counts[table_of(id)] += 1;
        }
        let deviation: i64 = counts.iter().map(|count| (count - 100).pow(2)).sum();
        let variance = deviation as f64 / TABLES as f64;
        // A Poisson count of mean 100 has variance 100; over 256 tables the estimate has a standard error of
        // 100 sqrt(2 / 256) = 9.
        assert!((100.0 - variance).abs() < 5.0 * 9.0, "variance {variance}");
    }
}
