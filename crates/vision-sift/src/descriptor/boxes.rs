//! The histogram of a descriptor, kept as boxes between the centres of cells and bins.
//!
//! A sample shares its weight among the 8 cells and bins around it, the corners of one of 5 x 5 x 8 boxes. Each box keeps
//! its 8 sums side by side, so that a sample is one addition of eight lanes; at the end the corners are added up. Two
//! histograms take turns, because neighbouring samples often fall into one box and would wait for one another.

use std::f32::consts::TAU;

use crate::constants::{Arctangent, DESCRIPTOR_BINS, DESCRIPTOR_CELLS, DESCRIPTOR_LENGTH};
use crate::gradient::{atan2, length};
use crate::samples::Samples;
use crate::simd::{LANES, Lanes};

/// Boxes on a side: one between each two neighbouring cell centres, one before the first and one after the last.
pub(super) const BOXES: usize = DESCRIPTOR_CELLS + 1;

/// Places for boxes: a power of two above their number, so that no index needs a check.
pub(super) const BOX_SLOTS: usize = 256;

/// The sums at the corners of each box; a corner has the number `4 row + 2 column + bin`.
pub(super) type Boxes = [[f32; 8]; BOX_SLOTS];

/// Added to a non-negative integer below `2^23`, leaves it in the low bits of the sum.
const INDEX_ROUNDER: f32 = 8_388_608.0;

/// The samples of a window that wait for a full vector: weighted gradient (once a vector is full, its orientation in bins
/// and its length) and place in cells from the corner of the square.
pub(super) struct WindowSamples(pub(super) Samples<4>);

impl WindowSamples {
    /// Adds all full vectors to the boxes and keeps the samples left over. `angle` is the orientation of the keypoint.
    #[inline(always)]
    pub(super) fn share_out<L: Lanes>(
        &mut self,
        angle: f32,
        arctangent: &Arctangent,
        boxes: &mut [Boxes; 2],
    ) {
        for at in self.0.full_vectors() {
            self.turn_polar::<L>(at, angle, arctangent);
        }
        for at in self.0.full_vectors() {
            self.share_out_vector::<L>(at, boxes);
        }
        self.0.drop_full_vectors();
    }

    /// Replaces the vector of gradients at `at` by their orientation in bins, in `[0, 8)`, and their length.
    #[inline(always)]
    fn turn_polar<L: Lanes>(&mut self, at: usize, angle: f32, arctangent: &Arctangent) {
        const BINS_PER_RADIAN: f32 = DESCRIPTOR_BINS as f32 / TAU;
        let (gx, gy) = (self.0.vector::<L>(0, at), self.0.vector::<L>(1, at));
        // In (-4, 12) bins; one turn more keeps it positive.
        let turned = L::splat(angle * BINS_PER_RADIAN + DESCRIPTOR_BINS as f32)
            .sub(atan2(gy, gx, arctangent).mul(L::splat(BINS_PER_RADIAN)));
        let turns = turned.mul(L::splat(1.0 / DESCRIPTOR_BINS as f32)).floor();
        let bin = turned.sub(turns.mul(L::splat(DESCRIPTOR_BINS as f32)));
        self.0.set_vector(0, at, bin);
        self.0.set_vector(1, at, length(gx, gy));
    }

    /// Adds the vector of samples at `at` to the boxes.
    #[inline(always)]
    fn share_out_vector<L: Lanes>(&self, at: usize, boxes: &mut [Boxes; 2]) {
        // Rounding at the edge of the square must not leave the boxes.
        const MAX_PLACE: f32 = BOXES as f32 * (1.0 - f32::EPSILON);
        let (bin, weight) = (self.0.vector::<L>(0, at), self.0.vector::<L>(1, at));
        let (zero, max) = (L::splat(0.0), L::splat(MAX_PLACE));
        let column = self.0.vector::<L>(2, at).max(zero).min(max);
        let row = self.0.vector::<L>(3, at).max(zero).min(max);
        let (row_floor, column_floor, bin_floor) = (row.floor(), column.floor(), bin.floor());
        let mut index = [0.0; LANES];
        row_floor
            .mul(L::splat(BOXES as f32))
            .add(column_floor)
            .mul(L::splat(DESCRIPTOR_BINS as f32))
            .add(bin_floor)
            .add(L::splat(INDEX_ROUNDER))
            .store(&mut index);

        let (row_part, column_part) = (row.sub(row_floor), column.sub(column_floor));
        let bin_part = bin.sub(bin_floor);
        let (r0, r1) = split(weight, row_part);
        let ((c0, c1), (c2, c3)) = (split(r0, column_part), split(r1, column_part));
        let ((b0, b1), (b2, b3)) = (split(c0, bin_part), split(c1, bin_part));
        let ((b4, b5), (b6, b7)) = (split(c2, bin_part), split(c3, bin_part));
        let mut shares = [[0.0; 8]; LANES];
        L::transpose([b0, b1, b2, b3, b4, b5, b6, b7], &mut shares);
        for (i, (share, index)) in shares.iter().zip(&index).enumerate() {
            let corners = &mut boxes[i % 2][index.to_bits() as usize % BOX_SLOTS];
            for (corner, share) in corners.iter_mut().zip(share) {
                *corner += share;
            }
        }
    }
}

/// The shares `1 - part` and `part` of a weight.
#[inline(always)]
fn split<L: Lanes>(weight: L, part: L) -> (L, L) {
    let upper = weight.mul(part);
    (weight.sub(upper), upper)
}

/// The values of the cells: each is the sum of the corners of the boxes around it. Corners outside the 4 x 4 cells are
/// left out.
#[inline(always)]
pub(super) fn cells_of(boxes: &[Boxes; 2]) -> [f32; DESCRIPTOR_LENGTH] {
    let mut values = [0.0; DESCRIPTOR_LENGTH];
    for (i, cell) in values
        .as_chunks_mut::<DESCRIPTOR_BINS>()
        .0
        .iter_mut()
        .enumerate()
    {
        let (row, column) = (i / DESCRIPTOR_CELLS, i % DESCRIPTOR_CELLS);
        // The cell is the far corner of the box before it and the near corner of the box after it.
        for (corner, (down, right)) in [(3, (0, 0)), (2, (0, 1)), (1, (1, 0)), (0, (1, 1))] {
            let first = ((row + down) * BOXES + column + right) * DESCRIPTOR_BINS;
            for histogram in boxes {
                let bins: &[[f32; 8]; DESCRIPTOR_BINS] =
                    histogram[first..].first_chunk().expect("5 x 5 x 8 boxes");
                for bin in 0..DESCRIPTOR_BINS {
                    let before = (bin + DESCRIPTOR_BINS - 1) % DESCRIPTOR_BINS;
                    cell[bin] += bins[bin][2 * corner] + bins[before][2 * corner + 1];
                }
            }
        }
    }
    values
}
