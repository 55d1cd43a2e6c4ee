//! The position of each id.
//!
//! A hash table whose hash is one multiplication. Ids are numbers that the caller counts up, so the attacks that the hash
//! of the standard library guards against do not arise, and it would cost more than storing the row. The table is never
//! iterated over, so no hash order reaches an answer.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::hash::{BuildHasherDefault, Hasher};

/// The position of each id.
#[derive(Debug, Clone, Default)]
pub(crate) struct IdMap(HashMap<u32, u32, BuildHasherDefault<IdHasher>>);

impl IdMap {
    /// Makes room for `more` ids beyond those present.
    pub(crate) fn reserve(&mut self, more: usize) {
        self.0.reserve(more);
    }

    /// The position of an id, `None` when it is not present.
    pub(crate) fn get(&self, id: u32) -> Option<u32> {
        self.0.get(&id).copied()
    }

    /// Adds an id; when it is present, changes nothing and returns `false`.
    pub(crate) fn insert_new(&mut self, id: u32, position: u32) -> bool {
        match self.0.entry(id) {
            Entry::Occupied(_) => false,
            Entry::Vacant(vacant) => {
                vacant.insert(position);
                true
            }
        }
    }

    /// Sets the position of an id, present or not.
    pub(crate) fn set(&mut self, id: u32, position: u32) {
        self.0.insert(id, position);
    }

    /// Removes an id and returns its position.
    pub(crate) fn remove(&mut self, id: u32) -> Option<u32> {
        self.0.remove(&id)
    }

    /// The memory of the table, bytes, without its bookkeeping.
    pub(crate) fn memory_usage(&self) -> usize {
        self.0.capacity() * size_of::<(u32, u32)>()
    }
}

/// Fibonacci hashing: the halves of the product with 2^64 over the golden ratio, joined.
#[derive(Debug, Clone, Copy, Default)]
struct IdHasher(u64);

impl Hasher for IdHasher {
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u32(u32::from(byte));
        }
    }

    fn write_u32(&mut self, id: u32) {
        let product = (self.0 ^ u64::from(id)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = product ^ (product >> 32);
    }

    fn finish(&self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_id_is_there_from_insertion_to_removal() {
        let mut map = IdMap::default();
        let ids: Vec<u32> = (0..1000_u32).map(|i| i << 16 | i).collect();
        for (position, &id) in (0..).zip(&ids) {
            assert!(map.insert_new(id, position) && !map.insert_new(id, 7));
        }
        for (position, &id) in (0..).zip(&ids) {
            assert_eq!(map.get(id), Some(position));
        }
        map.set(ids[3], 9);
        assert_eq!((map.remove(ids[3]), map.get(ids[3])), (Some(9), None));
    }

    #[test]
    fn hashes_of_counted_ids_fill_the_buckets() {
        // Ids counted up and ids that differ in high bits only: half the buckets of 4096 would stay empty under a
        // perfect random hash of 2839 of them (1 - e^-0.693); a third of them used is far from degenerate.
        for step in [1_u32, 1 << 8, 1 << 20] {
            let mut used = [false; 4096];
            for i in 0..2839_u32 {
                let mut hasher = IdHasher::default();
                hasher.write_u32(i.wrapping_mul(step));
                used[(hasher.finish() & 4095) as usize] = true;
            }
            let count = used.iter().filter(|used| **used).count();
            assert!(count > 4096 / 3, "step {step}: {count}");
        }
    }
}
