//! The question that every index of descriptors answers: the two nearest entries.
//!
//! The ratio test (paper, Eq. 21) needs the two nearest entries of one set. Ties go to the lower id, so that an exact
//! index answers the same whatever the order of insertion was.

use crate::{Descriptor, IndexError};

/// An entry of the index and its squared distance to the query.
///
/// Ordered by distance, then by id: the order in which neighbours are preferred.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Neighbour {
    /// Squared Euclidean distance to the query.
    pub distance_squared: u32,
    /// Id given at insertion.
    pub id: u32,
}

/// The entry nearest to a query and the second nearest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct TwoNearest {
    /// The nearest entry.
    pub first: Neighbour,
    /// The second nearest entry; `None` when the index holds only one, or only one was accepted.
    pub second: Option<Neighbour>,
}

/// A set of descriptors, each under its own id, that grows, shrinks and is searched for the two nearest.
pub trait DescriptorIndex {
    /// Adds a descriptor under an id of the caller's choice.
    ///
    /// # Errors
    /// [`IndexError::DuplicateId`] when the id is present; the index is then unchanged.
    /// [`IndexError::TooMany`] when the index is full.
    fn insert(&mut self, id: u32, descriptor: &Descriptor) -> Result<(), IndexError>;

    /// Removes an entry; `false` when the id is not present.
    fn remove(&mut self, id: u32) -> bool;

    /// The two entries nearest to the query, or `None` from an empty index.
    fn two_nearest(&self, query: &Descriptor) -> Option<TwoNearest> {
        self.two_nearest_where(query, &|_| true)
    }

    /// The two nearest among the entries whose id `accept` takes, or `None` when it takes none.
    ///
    /// `accept` may be asked about any entry, any number of times, in any order. Where many queries accept the same
    /// entries, it is far cheaper to collect these into an [`crate::ExactScan`] of their own.
    fn two_nearest_where(
        &self,
        query: &Descriptor,
        accept: &dyn Fn(u32) -> bool,
    ) -> Option<TwoNearest>;

    /// Finds the two nearest of every query, as [`DescriptorIndex::two_nearest`] does, in the order of the queries.
    ///
    /// `found` is emptied first and its memory used again. Many queries at once cost less than one by one.
    fn two_nearest_batch(&self, queries: &[Descriptor], found: &mut Vec<Option<TwoNearest>>) {
        found.clear();
        found.extend(queries.iter().map(|query| self.two_nearest(query)));
    }

    /// The `k` entries nearest to the query, the nearest first; fewer where there are fewer.
    ///
    /// An approximate index may miss some, as it may miss one of two; whatever it gives has its exact distance.
    fn nearest(&self, query: &Descriptor, k: usize) -> Vec<Neighbour> {
        let mut found: Vec<Neighbour> = Vec::new();
        let mut known: Vec<u32> = Vec::new();
        while found.len() < k {
            let Some(two) = self.two_nearest_where(query, &|id| known.binary_search(&id).is_err())
            else {
                break;
            };
            found.push(two.first);
            found.extend(two.second);
            known = found.iter().map(|neighbour| neighbour.id).collect();
            known.sort_unstable();
        }
        found.sort_unstable();
        found.truncate(k);
        found
    }

    /// The entries at a squared distance of at most `radius_squared`, the nearest first.
    ///
    /// An approximate index may miss some, as [`DescriptorIndex::nearest`].
    fn within(&self, query: &Descriptor, radius_squared: u32) -> Vec<Neighbour> {
        let mut k = 8;
        loop {
            let mut found = self.nearest(query, k);
            let beyond = found
                .last()
                .is_some_and(|last| last.distance_squared > radius_squared);
            if beyond || k >= self.len() {
                found.retain(|neighbour| neighbour.distance_squared <= radius_squared);
                return found;
            }
            k = k.saturating_mul(4);
        }
    }

    /// All entries, by ascending id.
    fn entries(&self) -> Vec<(u32, Descriptor)>;

    /// The descriptor of an entry; `None` when the id is not present.
    fn descriptor(&self, id: u32) -> Option<Descriptor>;

    /// The number of entries.
    fn len(&self) -> usize;

    /// Whether the index holds no entry.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The memory held on the heap, bytes, without the bookkeeping of the allocator and of hash tables.
    fn memory_usage(&self) -> usize;
}

/// The best two of the candidates offered so far.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct BestTwo {
    first: Option<Neighbour>,
    second: Option<Neighbour>,
}

impl BestTwo {
    /// Takes the candidate if it is among the best two; an entry offered twice counts once.
    #[inline]
    pub(crate) fn offer(&mut self, candidate: Neighbour) {
        match (self.first, self.second) {
            (None, _) => self.first = Some(candidate),
            (Some(first), _) if candidate.id == first.id => {}
            (Some(first), _) if candidate < first => {
                self.second = self.first;
                self.first = Some(candidate);
            }
            (Some(_), None) => self.second = Some(candidate),
            (Some(_), Some(second)) if candidate < second => self.second = Some(candidate),
            _ => {}
        }
    }

    /// The squared distance beyond which no candidate can be taken any more.
    #[inline]
    pub(crate) fn worst_distance_squared(&self) -> u32 {
        self.second
            .map_or(u32::MAX, |second| second.distance_squared)
    }

    /// Whether two different entries have been found.
    pub(crate) fn is_full(&self) -> bool {
        self.second.is_some()
    }

    /// The best two, `None` when nothing was offered.
    pub(crate) fn finish(self) -> Option<TwoNearest> {
        self.first.map(|first| TwoNearest {
            first,
            second: self.second,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn neighbour(distance_squared: u32, id: u32) -> Neighbour {
        Neighbour {
            distance_squared,
            id,
        }
    }

    #[test]
    fn an_entry_offered_twice_is_not_its_own_second() {
        let mut best = BestTwo::default();
        best.offer(neighbour(5, 1));
        best.offer(neighbour(5, 1));
        assert!(!best.is_full());
        best.offer(neighbour(9, 2));
        best.offer(neighbour(9, 2));
        best.offer(neighbour(5, 1));
        let found = best.finish().unwrap();
        assert_eq!(found.first, neighbour(5, 1));
        assert_eq!(found.second, Some(neighbour(9, 2)));
    }

    #[test]
    fn ties_go_to_the_lower_id() {
        for order in [[3, 1, 2], [1, 2, 3], [2, 3, 1], [3, 2, 1]] {
            let mut best = BestTwo::default();
            for id in order {
                best.offer(neighbour(7, id));
            }
            let found = best.finish().unwrap();
            assert_eq!(found.first.id, 1);
            assert_eq!(found.second.map(|second| second.id), Some(2));
        }
    }
}
