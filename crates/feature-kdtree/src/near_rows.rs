//! The scan of a short list, most of whose rows are too far from the queries.
//!
//! [`crate::row_scan`] keeps the best of every lane, which pays over thousands of rows. In a list of a hundred rows, one of
//! many that a query visits, the distance to beat is known from the lists before: the kernel compares with it and reports
//! the few rows within. A collector that breaks ties by id makes the result independent of the order of rows and queries.

use simd_level::SimdLevel;

use crate::row_block::{LANES, NEAR_BLOCKS, NearRows, PreparedQuery};
use crate::rows::Rows;
use crate::simd;

/// Queries in a call that keep the kernel busy.
const NEAR_QUERIES: usize = 8;

/// Collects rows for each query of a batch.
pub(crate) trait Collector {
    /// The squared distance above which no row is taken for the query.
    fn limit(&self, query: u32) -> u32;

    /// Offers a row, which is taken or not.
    fn take(&mut self, query: u32, distance_squared: u32, id: u32);
}

/// Offers the collector every row within the limit of a query. `members` are the positions of the queries to search for.
pub(crate) fn scan_near(
    level: SimdLevel,
    rows: &Rows,
    queries: &[PreparedQuery],
    members: &[u32],
    collector: &mut impl Collector,
) {
    // A buffer for one query costs less to set up, and insertions ask for one at a time.
    if let [_] = members {
        scan_groups::<1>(level, rows, queries, members, collector);
    } else {
        scan_groups::<NEAR_QUERIES>(level, rows, queries, members, collector);
    }
}

#[inline]
fn scan_groups<const GROUP: usize>(
    level: SimdLevel,
    rows: &Rows,
    queries: &[PreparedQuery],
    members: &[u32],
    collector: &mut impl Collector,
) {
    let mut near = [NearRows::NONE; GROUP];
    let ids_of_runs = rows.ids().chunks(NEAR_BLOCKS * LANES);
    for (run, ids) in rows.blocks().chunks(NEAR_BLOCKS).zip(ids_of_runs) {
        for members in members.chunks(GROUP) {
            let mut group = [&queries[0]; GROUP];
            let mut limits = [0; GROUP];
            for ((slot, limit), &member) in group.iter_mut().zip(&mut limits).zip(members) {
                *slot = &queries[member as usize];
                *limit = slot.raw(collector.limit(member));
            }
            let count = members.len();
            simd::near(
                level,
                run,
                &group[..count],
                &limits[..count],
                &mut near[..count],
            );
            for ((near, query), &member) in near.iter().zip(group).zip(members) {
                for (block, ids) in ids.chunks(LANES).enumerate() {
                    let mut lanes = near.lanes[block];
                    while lanes != 0 {
                        let lane = lanes.trailing_zeros() as usize;
                        lanes &= lanes - 1;
                        // Lanes past the last row hold arbitrary values.
                        if let Some(&id) = ids.get(lane) {
                            let raw = near.distances[block].0[lane];
                            collector.take(member, query.distance_of_raw(raw), id);
                        }
                    }
                }
            }
        }
    }
}
