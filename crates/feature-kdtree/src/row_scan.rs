//! The exact scan over many rows: the two nearest of each query.
//!
//! The two nearest are joined to those found before, so several [`Rows`] are searched one after the other with the same
//! [`BestTwo`].
//!
//! Steps, for a run of blocks and a group of queries:
//! 1. The kernel keeps the two smallest keys of each of sixteen lanes.
//! 2. The second smallest distance over the lanes, or the one known before if smaller, is the limit: only rows up to it
//!    can be among the two nearest, and they are offered.
//! 3. Where the second key of a lane is at the limit, further rows of that lane may tie with it. A tie goes to the lower
//!    id. In rows sorted by id those kept are the lower ones already; otherwise the run is searched once more for
//!    everything up to the limit.

use std::ops::Range;

use simd_level::SimdLevel;

use crate::index::{BestTwo, Neighbour};
use crate::row_block::{LANES, Lanes, PreparedQuery, RUN_BLOCKS, RunBest, key_block};
use crate::rows::Rows;
use crate::simd;

/// Queries whose lanes are kept at a time; a multiple of the groups that every level takes.
const QUERIES_AT_A_TIME: usize = 24;
/// Blocks that all queries search before the next are loaded: as many as stay in the second-level cache.
const BLOCKS_A_RUN: usize = 128;
const _: () = assert!(BLOCKS_A_RUN <= RUN_BLOCKS);
/// Blocks whose distances are written at a time.
const BLOCKS_AT_A_TIME: usize = 16;

/// Joins the two rows nearest to `queries[m]` to `best[m]`, for every m of `members`.
///
/// `members` may name any part of the queries; naming one twice changes nothing. The more queries a call has, the less
/// each costs.
pub(crate) fn two_nearest_batch(
    rows: &Rows,
    level: SimdLevel,
    queries: &[PreparedQuery],
    members: &[u32],
    best: &mut [BestTwo],
) {
    match members.len() {
        0 => {}
        1 => search::<1>(rows, level, queries, members, best),
        2..=6 => search::<6>(rows, level, queries, members, best),
        _ => search::<QUERIES_AT_A_TIME>(rows, level, queries, members, best),
    }
}

/// Joins the two nearest of the rows whose id `accept` takes.
///
/// Only rows that are among the two nearest of the rows accepted before them are put to `accept`.
pub(crate) fn two_nearest_where(
    rows: &Rows,
    level: SimdLevel,
    query: &PreparedQuery,
    accept: impl Fn(u32) -> bool,
    best: &mut BestTwo,
) {
    offer_within(rows, level, 0..rows.blocks().len(), query, accept, best);
}

/// Writes the squared distances of the query to all rows, by position.
pub(crate) fn distances(rows: &Rows, level: SimdLevel, query: &PreparedQuery, out: &mut Vec<u32>) {
    out.clear();
    let mut distances = [(0, Lanes::LAST); BLOCKS_AT_A_TIME];
    for blocks in rows.blocks().chunks(BLOCKS_AT_A_TIME) {
        simd::distances(level, blocks, query, 0, &mut distances);
        for (_, distances) in &distances[..blocks.len()] {
            out.extend(distances.0.map(|raw| query.distance_of_raw(raw)));
        }
    }
    out.truncate(rows.ids().len());
}

/// Searches for N queries at a time: room that is not used costs as much as a short list.
fn search<const N: usize>(
    rows: &Rows,
    level: SimdLevel,
    queries: &[PreparedQuery],
    members: &[u32],
    best: &mut [BestTwo],
) {
    let used = rows.ids().len() - rows.blocks().len().saturating_sub(1) * LANES;
    let (full, absent) = (Lanes([0; LANES]), Lanes::absent_from(used));
    for start in (0..rows.blocks().len()).step_by(BLOCKS_A_RUN) {
        let span = start..rows.blocks().len().min(start + BLOCKS_A_RUN);
        let run = &rows.blocks()[span.clone()];
        let ends = span.end == rows.blocks().len();
        let absent = if ends { &absent } else { &full };
        for members in members.chunks(N) {
            let mut group = [&queries[members[0] as usize]; N];
            let mut learnt = [RunBest::new(0); N];
            for (i, &m) in members.iter().enumerate() {
                group[i] = &queries[m as usize];
                let worst = best[m as usize].worst_distance_squared();
                learnt[i].limit = group[i].last_key_at(worst);
            }
            let (group, learnt) = (&group[..members.len()], &mut learnt[..members.len()]);
            simd::run_best(level, run, absent, group, learnt);
            for (i, &m) in members.iter().enumerate() {
                join(
                    rows,
                    level,
                    &span,
                    &learnt[i],
                    group[i],
                    &mut best[m as usize],
                );
            }
        }
    }
}

