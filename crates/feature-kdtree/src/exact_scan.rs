//! Exact search by looking at every entry.
//!
//! In 128 dimensions an exact k-d tree looks at nearly every entry anyway and pays for the tree on top, so the
//! scan is the exact method of choice: 128 bytes an entry, read in order, one vectorised distance each. It is
//! the reference for [`crate::KdForest`] and the better index up to a few thousand entries.
//! When not to use: whole maps of tens of thousands of entries, where the forest is several times faster.

use std::collections::HashMap;

use crate::index::BestTwo;
use crate::{Descriptor, DescriptorIndex, IndexError, Neighbour, TwoNearest, distance_squared};

/// Every query looks at every entry: exact, O(entries) per query.
///
/// Insertion and removal are O(1); the answers do not depend on their order.
#[derive(Debug, Clone, Default)]
pub struct ExactScan {
    ids: Vec<u32>,
    descriptors: Vec<Descriptor>,
    // Looked up, never iterated: no hash order reaches an answer.
    position_of: HashMap<u32, usize>,
}

impl ExactScan {
    /// An empty index.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }
}

impl DescriptorIndex for ExactScan {
    fn insert(&mut self, id: u32, descriptor: &Descriptor) -> Result<(), IndexError> {
        if self.position_of.contains_key(&id) {
            return Err(IndexError::DuplicateId { id });
        }
        self.position_of.insert(id, self.ids.len());
        self.ids.push(id);
        self.descriptors.push(*descriptor);
        Ok(())
    }

    fn remove(&mut self, id: u32) -> bool {
        let Some(position) = self.position_of.remove(&id) else {
            return false;
        };
        self.ids.swap_remove(position);
        self.descriptors.swap_remove(position);
        if let Some(&moved) = self.ids.get(position) {
            self.position_of.insert(moved, position);
        }
        true
    }

    fn two_nearest(&self, query: &Descriptor) -> Option<TwoNearest> {
        scan(&self.ids, &self.descriptors, query, |_| true)
    }

    fn two_nearest_where(
        &self,
        query: &Descriptor,
        accept: &dyn Fn(u32) -> bool,
    ) -> Option<TwoNearest> {
        scan(&self.ids, &self.descriptors, query, accept)
    }

    fn len(&self) -> usize {
        self.ids.len()
    }

    fn memory_usage(&self) -> usize {
        self.ids.capacity() * size_of::<u32>()
            + self.descriptors.capacity() * size_of::<Descriptor>()
            + self.position_of.capacity() * size_of::<(u32, usize)>()
    }
}

/// The two nearest of parallel slices, among the accepted ids.
pub(crate) fn scan(
    ids: &[u32],
    descriptors: &[Descriptor],
    query: &Descriptor,
    accept: impl Fn(u32) -> bool,
) -> Option<TwoNearest> {
    let mut best = BestTwo::default();
    for (&id, descriptor) in ids.iter().zip(descriptors) {
        let distance_squared = distance_squared(query, descriptor);
        if distance_squared <= best.worst_distance_squared() && accept(id) {
            best.offer(Neighbour {
                distance_squared,
                id,
            });
        }
    }
    best.finish()
}
