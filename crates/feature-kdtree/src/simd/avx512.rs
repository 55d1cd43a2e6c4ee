//! The kernels for AVX-512 with VNNI: `vpdpbusd` multiplies and adds 64 pairs of bytes in one instruction.
//!
//! The scan takes six queries and four blocks at a time, 24 sums in registers, so that each row that is loaded serves six
//! queries; smaller groups take what is left.

use std::arch::x86_64::*;

use crate::row_block::{
    BLOCK_BITS, BLOCK_MASK, GROUPS, LANES, Lanes, NearRows, PreparedQuery, RowBlock, RunBest,
};

/// See [`super::run_best`].
#[target_feature(enable = "avx512f,avx512vnni")]
pub(super) fn run_best(
    run: &[RowBlock],
    absent: &Lanes,
    queries: &[&PreparedQuery],
    best: &mut [RunBest],
) {
    let (six, queries) = queries.as_chunks::<6>();
    let (best_six, best) = best.as_chunks_mut::<6>();
    for (queries, best) in six.iter().zip(best_six) {
        group::<6, 4, 1>(run, absent, *queries, best);
    }
    let (two, queries) = queries.as_chunks::<2>();
    let (best_two, best) = best.as_chunks_mut::<2>();
    for (queries, best) in two.iter().zip(best_two) {
        group::<2, 4, 2>(run, absent, *queries, best);
    }
    for (query, best) in queries.iter().zip(best) {
        group::<1, 8, 4>(run, absent, [query], std::array::from_mut(best));
    }
}

/// See [`super::distances`].
#[target_feature(enable = "avx512f,avx512vnni")]
pub(super) fn distances(
    run: &[RowBlock],
    query: &PreparedQuery,
    limit: u32,
    out: &mut [(u16, Lanes)],
) {
    let limit = _mm512_set1_epi32(limit.cast_signed());
    let (wide, rest) = run.as_chunks::<4>();
    let (out_wide, out_rest) = out.as_chunks_mut::<4>();
    for (blocks, out) in wide.iter().zip(out_wide) {
        write_distances::<4, 1>(blocks, query, limit, out);
    }
    for (block, out) in rest.iter().zip(out_rest) {
        let out = std::array::from_mut(out);
        write_distances::<1, 4>(std::array::from_ref(block), query, limit, out);
    }
}

/// See [`super::near`].
#[target_feature(enable = "avx512f,avx512vnni")]
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
        near_group::<4, 4, 1>(run, *queries, limits, near);
    }
    let (two, queries) = queries.as_chunks::<2>();
    let (limits_two, limits) = limits.as_chunks::<2>();
    let (near_two, near) = near.as_chunks_mut::<2>();
    for ((queries, limits), near) in two.iter().zip(limits_two).zip(near_two) {
        near_group::<2, 4, 2>(run, *queries, limits, near);
    }
    for ((query, &limit), near) in queries.iter().zip(limits).zip(near) {
        near_group::<1, 8, 4>(run, [*query], &[limit], std::array::from_mut(near));
    }
}

/// Takes Q queries and a run of blocks, R of these at a time, then finds the lanes within the limit.
#[inline]
#[target_feature(enable = "avx512f,avx512vnni")]
fn group<const Q: usize, const R: usize, const C: usize>(
    run: &[RowBlock],
    absent: &Lanes,
    queries: [&PreparedQuery; Q],
    best: &mut [RunBest; Q],
) {
    let Some(full) = run.len().checked_sub(1) else {
        return;
    };
    let (wide, rest) = run[..full].as_chunks::<R>();
    for (i, blocks) in wide.iter().enumerate() {
        join::<Q, R, 1>(blocks, i * R, None, queries, best);
    }
    for (i, block) in rest.iter().enumerate() {
        let (block, number) = (std::array::from_ref(block), wide.len() * R + i);
        join::<Q, 1, C>(block, number, None, queries, best);
    }
    let last = std::array::from_ref(&run[full]);
    join::<Q, 1, C>(last, full, Some(absent), queries, best);
    for best in best {
        finish(best);
    }
}

