//! Approximate search with a bound on the work, in a forest of randomised k-d trees searched best bin first.
//!
//! Problem: the map holds tens of thousands of descriptors and grows every frame, and each frame asks for the
//! two nearest of several hundred queries. An exact tree degrades to a scan in 128 dimensions; a few trees that
//! cut space differently, searched together for a fixed number of leaves, find the nearest nearly always when
//! the query is a view of an entry, which is the case that matters for matching. Finding a leaf costs O(log n);
//! the entries of a leaf are scanned together by the same kernel as [`crate::ExactScan`].
//!
//! Steps: insertion descends each tree and splits an overfull leaf; removal descends, deletes, and joins leaves
//! left half empty. When a tree has seen as many changes as it had entries, or an entry lies deeper than twice the
//! logarithm of the number of leaves, the tree is grown afresh in the background: each change enters two entries into
//! the new tree, in scattered order, which makes it balanced whatever the order of arrival was. The old tree answers until
//! the new one is complete, so that no change pays for a rebuild.
//!
//! Degenerate cases: equal entries share a leaf, which is searched whole, so the bound on leaves does not bound
//! the work on thousands of equal descriptors. A search cut short with fewer than two accepted entries found
//! falls back to a scan, so that two entries are reported whenever two are accepted.
//!
//! When not to use: below some thousand entries or when the answer must be exact, [`crate::ExactScan`] is better;
//! for large maps of SIFT descriptors [`crate::InvertedLists`] find more in less time and half the memory.
//! Which neighbours a bounded search misses depends on the history of insertions and removals; where a run must
//! be repeatable from a reloaded state, call [`KdForest::rebuild`] when saving.

use simd_level::SimdLevel;

use crate::best_bin_first::search;
use crate::kd_tree::KdTree;
use crate::{Descriptor, DescriptorIndex, ExactScan, IndexError, TwoNearest};

/// A tree is not grown afresh before this many changes.
const LEAST_CHANGES_TO_REGROW: usize = 256;
/// Entries that enter the new tree with each change.
const MOVES_A_CHANGE: usize = 2;
/// Depth that is allowed beyond twice the logarithm of the number of full leaves.
const DEPTH_SLACK: usize = 8;

/// The shape of the forest and the effort of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct KdForestParams {
    /// The number of trees, 1 to 64. More trees find more; each costs 140 bytes an entry and time at insertion.
    /// Default 2.
    pub trees: usize,
    /// Entries that a leaf holds before it splits, at least 1. Default 64.
    pub leaf_capacity: usize,
    /// Leaves that one query may look at, in all trees together, at least 1. With `usize::MAX` the search is exact, and
    /// slower than [`crate::ExactScan`]. Default 48.
    pub max_leaves: usize,
    /// The seed of the random choice of split components. Default 0.
    pub seed: u64,
}