/// Steps 2 and 3 for the run of blocks `span`.
#[inline]
fn join(
    rows: &Rows,
    level: SimdLevel,
    span: &Range<usize>,
    learnt: &RunBest,
    query: &PreparedQuery,
    best: &mut BestTwo,
) {
    for (mask, keys) in [
        (learnt.first_within, &learnt.first),
        (learnt.second_within, &learnt.second),
    ] {
        for lane in bits(mask) {
            let key = keys.0[lane];
            best.offer(Neighbour {
                distance_squared: query.distance_of(key),
                id: rows.ids()[(span.start + key_block(key)) * LANES + lane],
            });
        }
    }
    if learnt.second_within != 0 && !rows.is_sorted() {
        offer_within(rows, level, span.clone(), query, |_| true, best);
    }
}

/// Offers every accepted row of a span of blocks that may be among the two nearest.
fn offer_within(
    rows: &Rows,
    level: SimdLevel,
    span: Range<usize>,
    query: &PreparedQuery,
    accept: impl Fn(u32) -> bool,
    best: &mut BestTwo,
) {
    let mut distances = [(0, Lanes::LAST); BLOCKS_AT_A_TIME];
    let mut limit = query.raw(best.worst_distance_squared());
    for start in span.clone().step_by(BLOCKS_AT_A_TIME) {
        let end = span.end.min(start + BLOCKS_AT_A_TIME);
        simd::distances(
            level,
            &rows.blocks()[start..end],
            query,
            limit,
            &mut distances,
        );
        for (block, (mask, distances)) in (start..end).zip(&distances) {
            for lane in bits(*mask) {
                let raw = distances.0[lane];
                // No id: a lane of the last block without a row.
                if let Some(&id) = rows.ids().get(block * LANES + lane)
                    && raw <= limit
                    && accept(id)
                {
                    best.offer(Neighbour {
                        distance_squared: query.distance_of_raw(raw),
                        id,
                    });
                    limit = query.raw(best.worst_distance_squared());
                }
            }
        }
    }
}

