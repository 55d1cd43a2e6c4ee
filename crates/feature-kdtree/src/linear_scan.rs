//! Exact search among descriptors of any kind: any length, bytes, floats or bits.
//!
//! Every query looks at every row. For SIFT's 128 bytes [`crate::ExactScan`] is the same with kernels of its own, several
//! times faster; this is for the others (SURF, ORB, BRISK, learnt descriptors), up to some tens of thousands of rows.
//!
//! Neighbours are ordered by distance, ties by id, so that no answer depends on the order of insertion or on the vector
//! instructions.

use std::marker::PhantomData;

use simd_level::SimdLevel;

use crate::IndexError;
use crate::id_map::IdMap;
use crate::metric::{Distance, Metric};

/// Rows whose distances are computed at a time.
const ROWS_AT_A_TIME: usize = 1024;

/// An entry and its distance to a query.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found<T> {
    /// Id given at insertion.
    pub id: u32,
    /// The distance by the metric of the scan.
    pub distance: T,
}

/// A query and the entry it is matched with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Matched<T> {
    /// The position among the queries.
    pub query: u32,
    /// The id of the entry.
    pub id: u32,
    /// The distance by the metric of the scan.
    pub distance: T,
    /// The distance to the nearest over that to the second nearest, not squared; below the ratio asked for.
    pub ratio: f64,
}

/// An exact index of descriptors of type `D` under the metric `M`.
///
/// ```
/// use feature_kdtree::{Hamming, LinearScan, SquaredEuclidean};
///
/// // ORB: 256 bits.
/// let mut map = LinearScan::<[u8; 32], Hamming>::new();
/// map.insert(7, &[0b1111_0000; 32])?;
/// map.insert(9, &[0; 32])?;
/// let mut seen = [0b1111_0000; 32];
/// seen[3] ^= 1;
/// let nearest = map.nearest(&seen, 2)?;
/// assert_eq!((nearest[0].id, nearest[0].distance), (7, 1));
/// assert_eq!(map.within(&seen, 10)?.len(), 1);
///
/// // Floats, 64 of them.
/// let mut map = LinearScan::<[f32; 64], SquaredEuclidean>::new();
/// map.insert(1, &[0.5; 64])?;
/// assert_eq!(map.nearest(&[0.0; 64], 1)?[0].distance, 16.0);
/// # Ok::<(), feature_kdtree::IndexError>(())
/// ```
#[derive(Debug, Clone)]
pub struct LinearScan<D, M> {
    rows: Vec<D>,
    ids: Vec<u32>,
    position_of: IdMap,
    level: SimdLevel,
    metric: PhantomData<fn() -> M>,
}

impl<D: Clone, M: Metric<D>> Default for LinearScan<D, M> {
    fn default() -> Self {
        Self::new()
    }
}

impl<D: Clone, M: Metric<D>> LinearScan<D, M> {
    /// An empty index on the widest vector instructions of this processor.
    #[must_use]
    pub fn new() -> Self {
        Self::with_level(SimdLevel::best())
    }

    /// An empty index on the vector instructions given, for tests and measurements.
    #[must_use]
    pub fn with_level(level: SimdLevel) -> Self {
        Self {
            rows: Vec::new(),
            ids: Vec::new(),
            position_of: IdMap::default(),
            level,
            metric: PhantomData,
        }
    }

    /// Adds a descriptor under an id of the caller's choice. O(1).
    ///
    /// # Errors
    /// [`IndexError::DuplicateId`], or [`IndexError::NotFinite`] for NaN or infinity; the index is then unchanged.
    pub fn insert(&mut self, id: u32, descriptor: &D) -> Result<(), IndexError> {
        M::check(descriptor)?;
        // Ids are unique numbers of 32 bits, so a position never needs more.
        if !self.position_of.insert_new(id, self.rows.len() as u32) {
            return Err(IndexError::DuplicateId { id });
        }
        self.rows.push(descriptor.clone());
        self.ids.push(id);
        Ok(())
    }

    /// Removes an entry; `false` when the id is not present. O(1).
    pub fn remove(&mut self, id: u32) -> bool {
        let Some(position) = self.position_of.remove(id) else {
            return false;
        };
        self.rows.swap_remove(position as usize);
        self.ids.swap_remove(position as usize);
        if let Some(&moved) = self.ids.get(position as usize) {
            self.position_of.set(moved, position);
        }
        true
    }

    /// The descriptor of an entry; `None` when the id is not present.
    #[must_use]
    pub fn get(&self, id: u32) -> Option<&D> {
        Some(&self.rows[self.position_of.get(id)? as usize])
    }