/// Joins the rows of R blocks to the best keys of Q queries, except in the lanes that `absent` names.
#[inline]
#[target_feature(enable = "avx512f,avx512vnni")]
fn join<const Q: usize, const R: usize, const C: usize>(
    blocks: &[RowBlock; R],
    number: usize,
    absent: Option<&Lanes>,
    queries: [&PreparedQuery; Q],
    best: &mut [RunBest; Q],
) {
    let sums = dots::<Q, R, C>(blocks, queries);
    let mut base = [_mm512_setzero_si512(); R];
    for r in 0..R {
        base[r] = _mm512_add_epi32(
            _mm512_slli_epi32::<BLOCK_BITS>(load(&blocks[r].bias)),
            _mm512_set1_epi32((number + r) as i32),
        );
    }
    for q in 0..Q {
        let mut first = load(&best[q].first.0);
        let mut second = load(&best[q].second.0);
        for r in 0..R {
            let twice = _mm512_slli_epi32::<{ BLOCK_BITS + 1 }>(sums[q][r]);
            let mut key = _mm512_sub_epi32(base[r], twice);
            if let Some(absent) = absent {
                key = _mm512_or_si512(key, load(&absent.0));
            }
            second = _mm512_min_epu32(second, _mm512_max_epu32(first, key));
            first = _mm512_min_epu32(first, key);
        }
        store(&mut best[q].first, first);
        store(&mut best[q].second, second);
    }
}

/// Lowers the limit to the second smallest distance over all lanes and finds the lanes within it.
#[inline]
#[target_feature(enable = "avx512f")]
fn finish(best: &mut RunBest) {
    let (first, second) = (load(&best.first.0), load(&best.second.0));
    let (mut a, mut b) = (first, second);
    // Two smallest of two lanes at a time: 16, 8, 4, 2 lanes.
    for step in 0..4 {
        let swap = |v| match step {
            0 => _mm512_shuffle_i64x2::<0b01_00_11_10>(v, v),
            1 => _mm512_shuffle_i64x2::<0b10_11_00_01>(v, v),
            2 => _mm512_shuffle_epi32::<0b01_00_11_10>(v),
            _ => _mm512_shuffle_epi32::<0b10_11_00_01>(v),
        };
        let other = swap(a);
        b = _mm512_min_epu32(_mm512_min_epu32(b, swap(b)), _mm512_max_epu32(a, other));
        a = _mm512_min_epu32(a, other);
    }
    let smallest = _mm512_cvtsi512_si32(b).cast_unsigned();
    best.limit = best.limit.min(smallest | BLOCK_MASK);
    let limit = _mm512_set1_epi32(best.limit.cast_signed());
    best.first_within = _mm512_cmple_epu32_mask(first, limit);
    best.second_within = _mm512_cmple_epu32_mask(second, limit);
}

/// Writes the distances of R blocks and the lanes within the limit.
#[inline]
#[target_feature(enable = "avx512f,avx512vnni")]
fn write_distances<const R: usize, const C: usize>(
    blocks: &[RowBlock; R],
    query: &PreparedQuery,
    limit: __m512i,
    out: &mut [(u16, Lanes); R],
) {
    let [sums] = dots::<1, R, C>(blocks, [query]);
    for r in 0..R {
        let twice = _mm512_slli_epi32::<1>(sums[r]);
        let distances = _mm512_sub_epi32(load(&blocks[r].bias), twice);
        out[r].0 = _mm512_cmple_epu32_mask(distances, limit);
        store(&mut out[r].1, distances);
    }
}

