//! The kernels in plain Rust: what runs where the processor has neither AVX2 nor AVX-512, and the reference for both.
//!
//! The compiler makes SSE2 of them on x86-64 and NEON on aarch64. Bytes are taken as pairs of sixteen-bit halves, which
//! every one of these instruction sets multiplies and adds in one step.

use crate::row_block::{
    BLOCK_BITS, BLOCK_MASK, LANES, Lanes, NearRows, PreparedQuery, RowBlock, RunBest,
};

/// See [`super::run_best`].
pub(super) fn run_best(
    run: &[RowBlock],
    absent: &Lanes,
    queries: &[&PreparedQuery],
    best: &mut [RunBest],
) {
    for (number, block) in (0_u32..).zip(run) {
        let last = number as usize + 1 == run.len();
        let out = if last { *absent } else { Lanes([0; LANES]) };
        for (query, best) in queries.iter().zip(&mut *best) {
            let distances = distances_of(block, query);
            for lane in 0..LANES {
                let key = (distances.0[lane] << BLOCK_BITS | number) | out.0[lane];
                let first = best.first.0[lane];
                best.second.0[lane] = best.second.0[lane].min(first.max(key));
                best.first.0[lane] = first.min(key);
            }
        }
    }
    for best in best {
        let (mut first, mut second) = (u32::MAX, u32::MAX);
        for lane in 0..LANES {
            let (a, b) = (best.first.0[lane], best.second.0[lane]);
            second = second.min(b).min(first.max(a));
            first = first.min(a);
        }
        best.limit = best.limit.min(second | BLOCK_MASK);
        best.first_within = within(&best.first, best.limit);
        best.second_within = within(&best.second, best.limit);
    }
}

/// See [`super::distances`].
pub(super) fn distances(
    run: &[RowBlock],
    query: &PreparedQuery,
    limit: u32,
    out: &mut [(u16, Lanes)],
) {
    for (block, out) in run.iter().zip(out) {
        let distances = distances_of(block, query);
        *out = (within(&distances, limit), distances);
    }
}

/// See [`super::near`].
pub(super) fn near(
    run: &[RowBlock],
    queries: &[&PreparedQuery],
    limits: &[u32],
    near: &mut [NearRows],
) {
    for ((query, &limit), near) in queries.iter().zip(limits).zip(near) {
        for (number, block) in run.iter().enumerate() {
            let distances = distances_of(block, query);
            near.lanes[number] = within(&distances, limit);
            near.distances[number] = distances;
        }
    }
}

/// d + p of a query and the rows of a block.
#[inline]
fn distances_of(block: &RowBlock, query: &PreparedQuery) -> Lanes {
    let mut dots = [query.start; LANES];
    for ((group, &even), &odd) in block.groups.iter().zip(&query.even).zip(&query.odd) {
        for (dot, row) in dots.iter_mut().zip(group) {
            let word = u32::from_le_bytes(*row);
            *dot = dot
                .wrapping_add(pair_product(word & 0x00ff_00ff, even))
                .wrapping_add(pair_product(word >> 8 & 0x00ff_00ff, odd));
        }
    }
    let mut distances = [0; LANES];
    for lane in 0..LANES {
        let d = block.bias[lane].wrapping_sub(dots[lane].wrapping_mul(2));
        distances[lane] = d.cast_unsigned();
    }
    Lanes(distances)
}

/// The sum of the products of the signed sixteen-bit halves.
#[inline]
fn pair_product(a: u32, b: i32) -> i32 {
    let a = a.cast_signed();
    let low = i32::from(a as i16).wrapping_mul(i32::from(b as i16));
    let high = (a >> 16).wrapping_mul(b >> 16);
    low.wrapping_add(high)
}

/// The lanes of at most `limit`, as bits.
fn within(lanes: &Lanes, limit: u32) -> u16 {
    (0..LANES).fold(0, |mask, lane| {
        mask | u16::from(lanes.0[lane] <= limit) << lane
    })
}
