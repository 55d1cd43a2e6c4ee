//! The instruction levels of the scan and their kernels.
//!
//! The level is found once at run time; every level gives the same bits as the portable kernel of
//! [`crate::row_block`]. On aarch64 the portable kernel is what runs: NEON is part of the baseline there, and the
//! compiler uses it.
//!
//! Kernels work on register blocks, several queries by several row blocks, so that each row loaded serves all
//! queries of the group. AVX-512: 6 queries by 4 blocks, 24 accumulators, one `vpdpbusd` for 64 products.
//! AVX2: 4 queries by 1 block, 8 accumulators; the bytes of a row vector are split into even and odd ones,
//! each a vector of 16-bit pairs for `vpmaddwd`.

mod near;

pub(crate) use near::{NEAR_BLOCKS, NEAR_QUERIES, NearRows, prefetch};

use crate::row_block::{self, Lanes, PreparedQuery, RowBlock, RunBest};

/// Instructions the scan runs on.
///
/// The answers are the same on every level, bit for bit. A value comes from [`SimdLevel::detected`] or
/// [`SimdLevel::available`] only, hence exists only where the machine has the instructions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SimdLevel(Kind);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512Vnni,
}

impl SimdLevel {
    /// The fastest level of this machine.
    #[must_use]
    pub fn detected() -> Self {
        let fastest = Kind::ALL.iter().rfind(|kind| kind.is_available());
        Self(*fastest.unwrap_or(&Kind::Portable))
    }

    /// Every level of this machine, slowest first.
    #[must_use]
    pub fn available() -> Vec<Self> {
        let available = Kind::ALL.iter().filter(|kind| kind.is_available());
        available.map(|kind| Self(*kind)).collect()
    }

    /// `portable`, `avx2` or `avx512-vnni`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self.0 {
            Kind::Portable => "portable",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512Vnni => "avx512-vnni",
        }
    }

    /// The two smallest keys of every lane over a run of at most [`row_block::RUN_BLOCKS`] blocks, for each query,
    /// and which of them are within the limit.
    ///
    /// `best` has one element a query; `absent` has all bits in the lanes of the last block without a row.
    #[inline]
    pub(crate) fn run_best(
        self,
        run: &[RowBlock],
        absent: &Lanes,
        queries: &[&PreparedQuery],
        best: &mut [RunBest],
    ) {
        debug_assert!(run.len() <= row_block::RUN_BLOCKS && queries.len() == best.len());
        match self.0 {
            Kind::Portable => row_block::run_best(run, absent, queries, best),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: a level exists only where its instructions do.
            Kind::Avx2 => unsafe { avx2::run_best(run, absent, queries, best) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: a level exists only where its instructions do.
            Kind::Avx512Vnni => unsafe { avx512::run_best(run, absent, queries, best) },
        }
    }

    /// d + p of a query and the rows of each block, with the lanes of at most `limit` as bits.
    ///
    /// Lanes without a row hold anything; `out` is as long as the run or longer.
    #[inline]
    pub(crate) fn distances(
        self,
        run: &[RowBlock],
        query: &PreparedQuery,
        limit: u32,
        out: &mut [(u16, Lanes)],
    ) {
        let out = &mut out[..run.len()];
        match self.0 {
            Kind::Portable => row_block::run_distances(run, query, limit, out),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: a level exists only where its instructions do.
            Kind::Avx2 => unsafe { avx2::distances(run, query, limit, out) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: a level exists only where its instructions do.
            Kind::Avx512Vnni => unsafe { avx512::distances(run, query, limit, out) },
        }
    }
}

impl Kind {
    /// Slowest first.
    const ALL: &'static [Self] = &[
        Self::Portable,
        #[cfg(target_arch = "x86_64")]
        Self::Avx2,
        #[cfg(target_arch = "x86_64")]
        Self::Avx512Vnni,
    ];

    fn is_available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512Vnni => {
                is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vnni")
            }
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod avx512 {
    use std::arch::x86_64::*;

    use crate::row_block::{
        BLOCK_BITS, BLOCK_MASK, GROUPS, LANES, Lanes, PreparedQuery, RowBlock, RunBest,
    };

    #[inline]
    #[target_feature(enable = "avx512f")]
    pub(super) fn load<T>(sixteen: &[T; LANES]) -> __m512i {
        const { assert!(size_of::<T>() == 4) };
        // SAFETY: the reference covers 64 readable bytes; the load asks for no alignment.
        unsafe { _mm512_loadu_si512(std::ptr::from_ref(sixteen).cast()) }
    }

    #[inline]
    #[target_feature(enable = "avx512f")]
    pub(super) fn store(lanes: &mut Lanes, vector: __m512i) {
        // SAFETY: the reference covers 64 writable bytes; the store asks for no alignment.
        unsafe { _mm512_storeu_si512(std::ptr::from_mut(&mut lanes.0).cast(), vector) }
    }

    /// h + s.r of every query and block, in C chains of additions: few short sums would wait for themselves.
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

    /// Joins R blocks to the best of Q queries; `absent` takes lanes out.
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

    /// Lowers the limit to the second smallest distance and finds the lanes within it.
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
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::*;

    use crate::row_block::{
        BLOCK_BITS, BLOCK_MASK, GROUPS, LANES, Lanes, PreparedQuery, RowBlock, RunBest,
    };

    /// A block is two vectors of eight lanes.
    type Pair = [__m256i; 2];

    #[inline]
    #[target_feature(enable = "avx2")]
    pub(super) fn load<T>(sixteen: &[T; LANES]) -> Pair {
        const { assert!(size_of::<T>() == 4) };
        let start = std::ptr::from_ref(sixteen).cast::<__m256i>();
        // SAFETY: the reference covers 64 readable bytes, two vectors; the loads ask for no alignment.
        unsafe { [_mm256_loadu_si256(start), _mm256_loadu_si256(start.add(1))] }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    pub(super) fn store(lanes: &mut Lanes, pair: Pair) {
        let start = std::ptr::from_mut(&mut lanes.0).cast::<__m256i>();
        // SAFETY: the reference covers 64 writable bytes, two vectors; the stores ask for no alignment.
        unsafe {
            _mm256_storeu_si256(start, pair[0]);
            _mm256_storeu_si256(start.add(1), pair[1]);
        }
    }

    /// h + s.r of every query.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(super) fn dots<const Q: usize>(
        block: &RowBlock,
        queries: [&PreparedQuery; Q],
    ) -> [Pair; Q] {
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

    /// Joins a block to the best of Q queries; `absent` takes lanes out.
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

    /// Lowers the limit to the second smallest distance and finds the lanes within it.
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

    /// Lanes of at most `limit`, as bits.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(super) fn within(pair: Pair, limit: u32) -> u16 {
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
}