/// Takes Q queries and all blocks, R of these at a time; the rest in C chains.
#[inline]
#[target_feature(enable = "avx512f,avx512vnni")]
fn near_group<const Q: usize, const R: usize, const C: usize>(
    run: &[RowBlock],
    queries: [&PreparedQuery; Q],
    limits: &[u32; Q],
    near: &mut [NearRows; Q],
) {
    let (wide, rest) = run.as_chunks::<R>();
    for (i, blocks) in wide.iter().enumerate() {
        near_join::<Q, R, 1>(blocks, i * R, queries, limits, near);
    }
    let start = wide.len() * R;
    let (two, rest) = rest.as_chunks::<2>();
    for (i, blocks) in two.iter().enumerate() {
        near_join::<Q, 2, C>(blocks, start + 2 * i, queries, limits, near);
    }
    if let [block] = rest {
        let last = run.len() - 1;
        near_join::<Q, 1, C>(std::array::from_ref(block), last, queries, limits, near);
    }
}

/// Finds the rows of R blocks within the limits of Q queries.
#[inline]
#[target_feature(enable = "avx512f,avx512vnni")]
fn near_join<const Q: usize, const R: usize, const C: usize>(
    blocks: &[RowBlock; R],
    start: usize,
    queries: [&PreparedQuery; Q],
    limits: &[u32; Q],
    near: &mut [NearRows; Q],
) {
    let sums = dots::<Q, R, C>(blocks, queries);
    for q in 0..Q {
        let limit = _mm512_set1_epi32(limits[q].cast_signed());
        for r in 0..R {
            let twice = _mm512_slli_epi32::<1>(sums[q][r]);
            let distances = _mm512_sub_epi32(load(&blocks[r].bias), twice);
            let lanes = _mm512_cmple_epu32_mask(distances, limit);
            near[q].lanes[start + r] = lanes;
            if lanes != 0 {
                store(&mut near[q].distances[start + r], distances);
            }
        }
    }
}

/// h + s.r of every query and block.
///
/// Each sum grows in C chains of additions, which are joined at the end. Few sums need several chains, because an
/// addition to one that is not finished yet would have to wait.
#[inline]
#[target_feature(enable = "avx512f,avx512vnni")]
fn dots<const Q: usize, const R: usize, const C: usize>(
    blocks: &[RowBlock; R],
    queries: [&PreparedQuery; Q],
) -> [[__m512i; R]; Q] {
    let mut chains = [[[_mm512_setzero_si512(); C]; R]; Q];
    for q in 0..Q {
        for r in 0..R {
            chains[q][r][0] = _mm512_set1_epi32(queries[q].start);
        }
    }
    for g in (0..GROUPS).step_by(C) {
        for c in 0..C {
            let mut rows = [_mm512_setzero_si512(); R];
            for r in 0..R {
                rows[r] = load(&blocks[r].groups[g + c]);
            }
            for q in 0..Q {
                let query = _mm512_set1_epi32(queries[q].bytes[g + c]);
                for r in 0..R {
                    chains[q][r][c] = _mm512_dpbusd_epi32(chains[q][r][c], rows[r], query);
                }
            }
        }
    }
    let mut sums = [[_mm512_setzero_si512(); R]; Q];
    for q in 0..Q {
        for r in 0..R {
            sums[q][r] = chains[q][r][0];
            for c in 1..C {
                sums[q][r] = _mm512_add_epi32(sums[q][r], chains[q][r][c]);
            }
        }
    }
    sums
}

#[inline]
#[target_feature(enable = "avx512f")]
fn load<T>(sixteen: &[T; LANES]) -> __m512i {
    const { assert!(size_of::<T>() == 4) };
    // SAFETY: the reference covers 64 readable bytes; the load asks for no alignment.
    unsafe { _mm512_loadu_si512(std::ptr::from_ref(sixteen).cast()) }
}

#[inline]
#[target_feature(enable = "avx512f")]
fn store(lanes: &mut Lanes, vector: __m512i) {
    // SAFETY: the reference covers 64 writable bytes; the store asks for no alignment.
    unsafe { _mm512_storeu_si512(std::ptr::from_mut(&mut lanes.0).cast(), vector) }
}
