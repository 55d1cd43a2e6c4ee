//! Approximate search with a bound on the work: a forest of randomised k-d trees, searched best bin first.
//!
//! Problem: the map holds tens of thousands of descriptors and grows every frame, and each frame asks for the
//! two nearest of several hundred queries. An exact tree degrades to a scan in 128 dimensions; a few trees that
//! cut space differently, searched together for a fixed number of leaves, find the nearest nearly always when
//! the query is a view of an entry, which is the case that matters for matching.
//!
//! Steps: insertion descends each tree and splits an overfull leaf; removal descends and deletes. After as many
//! changes as there were entries at the last build the trees are built afresh, which keeps them balanced at
//! O(log n) amortised splits a change whatever the order of insertion.
//!
//! Degenerate cases: equal entries share a leaf, which is searched whole, so the bound on leaves does not bound
//! the work on thousands of equal descriptors. A search cut short with fewer than two accepted entries found
//! falls back to a scan: when two accepted entries exist, two are reported.
//!
//! When not to use: below a few thousand entries, or when the answer must be exact: [`crate::ExactScan`].
//! Which neighbours a bounded search misses depends on the history of insertions and removals; where a run must
//! be repeatable from a reloaded state, call [`KdForest::rebuild`] when saving.

use std::collections::HashMap;

use crate::best_bin_first::search;
use crate::exact_scan::scan;
use crate::kd_tree::KdTree;
use crate::{Descriptor, DescriptorIndex, IndexError, TwoNearest};

/// The trees are not rebuilt before this many changes.
const LEAST_CHANGES_TO_REBUILD: usize = 64;

/// Shape of the forest and effort of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KdForestParams {
    /// Number of trees, 1 to 64. More trees find more and cost memory and insertion time. Default 4.
    pub trees: usize,
    /// Entries a leaf holds before it splits, at least 1. Default 16.
    pub leaf_capacity: usize,
    /// Leaves one query may look at, all trees together, at least 1. `usize::MAX` makes the search exact,
    /// and slower than [`crate::ExactScan`]. Default 64.
    pub max_leaves: usize,
    /// Seed of the random choice of split components. Default 0.
    pub seed: u64,
}

impl Default for KdForestParams {
    fn default() -> Self {
        Self {
            trees: 4,
            leaf_capacity: 16,
            max_leaves: 64,
            seed: 0,
        }
    }
}

impl KdForestParams {
    fn check(&self) -> Result<(), IndexError> {
        const MOST_TREES: usize = 64;
        for (name, given) in [
            ("trees", self.trees),
            ("leaf_capacity", self.leaf_capacity),
            ("max_leaves", self.max_leaves),
        ] {
            if given == 0 {
                return Err(IndexError::ParameterTooSmall {
                    name,
                    given,
                    least: 1,
                });
            }
        }
        if self.trees > MOST_TREES {
            return Err(IndexError::ParameterTooLarge {
                name: "trees",
                given: self.trees,
                most: MOST_TREES,
            });
        }
        Ok(())
    }
}

/// Randomised k-d trees over one set of descriptors, searched best bin first.
///
/// Deterministic: equal parameters and equal sequences of changes give equal answers. A query costs at most
/// `max_leaves * leaf_capacity` distances plus the walk, unless many entries are equal.
#[derive(Debug, Clone)]
pub struct KdForest {
    params: KdForestParams,
    ids: Vec<u32>,
    descriptors: Vec<Descriptor>,
    // Looked up, never iterated: no hash order reaches an answer.
    slot_of: HashMap<u32, u32>,
    trees: Vec<KdTree>,
    entries_at_build: usize,
    changes_since_build: usize,
}

impl KdForest {
    /// An empty forest.
    ///
    /// # Errors
    /// [`IndexError::ParameterTooSmall`] or [`IndexError::ParameterTooLarge`] naming the field out of range.
    pub fn new(params: KdForestParams) -> Result<Self, IndexError> {
        params.check()?;
        let mut forest = Self {
            params,
            ids: Vec::new(),
            descriptors: Vec::new(),
            slot_of: HashMap::new(),
            trees: Vec::new(),
            entries_at_build: 0,
            changes_since_build: 0,
        };
        forest.build_trees();
        Ok(forest)
    }

