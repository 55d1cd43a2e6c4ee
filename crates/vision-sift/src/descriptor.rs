//! The descriptor of an oriented keypoint (Lowe, section 6).
//!
//! A square of 4 x 4 cells, each `3 sigma` wide, turned to the keypoint's orientation, covers the keypoint. For a sample
//! at offset `(u, v)` from the refined position, in the turned frame and in cells,
//! ```text
//! u = ( dx cos a + dy sin a) / 3 sigma,     v = (-dx sin a + dy cos a) / 3 sigma,     o = (a - theta) 8 / 2 pi,
//! weight = m exp(-(u^2 + v^2) / (2 * 2^2)),
//! ```
//! and the weight is shared linearly among the 2 x 2 cells and 2 orientation bins around `(u, v, o)`, so that no sample
//! jumps from bin to bin (section 6.1). Samples with `|u|` or `|v|` of 2.5 cells and more contribute nothing and are not
//! visited: each row of the window is cut to the interval inside the turned square.
//!
//! The 128 values are scaled to unit length, cut at 0.2, scaled again (or, as [`Normalisation`] says, scaled to unit sum
//! and their roots taken, which is of unit length too), multiplied by 512 and rounded to bytes with saturation at 255. The order of the values, `(row * 4 + column) * 8 + orientation` with the orientation counted
//! against the sense of the angle, is that of OpenCV, so descriptors of both may be compared.
//!
//! Each row of the window is cut to the interval inside the turned square; the samples left are packed side by side, so
//! that vectors are full whatever the shape. A sample touches the 8 corners of one of 5 x 5 x 8 boxes between cell and
//! bin centres; each box keeps its 8 corner sums together, so a sample is one addition of eight lanes, and the corners
//! are added up at the end. Two such histograms take turns, because neighbouring samples often touch the same box.
//!
//! Degenerate: a window without gradients gives zeros. Near the border the part outside the image is left out.
//! Cost: `(15 sigma)^2` gradients, about 600 to 2500.

use std::f32::consts::TAU;

use simd_level::SimdLevel;

use crate::constants::{
    Arctangent, DESCRIPTOR_BINS, DESCRIPTOR_BYTE_SCALE, DESCRIPTOR_CELL_SIGMAS, DESCRIPTOR_CELLS,
    DESCRIPTOR_CLIP, DESCRIPTOR_LENGTH, DESCRIPTOR_WINDOW_SIGMA_CELLS,
};
use crate::gradient::{WindowTable, atan2, falloff, length, prefetch_window};
use crate::image::Plane;
use crate::params::Normalisation;
use crate::samples::Samples;
use crate::simd::{self, Body, LANES, Lanes};

/// Half the side of the square a sample must lie in to touch a cell, cells.
const REACH_CELLS: f32 = (DESCRIPTOR_CELLS + 1) as f32 / 2.0;

/// Boxes a side: one between each two neighbouring cell centres and one beyond the first and the last.
const BOXES: usize = DESCRIPTOR_CELLS + 1;

/// A power of two above the number of boxes, so that no index needs a check.
const BOX_SLOTS: usize = 256;

/// The sums at the corners of each box, corner `4 row + 2 column + bin`.
type Boxes = [[f32; 8]; BOX_SLOTS];

/// Longest row of a window, see [`crate::gradient`].
const MAX_ROW: usize = 272;

/// Below this a side of the square counts as level: over [`MAX_ROW`] samples it moves by less than a hundred-thousandth
/// of a cell.
const MIN_SLOPE: f32 = 1e-9;

/// Adding `2^23` leaves a non-negative integer in the low bits.
const INDEX_ROUNDER: f32 = 8_388_608.0;

/// The frame of a keypoint in the pixels of its plane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    pub(crate) x: f32,
    pub(crate) y: f32,
    pub(crate) sigma: f32,
    /// Radians in `[0, 2 pi)`.
    pub(crate) angle: f32,
}

/// Descriptor of the keypoint at `frame` from the Gaussian level nearest in scale.
pub(crate) fn describe(
    level: SimdLevel,
    plane: &Plane,
    frame: Frame,
    style: &Style,
    scratch: &mut Scratch,
) -> [u8; DESCRIPTOR_LENGTH] {
    simd::run(
        level,
        Describe {
            plane,
            frame,
            style,
            scratch,
        },
    )
}

