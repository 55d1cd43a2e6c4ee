//! Exact search: every query looks at every entry.
//!
//! In 128 dimensions an exact k-d tree looks at nearly every entry anyway and pays for the tree on top, so the
//! scan is the exact method of choice: it reads 132 bytes an entry in order and multiplies 64 pairs of bytes in one
//! instruction where the processor has AVX-512. It is the reference for every other index, and the best one up to some
//! thousand entries. Many queries at once cost less each than one alone, because rows are loaded once for a group of
//! them.
//!
//! When not to use: whole maps of tens of thousands of entries, where an approximate index is several times
//! faster. A part of such a map that is known before the queries, the landmarks in view, is a small map again:
//! collect its entries into a scan of their own.

use std::borrow::Borrow;

use simd_level::SimdLevel;

use crate::id_map::IdMap;
use crate::index::{BestTwo, Neighbour};
use crate::row_block::PreparedQuery;
use crate::row_scan;
use crate::rows::Rows;
use crate::{Descriptor, DescriptorIndex, IndexError, TwoNearest};

/// Queries that are prepared at a time, 0.5 KB each.
const QUERIES_AT_A_TIME: usize = 480;

/// An exact index: every query looks at every entry, O(entries).
///
/// Insertion and removal are O(1). The answers do not depend on their order, nor on the vector instructions in use.
#[derive(Debug, Clone)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(into = "Rows", try_from = "Rows")
)]
pub struct ExactScan {
    rows: Rows,
    position_of: IdMap,
    level: SimdLevel,
}

#[cfg(feature = "serde")]
impl From<ExactScan> for Rows {
    fn from(scan: ExactScan) -> Self {
        scan.rows
    }
}

#[cfg(feature = "serde")]
impl TryFrom<Rows> for ExactScan {
    type Error = IndexError;

    fn try_from(rows: Rows) -> Result<Self, IndexError> {
        let mut scan = Self::new();
        for (position, id) in rows.ids().iter().enumerate() {
            if !scan.position_of.insert_new(*id, position as u32) {
                return Err(IndexError::DuplicateId { id: *id });
            }
        }
        scan.rows = rows;
        Ok(scan)
    }
}

impl Default for ExactScan {
    fn default() -> Self {
        Self::new()
    }
}

impl ExactScan {
    /// An empty index on the widest vector instructions of this processor.
    #[must_use]
    pub fn new() -> Self {
        Self::with_level(SimdLevel::best())
    }

    /// An empty index on the vector instructions given, for tests and measurements.
    #[must_use]
    pub fn with_level(level: SimdLevel) -> Self {
        Self {
            rows: Rows::default(),
            position_of: IdMap::default(),
            level,
        }
    }

    /// Ids of all entries, in the order of the rows.
    pub(crate) fn ids(&self) -> &[u32] {
        self.rows.ids()
    }

    /// All entries, in the order of the rows.
    pub(crate) fn unordered_entries(&self) -> Vec<(u32, Descriptor)> {
        let rows = 0..self.rows.len();
        rows.map(|row| (self.rows.ids()[row], self.rows.descriptor(row)))
            .collect()
    }
}

impl ExactScan {
    /// The entries within a squared distance, in the order of the rows.
    fn neighbours(&self, query: &Descriptor, at_most: u32) -> Vec<Neighbour> {
        let mut distances = Vec::with_capacity(self.rows.len());
        row_scan::distances(
            &self.rows,
            self.level,
            &PreparedQuery::new(query),
            &mut distances,
        );
        let all = distances.into_iter().zip(self.rows.ids());
        all.filter(|(distance_squared, _)| *distance_squared <= at_most)
            .map(|(distance_squared, &id)| Neighbour {
                distance_squared,
                id,
            })
            .collect()
    }
}

