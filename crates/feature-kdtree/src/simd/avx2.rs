//! The kernels for AVX2: the bytes of a row are split into even and odd ones, each a vector of sixteen-bit pairs, which
//! `vpmaddwd` multiplies and adds.
//!
//! Four queries and one block are taken at a time, eight sums in registers, so that each row that is loaded and split
//! serves four queries.

use std::arch::x86_64::*;

use crate::row_block::{
    BLOCK_BITS, BLOCK_MASK, GROUPS, LANES, Lanes, NearRows, PreparedQuery, RowBlock, RunBest,
};

/// A block is two vectors of eight lanes.
type Pair = [__m256i; 2];

/// See [`super::run_best`].
#[target_feature(enable = "avx2")]
pub(super) fn run_best(
    run: &[RowBlock],
    absent: &Lanes,
    queries: &[&PreparedQuery],
    best: &mut [RunBest],
) {
    let (four, queries) = queries.as_chunks::<4>();
    let (best_four, best) = best.as_chunks_mut::<4>();
    for (queries, best) in four.iter().zip(best_four) {
        group::<4>(run, absent, *queries, best);
    }
    for (query, best) in queries.iter().zip(best) {
        group::<1>(run, absent, [query], std::array::from_mut(best));
    }
}

/// See [`super::distances`].
#[target_feature(enable = "avx2")]
pub(super) fn distances(
    run: &[RowBlock],
    query: &PreparedQuery,
    limit: u32,
    out: &mut [(u16, Lanes)],
) {
    for (block, out) in run.iter().zip(out) {
        let [sums] = dots(block, [query]);
        let mut distances = load(&block.bias);
        for half in 0..2 {
            let twice = _mm256_slli_epi32::<1>(sums[half]);
            distances[half] = _mm256_sub_epi32(distances[half], twice);
        }
        out.0 = within(distances, limit);
        store(&mut out.1, distances);
    }
}

/// See [`super::near`].
#[target_feature(enable = "avx2")]
pub(super) fn near(
    run: &[RowBlock],
    queries: &[&PreparedQuery],
    limits: &[u32],
    near: &mut [NearRows],
) {
    let (four, queries) = queries.as_chunks::<4>();
    let (limits_four, limits) = limits.as_chunks::<4>();
    let (near_four, near) = near.as_chunks_mut::<4>();
    for ((queries, limits), near) in four.iter().zip(limits_four).zip(near_four) {
        near_group(run, *queries, limits, near);
    }
    for ((query, &limit), near) in queries.iter().zip(limits).zip(near) {
        near_group(run, [*query], &[limit], std::array::from_mut(near));
    }
}

/// Takes Q queries and a run of blocks, then finds the lanes within the limit.
#[inline]
#[target_feature(enable = "avx2")]
fn group<const Q: usize>(
    run: &[RowBlock],
    absent: &Lanes,
    queries: [&PreparedQuery; Q],
    best: &mut [RunBest; Q],
) {
    let Some((last, full)) = run.split_last() else {
        return;
    };
    for (number, block) in full.iter().enumerate() {
        join(block, number, None, queries, best);
    }
    join(last, full.len(), Some(absent), queries, best);
    for best in best {
        finish(best);
    }
}

/// Joins the rows of a block to the best keys of Q queries, except in the lanes that `absent` names.
#[inline]
#[target_feature(enable = "avx2")]
fn join<const Q: usize>(
    block: &RowBlock,
    number: usize,
    absent: Option<&Lanes>,
    queries: [&PreparedQuery; Q],
    best: &mut [RunBest; Q],
) {
    let sums = dots(block, queries);
    let number = _mm256_set1_epi32(number as i32);
    let mut base = load(&block.bias);
    for half in 0..2 {
        let bias = _mm256_slli_epi32::<{ BLOCK_BITS as i32 }>(base[half]);
        base[half] = _mm256_add_epi32(bias, number);
    }
    for q in 0..Q {
        let mut first = load(&best[q].first.0);
        let mut second = load(&best[q].second.0);
        for half in 0..2 {
            let twice = _mm256_slli_epi32::<{ BLOCK_BITS as i32 + 1 }>(sums[q][half]);
            let mut key = _mm256_sub_epi32(base[half], twice);
            if let Some(absent) = absent {
                key = _mm256_or_si256(key, load(&absent.0)[half]);
            }
            second[half] = _mm256_min_epu32(second[half], _mm256_max_epu32(first[half], key));
            first[half] = _mm256_min_epu32(first[half], key);
        }
        store(&mut best[q].first, first);
        store(&mut best[q].second, second);
    }
}

