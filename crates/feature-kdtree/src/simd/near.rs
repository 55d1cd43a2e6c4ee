//! The kernel for short lists: rows of a few blocks within the limit of each query.
//!
//! Without the two best of every lane to keep, it compares each distance with the limit of its query and reports
//! lanes as bits; distances are written only where a bit is set. Few blocks or queries leave few sums, which then
//! are split into several chains of additions: a single one would wait for its own result at every step.

use crate::row_block::{Lanes, PreparedQuery, RowBlock, distances, within};

use super::{Kind, SimdLevel};

/// Blocks in a call at most.
pub(crate) const NEAR_BLOCKS: usize = 8;
/// Queries in a call that keep the kernel busy.
pub(crate) const NEAR_QUERIES: usize = 8;

/// Rows of a few blocks within the limit of one query.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct NearRows {
    /// d + p, of blocks with a row within the limit only.
    pub(crate) distances: [Lanes; NEAR_BLOCKS],
    /// Lanes of each block within the limit, as bits.
    pub(crate) lanes: [u16; NEAR_BLOCKS],
}

impl NearRows {
    pub(crate) const NONE: Self = Self {
        distances: [Lanes::LAST; NEAR_BLOCKS],
        lanes: [0; NEAR_BLOCKS],
    };
}

/// Asks for the rows to be brought into the caches; changes nothing else.
#[inline]
pub(crate) fn prefetch(blocks: &[RowBlock]) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T1, _mm_prefetch};
        let start = blocks.as_ptr().cast::<i8>();
        for line in 0..size_of_val(blocks) / 64 {
            // SAFETY: the address lies in the slice; a prefetch reads nothing the program can see.
            unsafe { _mm_prefetch::<_MM_HINT_T1>(start.add(64 * line)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = blocks;
}

impl SimdLevel {
    /// Which rows of at most [`NEAR_BLOCKS`] blocks lie within the limit of each query, limits being d + p.
    ///
    /// `limits` and `near` have one element a query. Lanes without a row are reported or not.
    #[inline]
    pub(crate) fn near(
        self,
        run: &[RowBlock],
        queries: &[&PreparedQuery],
        limits: &[u32],
        near: &mut [NearRows],
    ) {
        debug_assert!(run.len() <= NEAR_BLOCKS && queries.len() == near.len());
        match self.0 {
            Kind::Portable => portable(run, queries, limits, near),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: a level exists only where its instructions do.
            Kind::Avx2 => unsafe { avx2::near(run, queries, limits, near) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: a level exists only where its instructions do.
            Kind::Avx512Vnni => unsafe { avx512::near(run, queries, limits, near) },
        }
    }
}

fn portable(run: &[RowBlock], queries: &[&PreparedQuery], limits: &[u32], near: &mut [NearRows]) {
    for ((query, &limit), near) in queries.iter().zip(limits).zip(near) {
        for (number, block) in run.iter().enumerate() {
            let distances = distances(block, query);
            near.lanes[number] = within(&distances, limit);
            near.distances[number] = distances;
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod avx512 {
    use std::arch::x86_64::*;

    use super::super::avx512::{load, store};
    use super::NearRows;
    use crate::row_block::{GROUPS, PreparedQuery, RowBlock};

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
            group::<4, 4, 1>(run, queries, limits, near);
        }
        let (two, queries) = queries.as_chunks::<2>();
        let (limits_two, limits) = limits.as_chunks::<2>();
        let (near_two, near) = near.as_chunks_mut::<2>();
        for ((queries, limits), near) in two.iter().zip(limits_two).zip(near_two) {
            group::<2, 4, 2>(run, queries, limits, near);
        }
        for ((query, &limit), near) in queries.iter().zip(limits).zip(near) {
            group::<1, 8, 4>(run, &[*query], &[limit], std::array::from_mut(near));
        }
    }

    /// Q queries against all blocks, R at a time; the rest in C chains.
    #[inline]
    #[target_feature(enable = "avx512f,avx512vnni")]
    fn group<const Q: usize, const R: usize, const C: usize>(
        run: &[RowBlock],
        queries: &[&PreparedQuery; Q],
        limits: &[u32; Q],
        near: &mut [NearRows; Q],
    ) {
        let (wide, rest) = run.as_chunks::<R>();
        for (i, blocks) in wide.iter().enumerate() {
            join::<Q, R, 1>(blocks, i * R, queries, limits, near);
        }
        let start = wide.len() * R;
        let (two, rest) = rest.as_chunks::<2>();
        for (i, blocks) in two.iter().enumerate() {
            join::<Q, 2, C>(blocks, start + 2 * i, queries, limits, near);
        }
        if let [block] = rest {
            let last = run.len() - 1;
            join::<Q, 1, C>(std::array::from_ref(block), last, queries, limits, near);
        }
    }

    #[inline]
    #[target_feature(enable = "avx512f,avx512vnni")]
    fn join<const Q: usize, const R: usize, const C: usize>(
        blocks: &[RowBlock; R],
        start: usize,
        queries: &[&PreparedQuery; Q],
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

    /// h + s.r of Q queries and R blocks, in C chains of additions.
    #[inline]
    #[target_feature(enable = "avx512f,avx512vnni")]
    fn dots<const Q: usize, const R: usize, const C: usize>(
        blocks: &[RowBlock; R],
        queries: &[&PreparedQuery; Q],
    ) -> [[__m512i; R]; Q] {
        let mut chains = [[[_mm512_setzero_si512(); R]; Q]; C];
        for g in (0..GROUPS).step_by(C) {
            for c in 0..C {
                let mut rows = [_mm512_setzero_si512(); R];
                for r in 0..R {
                    rows[r] = load(&blocks[r].groups[g + c]);
                }
                for q in 0..Q {
                    let query = _mm512_set1_epi32(queries[q].bytes[g + c]);
                    for r in 0..R {
                        chains[c][q][r] = _mm512_dpbusd_epi32(chains[c][q][r], rows[r], query);
                    }
                }
            }
        }
        let mut sums = [[_mm512_setzero_si512(); R]; Q];
        for q in 0..Q {
            sums[q] = [_mm512_set1_epi32(queries[q].start); R];
            for r in 0..R {
                for c in 0..C {
                    sums[q][r] = _mm512_add_epi32(sums[q][r], chains[c][q][r]);
                }
            }
        }
        sums
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::*;

    use super::super::avx2::{dots, load, store, within};
    use super::NearRows;
    use crate::row_block::{PreparedQuery, RowBlock};

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
            group(run, *queries, limits, near);
        }
        for ((query, &limit), near) in queries.iter().zip(limits).zip(near) {
            group(run, [*query], &[limit], std::array::from_mut(near));
        }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn group<const Q: usize>(
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
}
