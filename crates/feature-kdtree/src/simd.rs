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

use crate::row_block::{self, LaneBest, Lanes, PreparedQuery, RowBlock};

/// Instructions the scan runs on.
///
/// Levels other than `Portable` come from [`Level::detected`] and [`Level::available`] only, hence exist only
/// where the machine has the instructions; the calls below rest on that.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Level(Kind);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512Vnni,
}

impl Level {
    /// The fastest level of this machine.
    pub(crate) fn detected() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if has_avx512_vnni() {
                return Self(Kind::Avx512Vnni);
            }
            if has_avx2() {
                return Self(Kind::Avx2);
            }
        }
        Self(Kind::Portable)
    }

    /// Every level of this machine, slowest first.
    #[cfg(test)]
    pub(crate) fn available() -> Vec<Self> {
        let mut levels = vec![Self(Kind::Portable)];
        #[cfg(target_arch = "x86_64")]
        {
            if has_avx2() {
                levels.push(Self(Kind::Avx2));
            }
            if has_avx512_vnni() {
                levels.push(Self(Kind::Avx512Vnni));
            }
        }
        levels
    }

    /// The two smallest keys of every lane over a run of at most [`row_block::RUN_BLOCKS`] blocks, for each query.
    ///
    /// `best` has one element a query; `absent` has all bits in the lanes of the last block without a row.
    #[inline]
    pub(crate) fn lane_best(
        self,
        run: &[RowBlock],
        absent: &Lanes,
        queries: &[&PreparedQuery],
        best: &mut [LaneBest],
    ) {
        debug_assert!(run.len() <= row_block::RUN_BLOCKS && queries.len() == best.len());
        match self.0 {
            Kind::Portable => row_block::lane_best(run, absent, queries, best),
            #[cfg(target_arch = "x86_64")]
            // SAFETY: a level exists only where its instructions do.
            Kind::Avx2 => unsafe { avx2::lane_best(run, absent, queries, best) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: a level exists only where its instructions do.
            Kind::Avx512Vnni => unsafe { avx512::lane_best(run, absent, queries, best) },
        }
    }

    /// Squared distances of a query to the rows of each block; `out` is as long or longer.
    ///
    /// Lanes without a row hold anything.
    #[inline]
    pub(crate) fn distances(self, run: &[RowBlock], query: &PreparedQuery, out: &mut [Lanes]) {
        let out = &mut out[..run.len()];
        match self.0 {
            Kind::Portable => {
                for (block, out) in run.iter().zip(out) {
                    *out = row_block::distances(block, query);
                }
            }
            #[cfg(target_arch = "x86_64")]
            // SAFETY: a level exists only where its instructions do.
            Kind::Avx2 => unsafe { avx2::distances(run, query, out) },
            #[cfg(target_arch = "x86_64")]
            // SAFETY: a level exists only where its instructions do.
            Kind::Avx512Vnni => unsafe { avx512::distances(run, query, out) },
        }
    }
}

#[cfg(target_arch = "x86_64")]
fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
}

#[cfg(target_arch = "x86_64")]
fn has_avx512_vnni() -> bool {
    is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vnni")
}

#[cfg(target_arch = "x86_64")]
mod avx512 {
    use std::arch::x86_64::*;

    use crate::row_block::{BLOCK_BITS, GROUPS, LANES, LaneBest, Lanes, PreparedQuery, RowBlock};

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

    /// s.r of every query and block.
    #[inline]
    #[target_feature(enable = "avx512f,avx512vnni")]
    fn dots<const Q: usize, const R: usize>(
        blocks: &[RowBlock; R],
        queries: [&PreparedQuery; Q],
    ) -> [[__m512i; R]; Q] {
        let mut sums = [[_mm512_setzero_si512(); R]; Q];
        for g in 0..GROUPS {
            let mut rows = [_mm512_setzero_si512(); R];
            for r in 0..R {
                rows[r] = load(&blocks[r].groups[g]);
            }
            for q in 0..Q {
                let query = _mm512_set1_epi32(queries[q].bytes[g]);
                for r in 0..R {
                    sums[q][r] = _mm512_dpbusd_epi32(sums[q][r], rows[r], query);
                }
            }
        }
        sums
    }

