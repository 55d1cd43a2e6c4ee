//! Approximate search in lists of near descriptors, of which a query scans the few nearest.
//!
//! Problem: the map holds up to millions of descriptors and grows every frame; each frame asks for the two
//! nearest of several hundred queries. A scan of the whole map is exact and too slow; most entries are far from the
//! query, and the list an entry is in says so.
//!
//! Steps of a batch of queries (Sivic and Zisserman 2003; Jégou, Douze and Schmid 2011):
//! 1. Two storeys of centroids give each query its nearest lists, `probes` of them.
//! 2. The visits are ordered by list, and each list is scanned once for all its queries, by the same kernel as
//!    [`crate::ExactScan`]: memory is read once a batch, and distances are exact.
//!
//! Lists divide when they overflow and dissolve when they empty. Nothing is trained, and nothing is rebuilt.
//!
//! Degenerate cases: with fewer lists than `probes` the search is exact. Equal descriptors cannot be divided:
//! they share a list, which is scanned whole. Where a filter accepts fewer than two entries of the lists searched, the
//! search goes on with four times as many lists each time, up to all of them, so that two entries are reported whenever
//! two are accepted.
//!
//! When not to use: when the answer must be exact, or below some thousand entries ([`crate::ExactScan`]).
//! Which neighbours are missed depends on the history of insertions and removals; where a run must be repeatable
//! from a reloaded state, call [`InvertedLists::rebuild`] when saving.

use simd_level::SimdLevel;

use crate::cells::Cells;
use crate::directory::Flat;
use crate::index::BestTwo;
use crate::near_rows::{Collector, scan_near};
use crate::row_block::PreparedQuery;
use crate::row_scan;
use crate::smallest::Smallest;
use crate::{Descriptor, DescriptorIndex, IndexError, Neighbour, TwoNearest};

/// Centroids that a cell of the upper storey holds.
const CENTROIDS_PER_CELL: usize = 128;
/// Queries that are searched together, with 1.5 KB of buffers each.
const QUERIES_AT_A_TIME: usize = 512;
/// The fourth power of the number of lists that a query looks at, divided by the number of lists.
const PROBES_FOURTH_POWER: usize = 200;
/// Lists that a query looks at whatever their number is.
const LEAST_PROBES: usize = 8;

/// The size of the lists and the effort of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct InvertedListsParams {
    /// Entries that a list holds before it is divided, at least 2. Default 128: shorter lists waste memory, longer ones
    /// make the search coarser.
    pub list_capacity: usize,
    /// Lists that a query looks at, at least 1. With `usize::MAX` the search is exact, and slower than
    /// [`crate::ExactScan`]. Default `None`: chosen by the number of lists, see [`InvertedLists::probes`].
    pub probes: Option<usize>,
}

impl Default for InvertedListsParams {
    fn default() -> Self {
        Self {
            list_capacity: 128,
            probes: None,
        }
    }
}

impl InvertedListsParams {
    fn check(&self) -> Result<(), IndexError> {
        for (name, given, least) in [
            ("list_capacity", self.list_capacity, 2),
            ("probes", self.probes.unwrap_or(1), 1),
        ] {
            if given < least {
                return Err(IndexError::ParameterTooSmall { name, given, least });
            }
        }
        Ok(())
    }
}

/// An approximate index: lists of near descriptors, of which a query scans the nearest.
///
/// Deterministic: equal parameters and equal sequences of changes give equal answers, on any number of threads and any
/// vector instructions. With lists of constant size, a query among n entries costs O(probes + n^(1/3)) scans of a list; a
/// change costs O(n^(1/3)) of them in the mean and divides at most one list.
///
/// ```
/// use feature_kdtree::{DescriptorIndex, InvertedLists, InvertedListsParams};
///
/// let look = |seed: usize| -> [u8; 128] { std::array::from_fn(|i| ((seed * 37 + 1) * (i + 3) * 71 % 251) as u8) };
/// let mut index = InvertedLists::new(InvertedListsParams::default())?;
/// for id in 0..200 {
///     index.insert(id, &look(id as usize))?;
/// }
/// assert!(index.list_count() > 1);
/// let nearest = index.two_nearest(&look(11)).expect("not empty").first;
/// assert_eq!((nearest.id, nearest.distance_squared), (11, 0));
/// assert!(index.remove(11));
/// assert_ne!(index.two_nearest(&look(11)).expect("not empty").first.id, 11);
/// # Ok::<(), feature_kdtree::IndexError>(())
/// ```
#[derive(Debug, Clone)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct InvertedLists {
    params: InvertedListsParams,
    #[cfg_attr(feature = "serde", serde(skip, default = "SimdLevel::best"))]
    level: SimdLevel,
    lists: Cells<Cells<Flat>>,
}

