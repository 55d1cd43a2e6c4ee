//! Sixteen descriptors side by side, and the values that pass between them, a query and the kernels of the scan.
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
//! The dot products start from h = -(|q|^2 + p) / 2 instead of zero, p the parity of |q|^2, which makes b - 2 (h + s.r)
//! = d + p without a further addition.
//!
//! The two smallest distances are kept lane by lane without a branch: a *key* packs d + p (23 bits) over the number
//! of the block in its run (9 bits), and each lane keeps its two smallest keys. All of it is integer arithmetic:
//! every level of instructions gives the same bits.

use crate::descriptor::{DESCRIPTOR_LENGTH, Descriptor, MAX_DISTANCE_SQUARED};

/// Rows in a block: the 32-bit lanes of a 512-bit register.
pub(crate) const LANES: usize = 16;
/// Groups of four components in a descriptor.
pub(crate) const GROUPS: usize = DESCRIPTOR_LENGTH / 4;
/// Bits of a key that number the block; 23 are left for the distance, at most [`MAX_DISTANCE_SQUARED`] and the parity.
pub(crate) const BLOCK_BITS: u32 = 9;
/// The bits that number the block.
pub(crate) const BLOCK_MASK: u32 = (1 << BLOCK_BITS) - 1;
/// The number of blocks that a key can tell apart.
pub(crate) const RUN_BLOCKS: usize = 1 << BLOCK_BITS;

/// One value for each row of a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(C, align(64))]
pub(crate) struct Lanes(pub(crate) [u32; LANES]);

impl Lanes {
    /// Values larger than any key of a row.
    pub(crate) const LAST: Self = Self([u32::MAX; LANES]);

    /// All bits set in the lanes from `used` on; an `or` with the keys makes those of absent rows the last.
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
    /// Components 4g to 4g + 3 of each row, for group g.
    pub(crate) groups: [[[u8; 4]; LANES]; GROUPS],
    /// |r|^2 - 256 sum(r) of each row.
    pub(crate) bias: [i32; LANES],
}

impl RowBlock {
    /// Sixteen rows of zeros.
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

/// A query in the forms that the kernels take.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct PreparedQuery {
    /// q - 128, four signed bytes a group.
    pub(crate) bytes: [i32; GROUPS],
    /// q - 128, components 0 and 2 of a group, sixteen bits each.
    pub(crate) even: [i32; GROUPS],
    /// q - 128, components 1 and 3 of a group, sixteen bits each.
    pub(crate) odd: [i32; GROUPS],
    /// h, where the dot products start.
    pub(crate) start: i32,
    /// p, 0 or 1.
    parity: u32,
}

impl PreparedQuery {
    /// Prepares a query. O(128).
    pub(crate) fn new(query: &Descriptor) -> Self {
        let mut prepared = Self {
            bytes: [0; GROUPS],
            even: [0; GROUPS],
            odd: [0; GROUPS],
            start: 0,
            parity: 0,
        };
        let (groups, _) = query.as_chunks::<4>();
        // Both halves of a word less 128, without a borrow from one to the other: arithmetic on whole words, which
        // every compiler vectorises.
        let less_128 = |halves: u32| ((halves | 0x8000_8000) - 0x0080_0080) ^ 0x8000_8000;
        for (g, group) in groups.iter().enumerate() {
            let word = u32::from_le_bytes(*group);
            prepared.bytes[g] = (word ^ 0x8080_8080).cast_signed();
            prepared.even[g] = less_128(word & 0x00ff_00ff).cast_signed();
            prepared.odd[g] = less_128(word >> 8 & 0x00ff_00ff).cast_signed();
        }
        let mut norm_squared = 0_i32;
        for &byte in query {
            norm_squared += i32::from(byte) * i32::from(byte);
        }
        prepared.parity = (norm_squared & 1).cast_unsigned();
        prepared.start = -((norm_squared + 1) >> 1);
        prepared
    }

    /// The squared distance packed in the key of a row.
    #[inline]
    pub(crate) fn distance_of(&self, key: u32) -> u32 {
        self.distance_of_raw(key >> BLOCK_BITS)
    }

    /// The squared distance d, from d + p.
    #[inline]
    pub(crate) fn distance_of_raw(&self, raw: u32) -> u32 {
        raw.wrapping_sub(self.parity)
    }

    /// The value d + p that the kernels compare, for a squared distance d; at most that of the farthest possible row.
    #[inline]
    pub(crate) fn raw(&self, distance_squared: u32) -> u32 {
        distance_squared.min(MAX_DISTANCE_SQUARED) + self.parity
    }

    /// The largest key that a row at this squared distance can have.
    #[inline]
    pub(crate) fn last_key_at(&self, distance_squared: u32) -> u32 {
        self.raw(distance_squared) << BLOCK_BITS | BLOCK_MASK
    }
}

/// The best keys of every lane over a run of blocks, for one query.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct RunBest {
    /// Smallest key of each lane.
    pub(crate) first: Lanes,
    /// Second smallest key of each lane.
    pub(crate) second: Lanes,
    /// The largest key worth reporting; a kernel lowers it to the largest key at the second smallest distance.
    pub(crate) limit: u32,
    /// Lanes whose smallest key is within the limit, as bits.
    pub(crate) first_within: u16,
    /// Lanes whose second smallest key is within the limit, as bits.
    pub(crate) second_within: u16,
}

impl RunBest {
    /// The state before the first block.
    #[inline]
    pub(crate) fn new(limit: u32) -> Self {
        Self {
            first: Lanes::LAST,
            second: Lanes::LAST,
            limit,
            first_within: 0,
            second_within: 0,
        }
    }
}

/// Blocks that the kernel for short lists takes in one call at most.
pub(crate) const NEAR_BLOCKS: usize = 8;

/// Rows of a few blocks within the limit of one query.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct NearRows {
    /// d + p of each row, written for blocks with a row within the limit only.
    pub(crate) distances: [Lanes; NEAR_BLOCKS],
    /// Lanes of each block within the limit, as bits.
    pub(crate) lanes: [u16; NEAR_BLOCKS],
}

impl NearRows {
    /// No row within the limit.
    pub(crate) const NONE: Self = Self {
        distances: [Lanes::LAST; NEAR_BLOCKS],
        lanes: [0; NEAR_BLOCKS],
    };
}

/// The number of the block packed in a key.
#[inline]
pub(crate) fn key_block(key: u32) -> usize {
    (key & BLOCK_MASK) as usize
}