impl Default for KdForestParams {
    fn default() -> Self {
        Self {
            trees: 2,
            leaf_capacity: 64,
            max_leaves: 48,
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

    fn empty_tree(&self, tree: usize) -> KdTree {
        KdTree::new(self.leaf_capacity, self.seed, tree as u64)
    }
}

/// An approximate index: randomised k-d trees over one set of descriptors, searched best bin first.
///
/// Deterministic: equal parameters and equal sequences of changes give equal answers. A query costs at most
/// `max_leaves * leaf_capacity` distances and the walk to the leaves, unless many entries are equal.
///
/// ```
/// use feature_kdtree::{DescriptorIndex, KdForest, KdForestParams, match_descriptors};
///
/// let mut map = KdForest::new(KdForestParams::default())?;
/// map.insert(1, &[10; 128])?;
/// map.insert(2, &[90; 128])?;
/// let matches = match_descriptors(&[[12; 128]], &map, 0.7)?;
/// assert_eq!((matches[0].query, matches[0].id), (0, 1));
/// // A landmark that looks different now: remove it and insert its new descriptor.
/// map.remove(1);
/// map.insert(1, &[15; 128])?;
/// # Ok::<(), feature_kdtree::IndexError>(())
/// ```
#[derive(Debug, Clone)]
pub struct KdForest {
    params: KdForestParams,
    level: SimdLevel,
    entries: ExactScan,
    trees: Vec<KdTree>,
    /// The age of each tree.
    ages: Vec<Age>,
    regrowth: Option<Regrowth>,
}

/// The changes of a tree since it was grown.
#[derive(Debug, Clone, Copy, Default)]
struct Age {
    changes: usize,
    /// Entries when it was grown.
    entries_at_start: usize,
    /// Whether an entry lies deeper than allowed.
    too_deep: bool,
}

/// A tree that is growing to take the place of another.
#[derive(Debug, Clone)]
struct Regrowth {
    place: usize,
    tree: KdTree,
    /// Ids that were present at the start.
    ids: Vec<u32>,
    /// The number of these that have been dealt with, in steps of `stride` around the list.
    done: usize,
    stride: usize,
}

impl KdForest {
    /// An empty forest on the widest vector instructions of this processor.
    ///
    /// # Errors
    /// [`IndexError::ParameterTooSmall`] or [`IndexError::ParameterTooLarge`] for the first field out of range.
    pub fn new(params: KdForestParams) -> Result<Self, IndexError> {
        params.check()?;
        let level = SimdLevel::best();
        Ok(Self {
            params,
            level,
            entries: ExactScan::with_level(level),
            trees: (0..params.trees)
                .map(|tree| params.empty_tree(tree))
                .collect(),
            ages: vec![Age::default(); params.trees],
            regrowth: None,
        })
    }

    /// Builds all trees afresh, as a function of the parameters and the present entries alone.
    ///
    /// Two forests with equal parameters and entries answer equally after it, and go on doing so under equal
    /// changes, whatever their histories were. It costs as much as inserting all entries.
    pub fn rebuild(&mut self) {
        let mut entries = self.entries.unordered_entries();
        entries.sort_unstable_by_key(|&(id, _)| id);
        self.entries = entries.into_iter().collect();
        for place in 0..self.trees.len() {
            let mut regrowth = self.start_regrowth(place);
            while regrowth.advance(&self.entries) {}
            self.finish_regrowth(regrowth);
        }
        self.regrowth = None;
    }

    fn start_regrowth(&self, place: usize) -> Regrowth {
        Regrowth {
            place,
            tree: self.params.empty_tree(place),
            ids: self.entries.ids().to_vec(),
            done: 0,
            stride: scattering_stride(self.entries.len()),
        }
    }

    fn finish_regrowth(&mut self, regrowth: Regrowth) {
        self.ages[regrowth.place] = Age {
            entries_at_start: self.entries.len(),
            ..Age::default()
        };
        self.trees[regrowth.place] = regrowth.tree;
    }

    /// Counts a change, then goes on with the new tree or starts one where it is due.
    fn count_change(&mut self) {
        for age in &mut self.ages {
            age.changes += 1;
        }
        if let Some(mut regrowth) = self.regrowth.take() {
            let mut more = true;
            for _ in 0..MOVES_A_CHANGE {
                more = more && regrowth.advance(&self.entries);
            }
            if more {
                self.regrowth = Some(regrowth);
            } else {
                self.finish_regrowth(regrowth);
            }
        } else if let Some(place) = self.ages.iter().position(Age::is_due) {
            self.regrowth = Some(self.start_regrowth(place));
        }
    }

    fn depth_limit(&self) -> usize {
        let full_leaves = self.entries.len() / self.params.leaf_capacity + 1;
        2 * full_leaves.ilog2() as usize + DEPTH_SLACK
    }

    fn search(&self, query: &Descriptor, accept: &dyn Fn(u32) -> bool) -> Option<TwoNearest> {
        let found = search(
            self.level,
            &self.trees,
            query,
            self.params.max_leaves,
            accept,
        );
        if found.cut_short && !found.best.is_full() {
            return self.entries.two_nearest_where(query, accept);
        }
        found.best.finish()
    }
}

impl Age {
    fn is_due(&self) -> bool {
        let changes = self.changes.max(LEAST_CHANGES_TO_REGROW);
        changes == self.changes
            && (changes >= self.entries_at_start
                || self.too_deep && changes >= self.entries_at_start / 4)
    }
}

impl Regrowth {
    /// Enters the next entry unless it was removed or has been entered already; `false` when all are dealt with.
    fn advance(&mut self, entries: &ExactScan) -> bool {
        if self.done == self.ids.len() {
            return false;
        }
        // 64 bits: the product of two 32-bit numbers.
        let position = self.done as u64 * self.stride as u64 % self.ids.len() as u64;
        let id = self.ids[position as usize];
        if let Some(descriptor) = entries.descriptor(id)
            && !self.tree.contains(id, &descriptor)
        {
            self.tree.insert(id, &descriptor);
        }
        self.done += 1;
        self.done < self.ids.len()
    }
}

/// A step near the golden section of the length, without a common factor with it: steps of this size around the list
/// scatter over all of it from the start and meet every entry once.
fn scattering_stride(length: usize) -> usize {
    let common_factor = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let near = length * 5 / 8 + 1;
    (near..)
        .find(|&stride| common_factor(stride, length) == 1)
        .unwrap_or(1)
}

impl DescriptorIndex for KdForest {
    fn insert(&mut self, id: u32, descriptor: &Descriptor) -> Result<(), IndexError> {
        // Node numbers are u32 as well, and a tree has fewer than two nodes an entry.
        const MOST: usize = (u32::MAX / 2) as usize;
        if self.entries.len() >= MOST && self.entries.descriptor(id).is_none() {
            return Err(IndexError::TooMany {
                given: self.entries.len() + 1,
                most: MOST,
            });
        }
        self.entries.insert(id, descriptor)?;
        let depth_limit = self.depth_limit();
        for (tree, age) in self.trees.iter_mut().zip(&mut self.ages) {
            age.too_deep |= tree.insert(id, descriptor) > depth_limit;
        }
        if let Some(regrowth) = &mut self.regrowth {
            regrowth.tree.insert(id, descriptor);
        }
        self.count_change();
        Ok(())
    }

    fn remove(&mut self, id: u32) -> bool {
        let Some(descriptor) = self.entries.descriptor(id) else {
            return false;
        };
        self.entries.remove(id);
        let growing = self.regrowth.iter_mut().map(|regrowth| &mut regrowth.tree);
        for tree in self.trees.iter_mut().chain(growing) {
            tree.remove(id, &descriptor);
        }
        self.count_change();
        true
    }

    fn descriptor(&self, id: u32) -> Option<Descriptor> {
        self.entries.descriptor(id)
    }

    fn two_nearest_where(
        &self,
        query: &Descriptor,
        accept: &dyn Fn(u32) -> bool,
    ) -> Option<TwoNearest> {
        self.search(query, accept)
    }

    fn entries(&self) -> Vec<(u32, Descriptor)> {
        self.entries.entries()
    }

    fn len(&self) -> usize {
        self.entries.len()
    }

    fn memory_usage(&self) -> usize {
        let growing = self.regrowth.as_ref().map_or(0, |regrowth| {
            regrowth.tree.memory_usage() + regrowth.ids.capacity() * size_of::<u32>()
        });
        self.entries.memory_usage()
            + self.trees.iter().map(KdTree::memory_usage).sum::<usize>()
            + growing
    }
}