/// Makes a scan of entries: ids with descriptors, or with references to descriptors.
///
/// This is the exact filtered search for many queries over one set that is known beforehand, such as the landmarks in
/// view: it costs the size of the set, whatever the size of the map. Of several entries with one id the first counts.
/// O(entries), 0.04 us each; ids in ascending order make ties cheaper to resolve.
///
/// ```
/// use feature_kdtree::{DescriptorIndex, ExactScan};
///
/// let landmarks = [(3, [10_u8; 128]), (8, [90; 128]), (9, [200; 128])];
/// let in_view = [3, 9];
/// let visible: ExactScan = landmarks
///     .iter()
///     .filter(|(id, _)| in_view.contains(id))
///     .map(|(id, descriptor)| (*id, descriptor))
///     .collect();
/// assert_eq!(visible.len(), 2);
/// ```
impl<D: Borrow<Descriptor>> FromIterator<(u32, D)> for ExactScan {
    fn from_iter<I: IntoIterator<Item = (u32, D)>>(entries: I) -> Self {
        let entries = entries.into_iter();
        let mut scan = Self::new();
        let (at_least, _) = entries.size_hint();
        scan.rows.reserve(at_least);
        scan.position_of.reserve(at_least);
        for (id, descriptor) in entries {
            // The only error is a repeated id, which changes nothing.
            let _ = scan.insert(id, descriptor.borrow());
        }
        scan
    }
}

impl DescriptorIndex for ExactScan {
    fn insert(&mut self, id: u32, descriptor: &Descriptor) -> Result<(), IndexError> {
        // Ids are unique numbers of 32 bits, so a position never needs more.
        let position = self.rows.len() as u32;
        if !self.position_of.insert_new(id, position) {
            return Err(IndexError::DuplicateId { id });
        }
        self.rows.push(id, descriptor);
        Ok(())
    }

    fn remove(&mut self, id: u32) -> bool {
        let Some(position) = self.position_of.remove(id) else {
            return false;
        };
        self.rows.swap_remove(position as usize);
        if let Some(&moved) = self.rows.ids().get(position as usize) {
            self.position_of.set(moved, position);
        }
        true
    }

    fn descriptor(&self, id: u32) -> Option<Descriptor> {
        let position = self.position_of.get(id)?;
        Some(self.rows.descriptor(position as usize))
    }

    fn two_nearest(&self, query: &Descriptor) -> Option<TwoNearest> {
        let mut best = [BestTwo::default()];
        let query = [PreparedQuery::new(query)];
        row_scan::two_nearest_batch(&self.rows, self.level, &query, &[0], &mut best);
        best[0].finish()
    }

    fn two_nearest_where(
        &self,
        query: &Descriptor,
        accept: &dyn Fn(u32) -> bool,
    ) -> Option<TwoNearest> {
        let mut best = BestTwo::default();
        let query = PreparedQuery::new(query);
        row_scan::two_nearest_where(&self.rows, self.level, &query, accept, &mut best);
        best.finish()
    }

    fn two_nearest_batch(&self, queries: &[Descriptor], found: &mut Vec<Option<TwoNearest>>) {
        found.clear();
        found.reserve(queries.len());
        let most = queries.len().min(QUERIES_AT_A_TIME);
        let members: Vec<u32> = (0..most as u32).collect();
        let mut prepared = Vec::with_capacity(most);
        let mut best = Vec::with_capacity(most);
        for queries in queries.chunks(QUERIES_AT_A_TIME) {
            prepared.clear();
            prepared.extend(queries.iter().map(PreparedQuery::new));
            best.clear();
            best.resize(queries.len(), BestTwo::default());
            let members = &members[..queries.len()];
            row_scan::two_nearest_batch(&self.rows, self.level, &prepared, members, &mut best);
            found.extend(best.iter().map(|best| best.finish()));
        }
    }

    fn nearest(&self, query: &Descriptor, k: usize) -> Vec<Neighbour> {
        let mut found = self.neighbours(query, u32::MAX);
        if k > 0 && k < found.len() {
            found.select_nth_unstable(k - 1);
        }
        found.truncate(k);
        found.sort_unstable();
        found
    }

    fn within(&self, query: &Descriptor, radius_squared: u32) -> Vec<Neighbour> {
        let mut found = self.neighbours(query, radius_squared);
        found.sort_unstable();
        found
    }

    fn entries(&self) -> Vec<(u32, Descriptor)> {
        let mut entries = self.unordered_entries();
        entries.sort_unstable_by_key(|&(id, _)| id);
        entries
    }

    fn len(&self) -> usize {
        self.rows.len()
    }

    fn memory_usage(&self) -> usize {
        self.rows.memory_usage() + self.position_of.memory_usage()
    }
}
