//! Storage of numbered descriptors, and the exact scan over it.
//!
//! How to use it: `push` and `swap_remove` keep the rows without gaps; [`Rows::two_nearest_batch`] joins the two
//! nearest of all rows to what each query has found elsewhere, so several `Rows` are searched one after the other
//! with the same [`BestTwo`]. The kernel works on groups of queries: the more queries a call has, the faster each.
//!
//! Steps of the scan, for a run of blocks and a group of queries:
//! 1. the kernel keeps the two smallest keys of each of sixteen lanes;
//! 2. the second smallest distance over the lanes, or the one known before if smaller, is the limit: only rows
//!    up to it can be among the two nearest, and they are offered;
//! 3. where the second key of a lane is at the limit, further rows of that lane may tie with it. A tie goes to
//!    the lower id. In rows sorted by id those kept are the lower ones already; otherwise the run is looked
//!    through once more for everything up to the limit.

use crate::Descriptor;
use crate::MAX_DISTANCE_SQUARED;
use crate::Neighbour;
use crate::index::BestTwo;
use crate::row_block::{
    LANES, LaneBest, Lanes, PreparedQuery, RUN_BLOCKS, RowBlock, key_block, key_distance,
};
use crate::simd::Level;

/// Queries whose lanes are kept at a time; a multiple of what every level takes in a group.
const QUERIES_AT_A_TIME: usize = 24;
/// Blocks whose distances are written out at a time.
const BLOCKS_AT_A_TIME: usize = 16;

/// Descriptors under ids, searched exactly.
///
/// The ids are not checked: what holds the rows keeps them unique.
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    blocks: Vec<RowBlock>,
    ids: Vec<u32>,
    /// Ids ascend with the position.
    sorted: bool,
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

    /// Ids by position.
    pub(crate) fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// The descriptor at a position below `len`.
    pub(crate) fn descriptor(&self, position: usize) -> Descriptor {
        self.blocks[position / LANES].get(position % LANES)
    }

    /// Adds a row at the end.
    pub(crate) fn push(&mut self, id: u32, descriptor: &Descriptor) {
        let position = self.ids.len();
        if position.is_multiple_of(LANES) {
            self.blocks.push(RowBlock::EMPTY);
        }
        self.blocks[position / LANES].set(position % LANES, descriptor);
        self.sorted &= self.ids.last().is_none_or(|&last| last < id);
        self.ids.push(id);
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

    /// Removes all rows, keeping the memory.
    pub(crate) fn clear(&mut self) {
        self.blocks.clear();
        self.ids.clear();
        self.sorted = true;
    }

    /// Bytes on the heap.
    pub(crate) fn memory_usage(&self) -> usize {
        self.blocks.capacity() * size_of::<RowBlock>() + self.ids.capacity() * size_of::<u32>()
    }

    /// Joins the two nearest rows of `queries[m]` to `best[m]`, for every m of `members`.
    ///
    /// `members` may name any part of the queries; a query named twice is only searched twice.
    pub(crate) fn two_nearest_batch(
        &self,
        level: Level,
        queries: &[PreparedQuery],
        members: &[u32],
        best: &mut [BestTwo],
    ) {
        let absent = self.absent();
        for (run, start) in self
            .blocks
            .chunks(RUN_BLOCKS)
            .zip((0..).step_by(RUN_BLOCKS))
        {
            let whole = if start + run.len() == self.blocks.len() {
                &absent
            } else {
                &Lanes([0; LANES])
            };
            for members in members.chunks(QUERIES_AT_A_TIME) {
                let mut lanes = [LaneBest::NONE; QUERIES_AT_A_TIME];
                let lanes = &mut lanes[..members.len()];
                let mut group = [&queries[members[0] as usize]; QUERIES_AT_A_TIME];
                for (slot, &m) in group.iter_mut().zip(members) {
                    *slot = &queries[m as usize];
                }
                level.lane_best(run, whole, &group[..members.len()], lanes);
                for (&m, lanes) in members.iter().zip(&*lanes) {
                    let m = m as usize;
                    self.join(
                        level,
                        start..start + run.len(),
                        lanes,
                        &queries[m],
                        &mut best[m],
                    );
                }
            }
        }
    }

    /// Joins the two nearest rows among those whose id `accept` takes.
    ///
    /// Asks `accept` only about rows near enough to be among the two nearest of the rows before them.
    pub(crate) fn two_nearest_where(
        &self,
        level: Level,
        query: &PreparedQuery,
        accept: impl Fn(u32) -> bool,
        best: &mut BestTwo,
    ) {
        self.offer_within(level, 0..self.blocks.len(), query, u32::MAX, accept, best);
    }

    /// Lanes of the last block without a row.
    fn absent(&self) -> Lanes {
        Lanes::absent_from(self.ids.len() - self.blocks.len().saturating_sub(1) * LANES)
    }

    /// Steps 2 and 3 for the run of blocks `span`.
    #[inline]
    fn join(
        &self,
        level: Level,
        span: std::ops::Range<usize>,
        lanes: &LaneBest,
        query: &PreparedQuery,
        best: &mut BestTwo,
    ) {
        let limit = second_smallest(lanes)
            .min(best.worst_distance_squared())
            .min(MAX_DISTANCE_SQUARED);
        let mut may_tie = false;
        for lane in 0..LANES {
            for (keys, is_second) in [(&lanes.first, false), (&lanes.second, true)] {
                let key = keys.0[lane];
                if key_distance(key) <= limit {
                    best.offer(Neighbour {
                        distance_squared: key_distance(key),
                        id: self.ids[(span.start + key_block(key)) * LANES + lane],
                    });
                    may_tie |= is_second;
                }
            }
        }
        if may_tie && !self.sorted {
            self.offer_within(level, span, query, limit, |_| true, best);
        }
    }

    /// Offers every accepted row of a span of blocks at a distance of at most `limit`.
    fn offer_within(
        &self,
        level: Level,
        span: std::ops::Range<usize>,
        query: &PreparedQuery,
        limit: u32,
        accept: impl Fn(u32) -> bool,
        best: &mut BestTwo,
    ) {
        let mut distances = [Lanes::LAST; BLOCKS_AT_A_TIME];
        for start in span.clone().step_by(BLOCKS_AT_A_TIME) {
            let end = span.end.min(start + BLOCKS_AT_A_TIME);
            level.distances(&self.blocks[start..end], query, &mut distances);
            for (block, distances) in (start..end).zip(&distances) {
                let mut limit = limit.min(best.worst_distance_squared());
                let nearest = distances.0.iter().fold(u32::MAX, |least, &d| least.min(d));
                if nearest > limit {
                    continue;
                }
                // Stops at the last row: lanes without a row are not reached.
                let ids = &self.ids[block * LANES..];
                for (&distance_squared, &id) in distances.0.iter().zip(ids) {
                    if distance_squared <= limit && accept(id) {
                        best.offer(Neighbour {
                            distance_squared,
                            id,
                        });
                        limit = limit.min(best.worst_distance_squared());
                    }
                }
            }
        }
    }
}

