//! Sixteen descriptors side by side, and what one query learns from them.
//!
//! The squared distance of query q and row r is |q|^2 + |r|^2 - 2 q.r. The dot product is taken with the query
//! shifted to signed bytes, s = q - 128, because the byte dot product of AVX-512 VNNI takes one signed factor:
//! q.r = s.r + 128 sum(r), so that
//!
//! d = |q|^2 + b - 2 s.r   with   b = |r|^2 - 256 sum(r), stored with the row.
//!
//! Rows are stored in blocks of sixteen, interleaved four bytes at a time: one vector holds the same four
//! components of sixteen rows, so sixteen dot products grow in the lanes of one register and no sum across
//! lanes is ever needed.
//!
//! The two smallest distances are kept lane by lane without a branch: a *key* packs the distance (23 bits) over
//! the number of the block in its run (9 bits), and each lane keeps its two smallest keys. All of it is integer
//! arithmetic: every level of instructions gives the same bits.

use crate::{DESCRIPTOR_LENGTH, Descriptor};

/// Rows in a block: 32-bit lanes of a 512-bit register.
pub(crate) const LANES: usize = 16;
/// Groups of four components.
pub(crate) const GROUPS: usize = DESCRIPTOR_LENGTH / 4;
/// Bits of a key that number the block; 23 are left for [`crate::MAX_DISTANCE_SQUARED`].
pub(crate) const BLOCK_BITS: u32 = 9;
/// Blocks a key can number.
pub(crate) const RUN_BLOCKS: usize = 1 << BLOCK_BITS;

/// One value a row of a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C, align(64))]
pub(crate) struct Lanes(pub(crate) [u32; LANES]);

impl Lanes {
    /// Larger than any key of a row.
    pub(crate) const LAST: Self = Self([u32::MAX; LANES]);

    /// All bits in the lanes from `used` on: joined to the keys it takes absent rows out.
    pub(crate) fn absent_from(used: usize) -> Self {
        Self(std::array::from_fn(
            |lane| if lane < used { 0 } else { u32::MAX },
        ))
    }
}

/// Sixteen rows, interleaved, with the constant b of each.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct RowBlock {
    /// Components 4g..4g+4 of each row.
    pub(crate) groups: [[[u8; 4]; LANES]; GROUPS],
    /// |r|^2 - 256 sum(r) of each row.
    pub(crate) bias: [i32; LANES],
}

impl RowBlock {
    pub(crate) const EMPTY: Self = Self {
        groups: [[[0; 4]; LANES]; GROUPS],
        bias: [0; LANES],
    };

    /// Writes a row.
    pub(crate) fn set(&mut self, lane: usize, descriptor: &Descriptor) {
        let (parts, _) = descriptor.as_chunks::<4>();
        for (group, part) in self.groups.iter_mut().zip(parts) {
            group[lane] = *part;
        }
        let (mut sum, mut square) = (0, 0);
        for &byte in descriptor {
            sum += i32::from(byte);
            square += i32::from(byte) * i32::from(byte);
        }
        self.bias[lane] = square - 256 * sum;
    }

    /// Reads a row back.
    pub(crate) fn get(&self, lane: usize) -> Descriptor {
        let mut descriptor = [0; DESCRIPTOR_LENGTH];
        let (parts, _) = descriptor.as_chunks_mut::<4>();
        for (part, group) in parts.iter_mut().zip(&self.groups) {
            *part = group[lane];
        }
        descriptor
    }
}

/// A query in the forms the kernels take it.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct PreparedQuery {
    /// q - 128, four signed bytes a group.
    pub(crate) bytes: [i32; GROUPS],
    /// q - 128, sixteen-bit pairs of a group: components (0, 2), then (1, 3).
    pub(crate) pairs: [[i32; 2]; GROUPS],
    /// |q|^2.
    pub(crate) norm_squared: u32,
}