/// Memory of [`describe`], kept between calls because clearing it takes time.
pub(crate) struct Scratch {
    columns: WindowTable,
    samples: WindowSamples,
    boxes: [Boxes; 2],
}

impl Scratch {
    pub(crate) fn new() -> Self {
        Self {
            columns: WindowTable::new(),
            samples: WindowSamples(Samples::new()),
            boxes: [[[0.0; 8]; BOX_SLOTS]; 2],
        }
    }
}

/// Asks for the samples [`describe`] will read.
pub(crate) fn prefetch(plane: &Plane, frame: Frame) {
    let (sin, cos) = frame.angle.sin_cos();
    let reach = REACH_CELLS * DESCRIPTOR_CELL_SIGMAS * frame.sigma * (sin.abs() + cos.abs());
    prefetch_window(plane, frame.x, frame.y, reach);
}

/// What all descriptors of a detector have in common.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Style {
    pub(crate) normalisation: Normalisation,
    pub(crate) arctangent: Arctangent,
}

struct Describe<'a> {
    plane: &'a Plane,
    frame: Frame,
    style: &'a Style,
    scratch: &'a mut Scratch,
}

impl Body for Describe<'_> {
    type Output = [u8; DESCRIPTOR_LENGTH];

    #[inline(always)]
    fn run<L: Lanes>(self) -> [u8; DESCRIPTOR_LENGTH] {
        let Self {
            plane,
            frame,
            style,
            scratch:
                Scratch {
                    columns,
                    samples,
                    boxes,
                },
        } = self;
        let cells_per_pixel = 1.0 / (DESCRIPTOR_CELL_SIGMAS * frame.sigma);
        let (sin, cos) = frame.angle.sin_cos();
        // Half the height and width of the turned square.
        let reach = REACH_CELLS * (sin.abs() + cos.abs()) / cells_per_pixel;
        let (sin, cos) = (sin * cells_per_pixel, cos * cells_per_pixel);
        let window_sigma = DESCRIPTOR_WINDOW_SIGMA_CELLS / cells_per_pixel;
        let scale = -0.5 / (window_sigma * window_sigma);
        let (left, right) = inside(frame.x, reach, plane.width());
        let (top, bottom) = inside(frame.y, reach, plane.height());
        columns.set::<L>(frame.x, left, right, scale);
        samples.0.clear();
        for histogram in &mut *boxes {
            histogram[..BOXES * BOXES * DESCRIPTOR_BINS].fill([0.0; 8]);
        }
        let sides = [Side::new(cos, sin), Side::new(-sin, cos)];
        for row in top..=bottom {
            let dy = row as f32 - frame.y;
            let Some((left, right)) = interval(&sides, frame.x, dy, left, right) else {
                continue;
            };
            let row_factor = falloff(L::splat(dy * dy * scale));
            let (u0, v0) = (
                L::splat(dy * sin + REACH_CELLS),
                L::splat(dy * cos + REACH_CELLS),
            );
            for start in (left..=right).step_by(LANES) {
                let dx = columns.offsets::<L>(start);
                let (gx, gy) = columns.gradients::<L>(plane, start, row, row_factor);
                let u = u0.add(dx.mul(L::splat(cos)));
                let v = v0.sub(dx.mul(L::splat(sin)));
                samples.0.push([gx, gy, u, v], LANES.min(right + 1 - start));
            }
            if samples.0.is_fuller_than_room_for(MAX_ROW) {
                samples.share_out::<L>(frame.angle, &style.arctangent, boxes);
            }
        }
        // Samples of no weight.
        samples.0.fill_up::<L>();
        samples.share_out::<L>(frame.angle, &style.arctangent, boxes);
        quantised(&cells_of(boxes), style.normalisation)
    }
}

/// First and last sample within `reach` of `centre` that have neighbours on both sides.
fn inside(centre: f32, reach: f32, length: usize) -> (usize, usize) {
    let first = ((centre - reach).ceil().max(1.0) as usize).min(length - 2);
    let last = ((centre + reach).floor().max(1.0) as usize).min(length - 2);
    (first, last.min(first + MAX_ROW - 1))
}

/// One coordinate of the turned square along a row, `slope dx + rise dy`, in cells.
#[derive(Debug, Clone, Copy)]
struct Side {
    rise: f32,
    /// Zero where the coordinate hardly changes along a row.
    pixels_per_cell: f32,
}