    /// Joins R blocks to the best of Q queries; `out` takes rows out.
    #[inline]
    #[target_feature(enable = "avx512f,avx512vnni")]
    fn join<const Q: usize, const R: usize>(
        blocks: &[RowBlock; R],
        number: usize,
        out: __m512i,
        queries: [&PreparedQuery; Q],
        best: &mut [LaneBest; Q],
    ) {
        let sums = dots(blocks, queries);
        let mut base = [_mm512_setzero_si512(); R];
        for r in 0..R {
            base[r] = _mm512_add_epi32(
                _mm512_slli_epi32::<BLOCK_BITS>(load(&blocks[r].bias)),
                _mm512_set1_epi32((number + r) as i32),
            );
        }
        for q in 0..Q {
            let norm = _mm512_set1_epi32((queries[q].norm_squared << BLOCK_BITS).cast_signed());
            let mut first = load(&best[q].first.0);
            let mut second = load(&best[q].second.0);
            for r in 0..R {
                let twice = _mm512_slli_epi32::<{ BLOCK_BITS + 1 }>(sums[q][r]);
                let key = _mm512_sub_epi32(_mm512_add_epi32(base[r], norm), twice);
                let key = _mm512_or_si512(key, out);
                second = _mm512_min_epu32(second, _mm512_max_epu32(first, key));
                first = _mm512_min_epu32(first, key);
            }
            store(&mut best[q].first, first);
            store(&mut best[q].second, second);
        }
    }

    #[inline]
    #[target_feature(enable = "avx512f,avx512vnni")]
    fn group<const Q: usize, const R: usize>(
        run: &[RowBlock],
        absent: &Lanes,
        queries: [&PreparedQuery; Q],
        best: &mut [LaneBest; Q],
    ) {
        let Some(full) = run.len().checked_sub(1) else {
            return;
        };
        let none = _mm512_setzero_si512();
        let (wide, rest) = run[..full].as_chunks::<R>();
        for (i, blocks) in wide.iter().enumerate() {
            join(blocks, i * R, none, queries, best);
        }
        for (i, block) in rest.iter().enumerate() {
            join(
                std::array::from_ref(block),
                wide.len() * R + i,
                none,
                queries,
                best,
            );
        }
        join(
            std::array::from_ref(&run[full]),
            full,
            load(&absent.0),
            queries,
            best,
        );
    }

    #[target_feature(enable = "avx512f,avx512vnni")]
    pub(super) fn lane_best(
        run: &[RowBlock],
        absent: &Lanes,
        queries: &[&PreparedQuery],
        best: &mut [LaneBest],
    ) {
        let (six, queries) = queries.as_chunks::<6>();
        let (best_six, best) = best.as_chunks_mut::<6>();
        for (queries, best) in six.iter().zip(best_six) {
            group::<6, 4>(run, absent, *queries, best);
        }
        let (two, queries) = queries.as_chunks::<2>();
        let (best_two, best) = best.as_chunks_mut::<2>();
        for (queries, best) in two.iter().zip(best_two) {
            group::<2, 4>(run, absent, *queries, best);
        }
        for (query, best) in queries.iter().zip(best) {
            group::<1, 8>(run, absent, [query], std::array::from_mut(best));
        }
    }

    #[target_feature(enable = "avx512f,avx512vnni")]
    pub(super) fn distances(run: &[RowBlock], query: &PreparedQuery, out: &mut [Lanes]) {
        let (wide, rest) = run.as_chunks::<4>();
        let (out_wide, out_rest) = out.as_chunks_mut::<4>();
        for (blocks, out) in wide.iter().zip(out_wide) {
            write_distances(blocks, query, out);
        }
        for (block, out) in rest.iter().zip(out_rest) {
            write_distances(
                std::array::from_ref(block),
                query,
                std::array::from_mut(out),
            );
        }
    }