impl PreparedQuery {
    pub(crate) fn new(query: &Descriptor) -> Self {
        let mut prepared = Self {
            bytes: [0; GROUPS],
            pairs: [[0; 2]; GROUPS],
            norm_squared: 0,
        };
        let (groups, _) = query.as_chunks::<4>();
        for (g, group) in groups.iter().enumerate() {
            prepared.bytes[g] = i32::from_le_bytes(group.map(|byte| byte ^ 0x80));
            let s = group.map(|byte| i32::from(byte) - 128);
            // Two's complement halves of a word, the lower component in the lower half.
            let pair = |low: i32, high: i32| (low & 0xffff) | (high << 16);
            prepared.pairs[g] = [pair(s[0], s[2]), pair(s[1], s[3])];
        }
        prepared.norm_squared = query
            .iter()
            .map(|&byte| u32::from(byte) * u32::from(byte))
            .sum();
        prepared
    }
}

/// The two smallest keys of each lane, over a run of blocks.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct LaneBest {
    pub(crate) first: Lanes,
    pub(crate) second: Lanes,
}

impl LaneBest {
    pub(crate) const NONE: Self = Self {
        first: Lanes::LAST,
        second: Lanes::LAST,
    };
}

/// Squared distance packed in a key.
#[inline]
pub(crate) fn key_distance(key: u32) -> u32 {
    key >> BLOCK_BITS
}

/// Number of the block packed in a key.
#[inline]
pub(crate) fn key_block(key: u32) -> usize {
    (key & (RUN_BLOCKS as u32 - 1)) as usize
}

/// Portable kernel: squared distances of a query to the rows of a block.
///
/// Written in lanes of sixteen bits two by two, so that the compiler finds the multiply-add instructions of SSE2
/// (`pmaddwd`) and NEON (`smlal`).
#[inline]
pub(crate) fn distances(block: &RowBlock, query: &PreparedQuery) -> Lanes {
    let mut dots = [0_i32; LANES];
    for (group, pairs) in block.groups.iter().zip(&query.pairs) {
        let halves = |word: i32| (word as i16, (word >> 16) as i16);
        let ((s0, s2), (s1, s3)) = (halves(pairs[0]), halves(pairs[1]));
        for (dot, row) in dots.iter_mut().zip(group) {
            let word = u32::from_le_bytes(*row);
            let even = word & 0x00ff_00ff;
            let odd = (word >> 8) & 0x00ff_00ff;
            let product = |low: u32, s: i16| i32::from(low as i16).wrapping_mul(i32::from(s));
            *dot = dot
                .wrapping_add(product(even, s0).wrapping_add(product(even >> 16, s2)))
                .wrapping_add(product(odd, s1).wrapping_add(product(odd >> 16, s3)));
        }
    }
    let mut distances = [0; LANES];
    for lane in 0..LANES {
        distances[lane] = query
            .norm_squared
            .wrapping_add_signed(block.bias[lane].wrapping_sub(dots[lane].wrapping_mul(2)));
    }
    Lanes(distances)
}

/// Portable kernel: the two smallest keys of every lane over a run of at most [`RUN_BLOCKS`] blocks.
///
/// `absent` has all bits in the lanes of the last block that hold no row.
#[inline]
pub(crate) fn lane_best(
    run: &[RowBlock],
    absent: &Lanes,
    queries: &[&PreparedQuery],
    best: &mut [LaneBest],
) {
    for (number, block) in (0_u32..).zip(run) {
        let last = number as usize + 1 == run.len();
        for (query, best) in queries.iter().zip(&mut *best) {
            let distances = distances(block, query);
            for lane in 0..LANES {
                let out = if last { absent.0[lane] } else { 0 };
                let key = (distances.0[lane] << BLOCK_BITS | number) | out;
                let first = best.first.0[lane];
                best.second.0[lane] = best.second.0[lane].min(first.max(key));
                best.first.0[lane] = first.min(key);
            }
        }
    }
}