impl Side {
    #[inline(always)]
    fn new(slope: f32, rise: f32) -> Self {
        let level = slope.abs() < MIN_SLOPE;
        let pixels_per_cell = if level { 0.0 } else { 1.0 / slope };
        Self {
            rise,
            pixels_per_cell,
        }
    }
}

/// First and last column of `left..=right` inside the turned square on the row at `dy`, if any.
#[inline(always)]
fn interval(
    sides: &[Side; 2],
    x: f32,
    dy: f32,
    left: usize,
    right: usize,
) -> Option<(usize, usize)> {
    let (mut low, mut high) = (left as f32 - x, right as f32 - x);
    for side in sides {
        // |slope dx + base| < REACH
        let base = side.rise * dy;
        if side.pixels_per_cell != 0.0 {
            let a = (-REACH_CELLS - base) * side.pixels_per_cell;
            let b = (REACH_CELLS - base) * side.pixels_per_cell;
            low = low.max(a.min(b));
            high = high.min(a.max(b));
        } else if base.abs() >= REACH_CELLS {
            return None;
        }
    }
    let (first, last) = (
        (x + low).ceil().max(left as f32),
        (x + high).floor().min(right as f32),
    );
    (first <= last).then_some((first as usize, last as usize))
}

/// Weighted gradient of a sample, then its orientation in bins and length, and its place in cells from the corner of the
/// square.
struct WindowSamples(Samples<4>);