impl InvertedLists {
    /// An empty index on the widest vector instructions of this processor.
    ///
    /// # Errors
    /// [`IndexError::ParameterTooSmall`] for the first field out of range.
    pub fn new(params: InvertedListsParams) -> Result<Self, IndexError> {
        Self::with_level(params, SimdLevel::best())
    }

    /// An empty index on the vector instructions given, for tests and measurements.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn with_level(params: InvertedListsParams, level: SimdLevel) -> Result<Self, IndexError> {
        params.check()?;
        Ok(Self {
            params,
            level,
            lists: empty(level, params.list_capacity),
        })
    }

    /// The number of lists.
    #[must_use]
    pub fn list_count(&self) -> usize {
        self.lists.cell_count()
    }

    /// The number of lists that a query looks at now: that of the parameters or, by default, 11 of 100 lists, 21 of 1000,
    /// 37 of 10 000.
    #[must_use]
    pub fn probes(&self) -> usize {
        self.params
            .probes
            .unwrap_or_else(|| default_probes(self.lists.cell_count()))
    }

    /// Sets the number of lists that a query looks at; `None` goes back to the default. O(1).
    ///
    /// # Errors
    /// [`IndexError::ParameterTooSmall`] for zero; the index is then unchanged.
    pub fn set_probes(&mut self, probes: Option<usize>) -> Result<(), IndexError> {
        let params = InvertedListsParams {
            probes,
            ..self.params
        };
        params.check()?;
        self.params = params;
        Ok(())
    }

    /// Sorts all entries into lists afresh, as a function of the parameters and the present entries alone.
    ///
    /// Two indexes with equal parameters and entries answer equally after it, and go on doing so under equal
    /// changes, whatever their histories were. It costs as much as inserting all entries.
    pub fn rebuild(&mut self) {
        let mut entries = self.lists.entries();
        entries.sort_unstable_by_key(|&(id, _)| id);
        let mut lists = empty(self.level, self.params.list_capacity);
        for (id, descriptor) in &entries {
            lists.insert(*id, descriptor);
        }
        self.lists = lists;
    }

    /// Scans the nearest lists of each query.
    fn scan(&self, queries: &[PreparedQuery], best: &mut Vec<TwoKeys>) {
        self.lists
            .scan_nearest(queries, self.probes(), |rows, members| {
                scan_near(self.level, rows, queries, members, best);
            });
    }

    /// The answer of a scan; where it found one entry although there are two, the search goes on.
    fn complete(&self, query: &PreparedQuery, found: TwoKeys) -> Option<TwoNearest> {
        if found.second == u64::MAX && self.lists.len() > 1 {
            return self.search_on(query, self.probes(), &|_| true);
        }
        found.finish()
    }

    /// Scans more and more lists until two accepted entries are found or all lists are scanned.
    fn search_on(
        &self,
        query: &PreparedQuery,
        mut probes: usize,
        accept: &dyn Fn(u32) -> bool,
    ) -> Option<TwoNearest> {
        let query = std::slice::from_ref(query);
        let mut best = BestTwo::default();
        loop {
            self.lists.scan_nearest(query, probes, |rows, _| {
                row_scan::two_nearest_where(rows, self.level, &query[0], accept, &mut best);
            });
            if best.is_full() || probes >= self.lists.cell_count() {
                return best.finish();
            }
            probes = probes.saturating_mul(4);
        }
    }

    /// All entries, in no particular order.
    pub(crate) fn unordered_entries(&self) -> Vec<(u32, Descriptor)> {
        self.lists.entries()
    }
}

/// The number of lists that a query looks at by default, in proportion to the fourth root of their number.
///
/// Measured on SIFT descriptors of photographs: 0.97 of the nearest are found among ten thousand entries; 0.995 of the
/// matches of the ratio test are kept among a hundred thousand entries and 0.985 among a million.
fn default_probes(lists: usize) -> usize {
    lists
        .saturating_mul(PROBES_FOURTH_POWER)
        .isqrt()
        .isqrt()
        .max(LEAST_PROBES)
}

/// No lists yet, in two storeys.
fn empty(level: SimdLevel, list_capacity: usize) -> Cells<Cells<Flat>> {
    let storey = Cells::new(level, CENTROIDS_PER_CELL, Flat::new(level));
    Cells::new(level, list_capacity, storey)
}

impl DescriptorIndex for InvertedLists {
    fn insert(&mut self, id: u32, descriptor: &Descriptor) -> Result<(), IndexError> {
        if self.lists.contains(id) {
            return Err(IndexError::DuplicateId { id });
        }
        // Ids are unique numbers of 32 bits, so list numbers and positions never need more.
        self.lists.insert(id, descriptor);
        Ok(())
    }