    /// The parameters the forest was made with.
    #[must_use]
    pub fn params(&self) -> &KdForestParams {
        &self.params
    }

    /// Builds all trees afresh, as a function of the parameters and the present entries alone.
    ///
    /// Two forests with equal parameters and entries answer equally after it, and go on doing so under equal
    /// changes, whatever their histories were. O(trees * n log n).
    pub fn rebuild(&mut self) {
        let mut order: Vec<usize> = (0..self.ids.len()).collect();
        order.sort_unstable_by_key(|&slot| self.ids[slot]);
        self.descriptors = order.iter().map(|&slot| self.descriptors[slot]).collect();
        self.ids.sort_unstable();
        self.slot_of = (0_u32..)
            .zip(&self.ids)
            .map(|(slot, &id)| (id, slot))
            .collect();
        self.build_trees();
    }

    fn build_trees(&mut self) {
        self.trees = (0..self.params.trees as u64)
            .map(|stream| {
                KdTree::build(
                    &self.descriptors,
                    self.params.leaf_capacity,
                    self.params.seed,
                    stream,
                )
            })
            .collect();
        self.entries_at_build = self.ids.len();
        self.changes_since_build = 0;
    }

    fn count_change(&mut self) {
        self.changes_since_build += 1;
        if self.changes_since_build > self.entries_at_build.max(LEAST_CHANGES_TO_REBUILD) {
            self.rebuild();
        }
    }

    fn search(&self, query: &Descriptor, accept: impl Fn(u32) -> bool) -> Option<TwoNearest> {
        let found = search(
            &self.trees,
            &self.ids,
            &self.descriptors,
            query,
            self.params.max_leaves,
            &accept,
        );
        if found.cut_short && !found.best.is_full() {
            return scan(&self.ids, &self.descriptors, query, accept);
        }
        found.best.finish()
    }
}

impl DescriptorIndex for KdForest {
    fn insert(&mut self, id: u32, descriptor: &Descriptor) -> Result<(), IndexError> {
        if self.slot_of.contains_key(&id) {
            return Err(IndexError::DuplicateId { id });
        }
        // Node numbers are u32 as well, and a tree has fewer than two nodes an entry.
        const MOST: usize = (u32::MAX / 2) as usize;
        if self.ids.len() >= MOST {
            return Err(IndexError::TooMany {
                given: self.ids.len() + 1,
                most: MOST,
            });
        }
        let slot = self.ids.len() as u32;
        self.ids.push(id);
        self.descriptors.push(*descriptor);
        self.slot_of.insert(id, slot);
        for tree in &mut self.trees {
            tree.insert(slot, &self.descriptors);
        }
        self.count_change();
        Ok(())
    }

    fn remove(&mut self, id: u32) -> bool {
        let Some(slot) = self.slot_of.remove(&id) else {
            return false;
        };
        let last = self.ids.len() as u32 - 1;
        let removed = self.descriptors[slot as usize];
        let moved = self.descriptors[last as usize];
        for tree in &mut self.trees {
            tree.remove(slot, &removed);
            if slot != last {
                tree.rename(last, slot, &moved);
            }
        }
        self.ids.swap_remove(slot as usize);
        self.descriptors.swap_remove(slot as usize);
        if slot != last {
            self.slot_of.insert(self.ids[slot as usize], slot);
        }
        self.count_change();
        true
    }

    fn two_nearest(&self, query: &Descriptor) -> Option<TwoNearest> {
        self.search(query, |_| true)
    }

    fn two_nearest_where(
        &self,
        query: &Descriptor,
        accept: &dyn Fn(u32) -> bool,
    ) -> Option<TwoNearest> {
        self.search(query, accept)
    }

    fn descriptor(&self, id: u32) -> Option<Descriptor> {
        let slot = *self.slot_of.get(&id)?;
        Some(self.descriptors[slot as usize])
    }

    fn len(&self) -> usize {
        self.ids.len()
    }

    fn memory_usage(&self) -> usize {
        self.ids.capacity() * size_of::<u32>()
            + self.descriptors.capacity() * size_of::<Descriptor>()
            + self.slot_of.capacity() * size_of::<(u32, u32)>()
            + self.trees.capacity() * size_of::<KdTree>()
            + self.trees.iter().map(KdTree::memory_usage).sum::<usize>()
    }
}