/// The positions of the bits that are set, ascending.
#[inline]
fn bits(mut mask: u16) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = mask.trailing_zeros() as usize;
        let some = mask != 0;
        mask &= mask.wrapping_sub(1);
        some.then_some(lane)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Descriptor;
    use crate::distance_squared;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn random(rng: &mut ChaCha8Rng, values: &[u8]) -> Descriptor {
        std::array::from_fn(|_| values[rng.random_range(0..values.len())])
    }

    fn offer_all(
        best: &mut BestTwo,
        entries: &[(u32, Descriptor)],
        query: &Descriptor,
        accept: impl Fn(u32) -> bool,
    ) {
        for (id, descriptor) in entries.iter().filter(|(id, _)| accept(*id)) {
            best.offer(Neighbour {
                distance_squared: distance_squared(query, descriptor),
                id: *id,
            });
        }
    }

    /// Bytes to draw components from: all, the extremes, one, and so few that most distances tie.
    fn kinds() -> [Vec<u8>; 4] {
        [
            (0..=255).collect(),
            vec![0, 255],
            vec![7],
            [vec![50; 200], vec![51]].concat(),
        ]
    }

    /// Around the borders of blocks, register blocks and runs.
    const SIZES: [usize; 18] = [
        0, 1, 2, 3, 15, 16, 17, 31, 33, 64, 65, 80, 129, 300, 2047, 2048, 2049, 4100,
    ];

    fn check(ids: impl Fn(u32) -> u32, sorted: bool) {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        // 9 = 6 + 2 + 1 and 4 + 4 + 1: every size of group.
        let all: Vec<u32> = (0..9).collect();
        for kind in kinds() {
            for size in SIZES {
                let mut rows = Rows::default();
                let mut model = Vec::new();
                for i in 0..size as u32 {
                    let descriptor = random(&mut rng, &kind);
                    rows.push(ids(i), &descriptor);
                    model.push((ids(i), descriptor));
                }
                assert!(rows.is_sorted() == sorted || size < 3);
                let queries: Vec<Descriptor> =
                    all.iter().map(|_| random(&mut rng, &kind)).collect();
                let prepared: Vec<_> = queries.iter().map(PreparedQuery::new).collect();
                // Something found elsewhere before: at the distance of half the queries' nearest.
                let elsewhere = [(u32::MAX, random(&mut rng, &kind))];
                let third = |id: u32| id % 3 == 1;
                for level in SimdLevel::available() {
                    let mut best = vec![BestTwo::default(); queries.len()];
                    for (query, best) in queries.iter().zip(&mut best).skip(4) {
                        offer_all(best, &elsewhere, query, |_| true);
                    }
                    let before = best.clone();
                    two_nearest_batch(&rows, level, &prepared, &all, &mut best);
                    for q in 0..queries.len() {
                        let mut expected = before[q];
                        offer_all(&mut expected, &model, &queries[q], |_| true);
                        assert_eq!(best[q].finish(), expected.finish(), "{level:?}, {size}");
                        let (mut expected, mut filtered) = (before[q], before[q]);
                        offer_all(&mut expected, &model, &queries[q], third);
                        two_nearest_where(&rows, level, &prepared[q], third, &mut filtered);
                        assert_eq!(filtered.finish(), expected.finish(), "{level:?}, {size}");
                    }
                }
            }
        }
    }

    #[test]
    fn every_level_agrees_with_the_naive_model_on_sorted_rows() {
        check(|i| 3 * i, true);
    }

    #[test]
    fn every_level_agrees_with_the_naive_model_on_unsorted_rows() {
        // An odd factor permutes the 32-bit words.
        check(|i| i.wrapping_mul(0x9e37_79b1), false);
        check(|i| 1_000_000 - i, false);
    }

    #[test]
    fn members_are_searched_and_others_left_alone() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let all: Vec<u8> = (0..=255).collect();
        let mut rows = Rows::default();
        for id in 0..100 {
            rows.push(id, &random(&mut rng, &all));
        }
        let queries: Vec<_> = (0..60)
            .map(|_| PreparedQuery::new(&random(&mut rng, &all)))
            .collect();
        let members: Vec<u32> = (0..60).filter(|m| m % 3 != 1).collect();
        let level = SimdLevel::best();
        let mut best = vec![BestTwo::default(); 60];
        two_nearest_batch(&rows, level, &queries, &members, &mut best);
        for m in 0..60 {
            let mut alone = vec![BestTwo::default(); 60];
            two_nearest_batch(&rows, level, &queries, &[m as u32], &mut alone);
            let expected = if m % 3 == 1 { None } else { alone[m].finish() };
            assert_eq!(best[m].finish(), expected);
        }
        two_nearest_batch(&rows, level, &queries, &[], &mut best);
    }

    #[test]
    fn distances_are_exact_at_the_extremes() {
        for (row, query) in [(0, 255), (255, 0), (255, 255), (0, 0), (128, 127)] {
            // One bit of the norm is carried separately: both parities.
            for odd in [0, 1] {
                let (row, mut query) = ([row; 128], [query; 128]);
                query[77] ^= odd;
                let mut rows = Rows::default();
                rows.push(5, &row);
                for level in SimdLevel::available() {
                    let mut best = [BestTwo::default()];
                    two_nearest_batch(&rows, level, &[PreparedQuery::new(&query)], &[0], &mut best);
                    let expected = Neighbour {
                        distance_squared: distance_squared(&row, &query),
                        id: 5,
                    };
                    let found = best[0].finish().unwrap();
                    assert_eq!((found.first, found.second), (expected, None), "{level:?}");
                }
            }
        }
    }
}