    #[inline]
    #[target_feature(enable = "avx512f,avx512vnni")]
    fn write_distances<const R: usize>(
        blocks: &[RowBlock; R],
        query: &PreparedQuery,
        out: &mut [Lanes; R],
    ) {
        let [sums] = dots(blocks, [query]);
        let norm = _mm512_set1_epi32(query.norm_squared.cast_signed());
        for r in 0..R {
            let base = _mm512_add_epi32(load(&blocks[r].bias), norm);
            store(
                &mut out[r],
                _mm512_sub_epi32(base, _mm512_slli_epi32::<1>(sums[r])),
            );
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::*;

    use crate::row_block::{BLOCK_BITS, GROUPS, LANES, LaneBest, Lanes, PreparedQuery, RowBlock};

    /// A block is two vectors of eight lanes.
    type Pair = [__m256i; 2];

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

    /// s.r of every query.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn dots<const Q: usize>(block: &RowBlock, queries: [&PreparedQuery; Q]) -> [Pair; Q] {
        let mut sums = [[_mm256_setzero_si256(); 2]; Q];
        let low_bytes = _mm256_set1_epi16(0x00ff);
        for g in 0..GROUPS {
            let rows = load(&block.groups[g]);
            let even = rows.map(|row| _mm256_and_si256(row, low_bytes));
            let odd = rows.map(|row| _mm256_srli_epi16::<8>(row));
            for (part, rows) in [even, odd].into_iter().enumerate() {
                for q in 0..Q {
                    let query = _mm256_set1_epi32(queries[q].pairs[g][part]);
                    for half in 0..2 {
                        let products = _mm256_madd_epi16(rows[half], query);
                        sums[q][half] = _mm256_add_epi32(sums[q][half], products);
                    }
                }
            }
        }
        sums
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn join<const Q: usize>(
        block: &RowBlock,
        number: usize,
        out: Pair,
        queries: [&PreparedQuery; Q],
        best: &mut [LaneBest; Q],
    ) {
        let sums = dots(block, queries);
        let number = _mm256_set1_epi32(number as i32);
        let bias = load(&block.bias);
        for q in 0..Q {
            let norm = _mm256_set1_epi32((queries[q].norm_squared << BLOCK_BITS).cast_signed());
            let norm = _mm256_add_epi32(norm, number);
            let mut first = load(&best[q].first.0);
            let mut second = load(&best[q].second.0);
            for half in 0..2 {
                let base =
                    _mm256_add_epi32(_mm256_slli_epi32::<{ BLOCK_BITS as i32 }>(bias[half]), norm);
                let twice = _mm256_slli_epi32::<{ BLOCK_BITS as i32 + 1 }>(sums[q][half]);
                let key = _mm256_or_si256(_mm256_sub_epi32(base, twice), out[half]);
                second[half] = _mm256_min_epu32(second[half], _mm256_max_epu32(first[half], key));
                first[half] = _mm256_min_epu32(first[half], key);
            }
            store(&mut best[q].first, first);
            store(&mut best[q].second, second);
        }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn group<const Q: usize>(
        run: &[RowBlock],
        absent: &Lanes,
        queries: [&PreparedQuery; Q],
        best: &mut [LaneBest; Q],
    ) {
        let Some((last, full)) = run.split_last() else {
            return;
        };
        let none = [_mm256_setzero_si256(); 2];
        for (number, block) in full.iter().enumerate() {
            join(block, number, none, queries, best);
        }
        join(last, full.len(), load(&absent.0), queries, best);
    }

    #[target_feature(enable = "avx2")]
    pub(super) fn lane_best(
        run: &[RowBlock],
        absent: &Lanes,
        queries: &[&PreparedQuery],
        best: &mut [LaneBest],
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
    pub(super) fn distances(run: &[RowBlock], query: &PreparedQuery, out: &mut [Lanes]) {
        let norm = _mm256_set1_epi32(query.norm_squared.cast_signed());
        for (block, out) in run.iter().zip(out) {
            let [sums] = dots(block, [query]);
            let bias = load(&block.bias);
            let mut distances = bias;
            for half in 0..2 {
                let base = _mm256_add_epi32(bias[half], norm);
                distances[half] = _mm256_sub_epi32(base, _mm256_slli_epi32::<1>(sums[half]));
            }
            store(out, distances);
        }
    }
}