    fn remove(&mut self, id: u32) -> bool {
        self.lists.remove(id)
    }

    fn descriptor(&self, id: u32) -> Option<Descriptor> {
        self.lists.get(id)
    }

    fn two_nearest(&self, query: &Descriptor) -> Option<TwoNearest> {
        let query = [PreparedQuery::new(query)];
        let mut best = vec![TwoKeys::NONE];
        self.scan(&query, &mut best);
        self.complete(&query[0], best[0])
    }

    fn two_nearest_where(
        &self,
        query: &Descriptor,
        accept: &dyn Fn(u32) -> bool,
    ) -> Option<TwoNearest> {
        self.search_on(&PreparedQuery::new(query), self.probes(), accept)
    }

    fn two_nearest_batch(&self, queries: &[Descriptor], found: &mut Vec<Option<TwoNearest>>) {
        found.clear();
        found.reserve(queries.len());
        for queries in queries.chunks(QUERIES_AT_A_TIME) {
            let queries: Vec<PreparedQuery> = queries.iter().map(PreparedQuery::new).collect();
            let mut best = vec![TwoKeys::NONE; queries.len()];
            self.scan(&queries, &mut best);
            let best = queries.iter().zip(best);
            found.extend(best.map(|(query, best)| self.complete(query, best)));
        }
    }

    fn nearest(&self, query: &Descriptor, k: usize) -> Vec<Neighbour> {
        let k = k.min(self.lists.len());
        if k == 0 {
            return Vec::new();
        }
        let query = [PreparedQuery::new(query)];
        let mut probes = self.probes();
        loop {
            let mut smallest = Smallest::new(k, 1);
            self.lists.scan_nearest(&query, probes, |rows, members| {
                scan_near(self.level, rows, &query, members, &mut smallest);
            });
            let keys = smallest.sorted(0);
            if keys.len() == k || probes >= self.lists.cell_count() {
                return keys.into_iter().map(neighbour).collect();
            }
            probes = probes.saturating_mul(4);
        }
    }

    fn within(&self, query: &Descriptor, radius_squared: u32) -> Vec<Neighbour> {
        let query = [PreparedQuery::new(query)];
        let mut within = Within {
            radius_squared,
            keys: Vec::new(),
        };
        self.lists
            .scan_nearest(&query, self.probes(), |rows, members| {
                scan_near(self.level, rows, &query, members, &mut within);
            });
        within.keys.sort_unstable();
        within.keys.into_iter().map(neighbour).collect()
    }

    fn entries(&self) -> Vec<(u32, Descriptor)> {
        let mut entries = self.unordered_entries();
        entries.sort_unstable_by_key(|&(id, _)| id);
        entries
    }

    fn len(&self) -> usize {
        self.lists.len()
    }

    fn memory_usage(&self) -> usize {
        self.lists.memory_usage()
    }
}

/// The neighbour of a key, distance over id.
fn neighbour(key: u64) -> Neighbour {
    Neighbour {
        distance_squared: (key >> 32) as u32,
        id: key as u32,
    }
}

/// The keys of all rows within a distance of one query.
#[derive(Debug, Clone)]
struct Within {
    radius_squared: u32,
    keys: Vec<u64>,
}

impl Collector for Within {
    fn limit(&self, _: u32) -> u32 {
        self.radius_squared
    }

    fn take(&mut self, _: u32, distance_squared: u32, id: u32) {
        if distance_squared <= self.radius_squared {
            self.keys
                .push(u64::from(distance_squared) << 32 | u64::from(id));
        }
    }
}

/// The keys (distance over id) of the two nearest so far; all bits are set where there is none.
#[derive(Debug, Clone, Copy)]
struct TwoKeys {
    first: u64,
    second: u64,
}

impl TwoKeys {
    const NONE: Self = Self {
        first: u64::MAX,
        second: u64::MAX,
    };

    fn finish(self) -> Option<TwoNearest> {
        let found = |key: u64| (key != u64::MAX).then(|| neighbour(key));
        Some(TwoNearest {
            first: found(self.first)?,
            second: found(self.second),
        })
    }
}

impl Collector for Vec<TwoKeys> {
    #[inline]
    fn limit(&self, query: u32) -> u32 {
        (self[query as usize].second >> 32) as u32
    }

    #[inline]
    fn take(&mut self, query: u32, distance_squared: u32, id: u32) {
        let best = &mut self[query as usize];
        let key = u64::from(distance_squared) << 32 | u64::from(id);
        if key < best.first {
            best.second = best.first;
            best.first = key;
        } else if key < best.second {
            best.second = key;
        }
    }
}