impl WindowSamples {
    /// Shares out all full vectors and keeps the rest.
    #[inline(always)]
    fn share_out<L: Lanes>(&mut self, angle: f32, arctangent: &Arctangent, boxes: &mut [Boxes; 2]) {
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

/// Adds up the corners that are one cell and bin; those outside the 4 x 4 cells are left out.
#[inline(always)]
fn cells_of(boxes: &[Boxes; 2]) -> [f32; DESCRIPTOR_LENGTH] {
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

/// Clips, normalises, rounds to bytes.
#[inline(always)]
fn quantised(
    values: &[f32; DESCRIPTOR_LENGTH],
    normalisation: Normalisation,
) -> [u8; DESCRIPTOR_LENGTH] {
    let clip = DESCRIPTOR_CLIP * squared_length(values).sqrt();
    let mut clipped = *values;
    for v in &mut clipped {
        *v = if *v < clip { *v } else { clip };
    }
    if normalisation == Normalisation::Root {
        // The sum of the values is the squared length of their roots.
        for v in &mut clipped {
            *v = v.sqrt();
        }
    }
    let length = squared_length(&clipped).sqrt();
    if length == 0.0 {
        return [0; DESCRIPTOR_LENGTH];
    }
    let scale = DESCRIPTOR_BYTE_SCALE / length;
    // Casts from float to integer saturate and cut; the values are not negative.
    let mut bytes = [0; DESCRIPTOR_LENGTH];
    for (byte, v) in bytes.iter_mut().zip(&clipped) {
        *byte = (v * scale + 0.5) as u8;
    }
    bytes
}

/// Sum of squares over eight interleaved lanes.
#[inline(always)]
fn squared_length(values: &[f32; DESCRIPTOR_LENGTH]) -> f32 {
    let mut lanes = [0.0; 8];
    for chunk in values.chunks_exact(8) {
        for (lane, v) in lanes.iter_mut().zip(chunk) {
            *lane += v * v;
        }
    }
    lanes.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants::ARCTANGENT;

    fn texture(width: usize, height: usize) -> Plane {
        let mut plane = Plane::default();
        plane.resize(width, height);
        for y in 0..height {
            for x in 0..width {
                let (u, v) = (x as f32, y as f32);
                plane.row_mut(y)[x] =
                    0.5 + 0.2 * (0.31 * u + 0.17 * v).sin() + 0.2 * (0.11 * u * v * 0.05).cos();
            }
        }
        plane
    }

    /// The sum of the module comment, sample by sample over the whole image, in `f64` with library functions.
    fn direct(plane: &Plane, frame: Frame, root: bool) -> Vec<f64> {
        let mut values = vec![0.0; DESCRIPTOR_LENGTH];
        let (sin, cos) = f64::from(frame.angle).sin_cos();
        let cell = 3.0 * f64::from(frame.sigma);
        for y in 1..plane.height() - 1 {
            for x in 1..plane.width() - 1 {
                let (dx, dy) = (x as f64 - f64::from(frame.x), y as f64 - f64::from(frame.y));
                let (u, v) = ((dx * cos + dy * sin) / cell, (dy * cos - dx * sin) / cell);
                if u.abs() >= 2.5 || v.abs() >= 2.5 {
                    continue;
                }
                let gx = f64::from(plane.at(x + 1, y) - plane.at(x - 1, y));
                let gy = f64::from(plane.at(x, y + 1) - plane.at(x, y - 1));
                let o = (f64::from(frame.angle) - gy.atan2(gx)) * 8.0 / std::f64::consts::TAU;
                let weight = gx.hypot(gy) * (-(u * u + v * v) / 8.0).exp();
                for row in 0..4 {
                    for column in 0..4 {
                        for bin in 0..8 {
                            let r = (1.0 - (v + 1.5 - f64::from(row)).abs()).max(0.0);
                            let c = (1.0 - (u + 1.5 - f64::from(column)).abs()).max(0.0);
                            let turn = (o - f64::from(bin)).rem_euclid(8.0);
                            let b = (1.0 - turn.min(8.0 - turn)).max(0.0);
                            values[((row * 4 + column) * 8 + bin) as usize] += weight * r * c * b;
                        }
                    }
                }
            }
        }
        let length = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let clip = 0.2 * length(&values);
        values.iter_mut().for_each(|v| *v = v.min(clip));
        if root {
            let sum: f64 = values.iter().sum();
            return values.iter().map(|v| 512.0 * (v / sum).sqrt()).collect();
        }
        let scale = 512.0 / length(&values);
        values.iter().map(|v| (v * scale).min(255.0)).collect()
    }

    /// The descriptor, the same on every level.
    fn described(
        plane: &Plane,
        frame: Frame,
        normalisation: Normalisation,
    ) -> [u8; DESCRIPTOR_LENGTH] {
        let style = Style {
            normalisation,
            arctangent: ARCTANGENT,
        };
        let mut scratch = Scratch::new();
        let got = describe(SimdLevel::Portable, plane, frame, &style, &mut scratch);
        for level in SimdLevel::available() {
            let again = describe(level, plane, frame, &style, &mut scratch);
            assert_eq!(again, got, "{level}");
        }
        got
    }

    #[test]
    fn equals_the_direct_sum() {
        let plane = texture(90, 70);
        // Inside, near corners (part of the window outside), along the axes and along the diagonals.
        for (x, y, sigma) in [
            (45.3, 34.8, 1.7),
            (6.2, 5.1, 2.4),
            (84.0, 63.5, 3.1),
            (40.0, 30.0, 3.6),
        ] {
            for angle in [0.0, 0.3, TAU / 8.0, TAU / 4.0, 2.9, TAU / 2.0, 4.4, 6.2] {
                let frame = Frame { x, y, sigma, angle };
                let got = described(&plane, frame, Normalisation::Lowe);
                for (g, e) in got.iter().zip(direct(&plane, frame, false)) {
                    // Half a unit of rounding, plus the window's 1.5e-5 and f32 sums of 2500 terms on 255.
                    assert!((f64::from(*g) - e).abs() < 0.53, "{frame:?}: {g} {e}");
                }
                let got = described(&plane, frame, Normalisation::Root);
                for (g, e) in got.iter().zip(direct(&plane, frame, true)) {
                    // The root's error is that of the value v times 1 / (2 root v): below a value of 1 of 512 the
                    // absolute error, 5e-6 of the largest bin, counts instead and its root is the bound.
                    let error = f64::from(*g) - e.min(255.0);
                    assert!(error.abs() < 0.6, "{frame:?}: {g} {e}");
                }
            }
        }
    }

    #[test]
    fn a_flat_window_is_zero() {
        let mut plane = Plane::default();
        plane.resize(40, 40);
        let frame = Frame {
            x: 20.0,
            y: 20.0,
            sigma: 2.0,
            angle: 1.0,
        };
        for normalisation in [Normalisation::Lowe, Normalisation::Root] {
            assert_eq!(
                described(&plane, frame, normalisation),
                [0; DESCRIPTOR_LENGTH]
            );
        }
    }
}