/// Lowers the limit to the second smallest distance over all lanes and finds the lanes within it.
#[inline]
#[target_feature(enable = "avx2")]
fn finish(best: &mut RunBest) {
    let (first, second) = (load(&best.first.0), load(&best.second.0));
    let mut a = _mm256_min_epu32(first[0], first[1]);
    let mut b = _mm256_min_epu32(
        _mm256_min_epu32(second[0], second[1]),
        _mm256_max_epu32(first[0], first[1]),
    );
    // Two smallest of two lanes at a time: 8, 4, 2 lanes.
    for step in 0..3 {
        let swap = |v| match step {
            0 => _mm256_permute2x128_si256::<1>(v, v),
            1 => _mm256_shuffle_epi32::<0b01_00_11_10>(v),
            _ => _mm256_shuffle_epi32::<0b10_11_00_01>(v),
        };
        let other = swap(a);
        b = _mm256_min_epu32(_mm256_min_epu32(b, swap(b)), _mm256_max_epu32(a, other));
        a = _mm256_min_epu32(a, other);
    }
    let smallest = _mm256_cvtsi256_si32(b).cast_unsigned();
    best.limit = best.limit.min(smallest | BLOCK_MASK);
    best.first_within = within(first, best.limit);
    best.second_within = within(second, best.limit);
}

/// Finds the rows of all blocks within the limits of Q queries.
#[inline]
#[target_feature(enable = "avx2")]
fn near_group<const Q: usize>(
    run: &[RowBlock],
    queries: [&PreparedQuery; Q],
    limits: &[u32; Q],
    near: &mut [NearRows; Q],
) {
    for (number, block) in run.iter().enumerate() {
        let sums = dots(block, queries);
        let bias = load(&block.bias);
        for q in 0..Q {
            let mut distances = bias;
            for half in 0..2 {
                let twice = _mm256_slli_epi32::<1>(sums[q][half]);
                distances[half] = _mm256_sub_epi32(bias[half], twice);
            }
            near[q].lanes[number] = within(distances, limits[q]);
            store(&mut near[q].distances[number], distances);
        }
    }
}

/// h + s.r of every query and the rows of a block.
#[inline]
#[target_feature(enable = "avx2")]
fn dots<const Q: usize>(block: &RowBlock, queries: [&PreparedQuery; Q]) -> [Pair; Q] {
    let mut sums = [[_mm256_setzero_si256(); 2]; Q];
    for q in 0..Q {
        sums[q] = [_mm256_set1_epi32(queries[q].start); 2];
    }
    let low_bytes = _mm256_set1_epi16(0x00ff);
    for g in 0..GROUPS {
        let rows = load(&block.groups[g]);
        for part in 0..2 {
            let mut split = rows;
            for half in 0..2 {
                split[half] = match part {
                    0 => _mm256_and_si256(rows[half], low_bytes),
                    _ => _mm256_srli_epi16::<8>(rows[half]),
                };
            }
            for q in 0..Q {
                let query = match part {
                    0 => queries[q].even[g],
                    _ => queries[q].odd[g],
                };
                let query = _mm256_set1_epi32(query);
                for half in 0..2 {
                    let products = _mm256_madd_epi16(split[half], query);
                    sums[q][half] = _mm256_add_epi32(sums[q][half], products);
                }
            }
        }
    }
    sums
}

/// The lanes of at most `limit`, as bits.
#[inline]
#[target_feature(enable = "avx2")]
fn within(pair: Pair, limit: u32) -> u16 {
    let limit = _mm256_set1_epi32(limit.cast_signed());
    let mut lanes = 0;
    for half in 0..2 {
        let fits = _mm256_cmpeq_epi32(_mm256_min_epu32(pair[half], limit), pair[half]);
        lanes |= _mm256_movemask_ps(_mm256_castsi256_ps(fits)) << (8 * half);
    }
    lanes as u16
}

#[inline]
#[target_feature(enable = "avx2")]
fn load<T>(sixteen: &[T; LANES]) -> Pair {
    const { assert!(size_of::<T>() == 4) };
    let start = std::ptr::from_ref(sixteen).cast::<__m256i>();
    // SAFETY: the reference covers 64 readable bytes, two vectors; the loads ask for no alignment.
    unsafe { [_mm256_loadu_si256(start), _mm256_loadu_si256(start.add(1))] }
}

#[inline]
#[target_feature(enable = "avx2")]
fn store(lanes: &mut Lanes, pair: Pair) {
    let start = std::ptr::from_mut(&mut lanes.0).cast::<__m256i>();
    // SAFETY: the reference covers 64 writable bytes, two vectors; the stores ask for no alignment.
    unsafe {
        _mm256_storeu_si256(start, pair[0]);
        _mm256_storeu_si256(start.add(1), pair[1]);
    }
}