/// Second smallest distance in the lanes.
#[inline]
fn second_smallest(lanes: &LaneBest) -> u32 {
    let (mut first, mut second) = (lanes.first, lanes.second);
    let mut width = LANES;
    while width > 1 {
        width /= 2;
        for lane in 0..width {
            let other = lane + width;
            let larger = first.0[lane].max(first.0[other]);
            second.0[lane] = second.0[lane].min(second.0[other]).min(larger);
            first.0[lane] = first.0[lane].min(first.0[other]);
        }
    }
    key_distance(second.0[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance_squared;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn random(rng: &mut ChaCha8Rng, values: &[u8]) -> Descriptor {
        std::array::from_fn(|_| values[rng.random_range(0..values.len())])
    }

    fn naive(entries: &[(u32, Descriptor)], query: &Descriptor) -> BestTwo {
        let mut best = BestTwo::default();
        for (id, descriptor) in entries {
            best.offer(Neighbour {
                distance_squared: distance_squared(query, descriptor),
                id: *id,
            });
        }
        best
    }

    /// Bytes to draw components from: all, the extremes, and so few that most distances tie.
    fn kinds() -> [Vec<u8>; 4] {
        [
            (0..=255).collect(),
            vec![0, 255],
            vec![7],
            [vec![50; 200], vec![51]].concat(),
        ]
    }

    #[test]
    fn every_level_agrees_with_the_naive_model() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let sizes = [0, 1, 2, 3, 15, 16, 17, 31, 33, 64, 65, 129, 300];
        for kind in kinds() {
            for size in sizes {
                let mut rows = Rows::default();
                let mut model = Vec::new();
                for i in 0..size {
                    // Ids neither dense nor sorted: an odd factor permutes the 32-bit words.
                    let id = (i as u32).wrapping_mul(0x9e37_79b1);
                    let descriptor = random(&mut rng, &kind);
                    rows.push(id, &descriptor);
                    model.push((id, descriptor));
                }
                let queries: Vec<Descriptor> = (0..53).map(|_| random(&mut rng, &kind)).collect();
                let prepared: Vec<_> = queries.iter().map(PreparedQuery::new).collect();
                let members: Vec<u32> = (0..53).collect();
                for level in Level::available() {
                    let mut best = vec![BestTwo::default(); 53];
                    rows.two_nearest_batch(level, &prepared, &members, &mut best);
                    for (query, best) in queries.iter().zip(best) {
                        let expected = naive(&model, query).finish();
                        assert_eq!(best.finish(), expected, "{level:?}, {size} rows");
                    }
                }
            }
        }
    }
}
