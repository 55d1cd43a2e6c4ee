//! The kernels of the scan for each level of vector instructions, and the choice among them.
//!
//! A kernel computes the distances of a group of queries to a run of row blocks and reports the rows near enough to
//! matter. Each row that is loaded serves all queries of a group. Every level gives the same bits, because all of it is
//! integer arithmetic; the tests of [`crate::row_scan`] compare the levels with one another. On aarch64 the portable kernels
//! run: NEON is part of every such processor, and the compiler uses it.
//!
//! This is the only module of the crate with `unsafe` code: the calls that enter code compiled for a level, and the loads
//! and stores of whole vectors inside.

mod any_length;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod portable;

use simd_level::SimdLevel;

use crate::row_block::{
    Lanes, NEAR_BLOCKS, NearRows, PreparedQuery, RUN_BLOCKS, RowBlock, RunBest,
};

/// Finds the two smallest keys of every lane over a run of at most [`RUN_BLOCKS`] blocks, for each query, and the lanes
/// within its limit.
///
/// `best` has one element for each query; `absent` has all bits set in the lanes of the last block without a row.
#[inline]
pub(crate) fn run_best(
    level: SimdLevel,
    run: &[RowBlock],
    absent: &Lanes,
    queries: &[&PreparedQuery],
    best: &mut [RunBest],
) {
    debug_assert!(run.len() <= RUN_BLOCKS && queries.len() == best.len());
    match level {
        SimdLevel::Portable => portable::run_best(run, absent, queries, best),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a level exists only where its instructions do.
        SimdLevel::Avx2(_) => unsafe { avx2::run_best(run, absent, queries, best) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a level exists only where its instructions do.
        SimdLevel::Avx512(_) => unsafe { avx512::run_best(run, absent, queries, best) },
    }
}

/// Writes d + p of a query and the rows of each block, with the lanes of at most `limit` as bits.
///
/// Lanes without a row hold arbitrary values; `out` is at least as long as the run.
#[inline]
pub(crate) fn distances(
    level: SimdLevel,
    run: &[RowBlock],
    query: &PreparedQuery,
    limit: u32,
    out: &mut [(u16, Lanes)],
) {
    let out = &mut out[..run.len()];
    match level {
        SimdLevel::Portable => portable::distances(run, query, limit, out),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a level exists only where its instructions do.
        SimdLevel::Avx2(_) => unsafe { avx2::distances(run, query, limit, out) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a level exists only where its instructions do.
        SimdLevel::Avx512(_) => unsafe { avx512::distances(run, query, limit, out) },
    }
}

/// Finds the rows of at most [`NEAR_BLOCKS`] blocks within the limit of each query, limits being d + p.
///
/// `limits` and `near` have one element for each query. Lanes without a row are reported or not. This is the kernel for
/// short lists: it keeps no best of every lane, compares each distance with a limit that is known, and writes distances
/// only where one is within it.
#[inline]
pub(crate) fn near(
    level: SimdLevel,
    run: &[RowBlock],
    queries: &[&PreparedQuery],
    limits: &[u32],
    near: &mut [NearRows],
) {
    debug_assert!(run.len() <= NEAR_BLOCKS && queries.len() == near.len());
    match level {
        SimdLevel::Portable => portable::near(run, queries, limits, near),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a level exists only where its instructions do.
        SimdLevel::Avx2(_) => unsafe { avx2::near(run, queries, limits, near) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a level exists only where its instructions do.
        SimdLevel::Avx512(_) => unsafe { avx512::near(run, queries, limits, near) },
    }
}

/// Appends the squared Euclidean distances of byte descriptors of any length.
pub(crate) fn squared_of_bytes<const N: usize>(
    level: SimdLevel,
    query: &[u8; N],
    rows: &[[u8; N]],
    out: &mut Vec<u32>,
) {
    match level {
        SimdLevel::Portable => any_length::squared_of_bytes(query, rows, out),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a level exists only where its instructions do.
        SimdLevel::Avx2(_) => unsafe { any_length::avx2::squared_of_bytes(query, rows, out) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a level exists only where its instructions do.
        SimdLevel::Avx512(_) => unsafe { any_length::avx512::squared_of_bytes(query, rows, out) },
    }
}

/// Appends the squared Euclidean distances of float descriptors of any length.
pub(crate) fn squared_of_floats<const N: usize>(
    level: SimdLevel,
    query: &[f32; N],
    rows: &[[f32; N]],
    out: &mut Vec<f32>,
) {
    match level {
        SimdLevel::Portable => any_length::squared_of_floats(query, rows, out),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a level exists only where its instructions do.
        SimdLevel::Avx2(_) => unsafe { any_length::avx2::squared_of_floats(query, rows, out) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a level exists only where its instructions do.
        SimdLevel::Avx512(_) => unsafe { any_length::avx512::squared_of_floats(query, rows, out) },
    }
}

/// Appends the Hamming distances of binary descriptors of any length.
pub(crate) fn differing_bits<const N: usize>(
    level: SimdLevel,
    query: &[u8; N],
    rows: &[[u8; N]],
    out: &mut Vec<u32>,
) {
    match level {
        SimdLevel::Portable => any_length::differing_bits(query, rows, out),
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a level exists only where its instructions do.
        SimdLevel::Avx2(_) => unsafe { any_length::avx2::differing_bits(query, rows, out) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: a level exists only where its instructions do.
        SimdLevel::Avx512(_) => unsafe { any_length::avx512::differing_bits(query, rows, out) },
    }
}

/// Asks for the rows to be brought into the caches; changes nothing else.
#[inline]
pub(crate) fn prefetch(blocks: &[RowBlock]) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T1, _mm_prefetch};
        let start = blocks.as_ptr().cast::<i8>();
        for line in 0..size_of_val(blocks) / 64 {
            // SAFETY: the address lies in the slice; a prefetch reads nothing that the program can see.
            unsafe { _mm_prefetch::<_MM_HINT_T1>(start.add(64 * line)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = blocks;
}
