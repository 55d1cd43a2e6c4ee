//! The samples of a window, side by side, so that vectors are full whatever the shape of the window.
//!
//! The rows of a window are short, and their last vector is mostly empty. Each row therefore appends the samples it has, and
//! the costly part of the work (arctangents, histograms) is done on full vectors. It is done one kind of work after the
//! other, because the processor overlaps the waits of several vectors only while few instructions lie between them.

use crate::simd::{LANES, Lanes, load, store};

/// The number of samples that fit.
const ROOM: usize = 512;

/// Up to [`ROOM`] samples of `N` values each.
pub(crate) struct Samples<const N: usize> {
    count: usize,
    values: [[f32; ROOM + LANES]; N],
}

impl<const N: usize> Samples<N> {
    /// No samples.
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self {
            count: 0,
            values: [[0.0; ROOM + LANES]; N],
        }
    }

    /// Drops all samples.
    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.count = 0;
    }

    /// Whether `more` further samples may not fit.
    #[inline(always)]
    pub(crate) fn is_fuller_than_room_for(&self, more: usize) -> bool {
        self.count > ROOM - more
    }

    /// Appends the first `count` samples of the vectors; the lanes after them are overwritten by the next.
    #[inline(always)]
    pub(crate) fn push<L: Lanes>(&mut self, vectors: [L; N], count: usize) {
        let at = self.count;
        for (vector, values) in vectors.into_iter().zip(&mut self.values) {
            store(vector, values, at);
        }
        self.count = at + count;
    }

    /// Completes the last vector with zeros.
    #[inline(always)]
    pub(crate) fn fill_up<L: Lanes>(&mut self) {
        let at = self.count;
        self.push([L::splat(0.0); N], 0);
        self.count = at.next_multiple_of(LANES);
    }

    /// The positions at which full vectors begin.
    #[inline(always)]
    pub(crate) fn full_vectors(&self) -> impl Iterator<Item = usize> + use<N> {
        (0..self.count / LANES).map(|vector| vector * LANES)
    }

    /// Value `k` of the samples of the vector at `at`.
    #[inline(always)]
    pub(crate) fn vector<L: Lanes>(&self, k: usize, at: usize) -> L {
        load(&self.values[k], at)
    }

    /// Replaces value `k` of the samples of the vector at `at`.
    #[inline(always)]
    pub(crate) fn set_vector<L: Lanes>(&mut self, k: usize, at: usize, vector: L) {
        store(vector, &mut self.values[k], at);
    }

    /// Drops the samples of the full vectors and keeps the rest.
    #[inline(always)]
    pub(crate) fn drop_full_vectors(&mut self) {
        let full = self.count - self.count % LANES;
        for values in &mut self.values {
            values.copy_within(full..full + LANES, 0);
        }
        self.count -= full;
    }
}
