//! Samples of a window side by side, so that vectors are full whatever the window's shape.
//!
//! Rows of a window are short: their last vector is mostly empty. Each row appends the samples it has; the costly part of
//! the work (arctangents, histograms) is then done on full vectors, one kind of work after the other: the processor
//! overlaps the waits of several vectors only while the instructions between them are few.

use crate::simd::{LANES, Lanes, load, store};

/// Room for samples.
const ROOM: usize = 512;

/// Up to [`ROOM`] samples of `N` values each.
pub(crate) struct Samples<const N: usize> {
    count: usize,
    values: [[f32; ROOM + LANES]; N],
}

impl<const N: usize> Samples<N> {
    /// None.
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self {
            count: 0,
            values: [[0.0; ROOM + LANES]; N],
        }
    }

    /// Forgets all samples.
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

    /// Fills the last vector up with zeros.
    #[inline(always)]
    pub(crate) fn fill_up<L: Lanes>(&mut self) {
        let at = self.count;
        self.push([L::splat(0.0); N], 0);
        self.count = at.next_multiple_of(LANES);
    }

    /// Where the full vectors begin.
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