    /// The number of entries.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there is no entry.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// All entries, in the order of insertion as long as nothing was removed.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (u32, &D)> {
        self.ids.iter().copied().zip(&self.rows)
    }

    /// The `k` entries nearest to the query, the nearest first; fewer where there are fewer. O(entries).
    ///
    /// # Errors
    /// [`IndexError::NotFinite`] for a query with NaN or infinity.
    pub fn nearest(&self, query: &D, k: usize) -> Result<Vec<Found<M::Distance>>, IndexError> {
        M::check(query)?;
        Ok(found(self.smallest_keys(query, k)))
    }

    /// All entries at a distance of at most `radius` (squared where the metric is), the nearest first. O(entries).
    ///
    /// # Errors
    /// [`IndexError::NotFinite`] for a query with NaN or infinity.
    pub fn within(
        &self,
        query: &D,
        radius: M::Distance,
    ) -> Result<Vec<Found<M::Distance>>, IndexError> {
        M::check(query)?;
        let mut keys = Vec::new();
        self.for_each_distance(query, |distance, id| {
            if distance <= radius {
                keys.push(key(distance, id));
            }
        });
        keys.sort_unstable();
        Ok(found(keys))
    }

    /// Matches queries by the ratio test, each entry to at most one query: see [`crate::match_descriptors`].
    ///
    /// `ratio`, in 0 to 1, is one of distances, not of squares, whatever the metric. Matches come in the order of the queries.
    ///
    /// # Errors
    /// [`IndexError::Ratio`], [`IndexError::NotFinite`] for a query, [`IndexError::TooMany`] beyond `u32::MAX` queries.
    pub fn matches(
        &self,
        queries: &[D],
        ratio: f32,
    ) -> Result<Vec<Matched<M::Distance>>, IndexError> {
        if !(0.0..=1.0).contains(&ratio) {
            return Err(IndexError::Ratio { given: ratio });
        }
        if u32::try_from(queries.len()).is_err() {
            return Err(IndexError::TooMany {
                given: queries.len(),
                most: u32::MAX as usize,
            });
        }
        let mut matches = Vec::new();
        for (query, descriptor) in (0_u32..).zip(queries) {
            M::check(descriptor)?;
            let two = found::<M::Distance>(self.smallest_keys(descriptor, 2));
            if let [first, second] = two[..] {
                let (near, far): (f64, f64) = (first.distance.into(), second.distance.into());
                let of_metric = near / far;
                let found_ratio = if M::SQUARED {
                    of_metric.sqrt()
                } else {
                    of_metric
                };
                // Two at distance zero give NaN, which identifies neither.
                if found_ratio < f64::from(ratio) {
                    matches.push(Matched {
                        query,
                        id: first.id,
                        distance: first.distance,
                        ratio: found_ratio,
                    });
                }
            }
        }
        matches.sort_unstable_by_key(|one| (one.id, one.distance.key(), one.query));
        matches.dedup_by_key(|one| one.id);
        matches.sort_unstable_by_key(|one| one.query);
        Ok(matches)
    }

    /// The `k` smallest keys, ascending.
    fn smallest_keys(&self, query: &D, k: usize) -> Vec<u64> {
        let k = k.min(self.len());
        if k == 0 {
            return Vec::new();
        }
        let room = (2 * k).max(64);
        let (mut keys, mut bound) = (Vec::with_capacity(room), u64::MAX);
        self.for_each_distance(query, |distance, id| {
            let key = key(distance, id);
            if key < bound {
                keys.push(key);
                if keys.len() == room {
                    keys.select_nth_unstable(k - 1);
                    keys.truncate(k);
                    bound = keys[k - 1];
                }
            }
        });
        keys.sort_unstable();
        keys.truncate(k);
        keys
    }

    fn for_each_distance(&self, query: &D, mut take: impl FnMut(M::Distance, u32)) {
        let mut distances = Vec::with_capacity(ROWS_AT_A_TIME.min(self.len()));
        let ids = self.ids.chunks(ROWS_AT_A_TIME);
        for (rows, ids) in self.rows.chunks(ROWS_AT_A_TIME).zip(ids) {
            distances.clear();
            M::distances(self.level, query, rows, &mut distances);
            for (&distance, &id) in distances.iter().zip(ids) {
                take(distance, id);
            }
        }
    }
}

/// A distance over an id: ordered as neighbours are preferred.
fn key(distance: impl Distance, id: u32) -> u64 {
    u64::from(distance.key()) << 32 | u64::from(id)
}

fn found<T: Distance>(keys: Vec<u64>) -> Vec<Found<T>> {
    let of_key = |key: u64| Found {
        id: key as u32,
        distance: T::of_key((key >> 32) as u32),
    };
    keys.into_iter().map(of_key).collect()
}
