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
//! The 128 values are scaled to unit length, cut at 0.2, scaled again, multiplied by 512 and rounded to bytes with
//! saturation at 255. The order of the values, `(row * 4 + column) * 8 + orientation` with the orientation counted
//! against the sense of the angle, is that of OpenCV, so descriptors of both may be compared.
//!
//! Degenerate: a window without gradients gives zeros. Near the border the part outside the image is left out.
//! Cost: `(15 sigma)^2` gradients, about 600 to 2500.

use std::f32::consts::TAU;

use crate::gradient::{PolarRun, RUN, polar_run};
use crate::image::Plane;
use crate::orientation::nearest;
use crate::params::{
    DESCRIPTOR_BINS, DESCRIPTOR_BYTE_SCALE, DESCRIPTOR_CELL_SIGMAS, DESCRIPTOR_CELLS,
    DESCRIPTOR_CLIP, DESCRIPTOR_LENGTH, DESCRIPTOR_WINDOW_SIGMA_CELLS,
};

/// Half the side of the square a sample must lie in to touch a cell, cells.
const REACH_CELLS: f32 = (DESCRIPTOR_CELLS + 1) as f32 / 2.0;

/// One ring of cells around the 4 x 4 takes what falls outside.
const PADDED_CELLS: usize = DESCRIPTOR_CELLS + 2;

/// One more orientation bin takes what wraps around.
const PADDED_BINS: usize = DESCRIPTOR_BINS + 1;

const ROW_STEP: usize = PADDED_CELLS * PADDED_BINS;

type Histogram = [f32; PADDED_CELLS * ROW_STEP];

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
pub(crate) fn describe(plane: &Plane, frame: Frame) -> [u8; DESCRIPTOR_LENGTH] {
    quantised(&histogram(plane, frame))
}

fn histogram(plane: &Plane, frame: Frame) -> Histogram {
    let mut bins = [0.0; PADDED_CELLS * ROW_STEP];
    let cells_per_pixel = 1.0 / (DESCRIPTOR_CELL_SIGMAS * frame.sigma);
    let (sin, cos) = frame.angle.sin_cos();
    let (sin, cos) = (sin * cells_per_pixel, cos * cells_per_pixel);
    let window_sigma = DESCRIPTOR_WINDOW_SIGMA_CELLS / cells_per_pixel;
    let falloff = -0.5 / (window_sigma * window_sigma);
    // Half the height of the turned square.
    let reach = REACH_CELLS * (frame.angle.sin().abs() + frame.angle.cos().abs()) / cells_per_pixel;
    let top = (frame.y - reach).ceil().max(1.0) as usize;
    let bottom = ((frame.y + reach).floor().max(0.0) as usize).min(plane.height() - 2);
    for row in top..=bottom {
        let dy = row as f32 - frame.y;
        let Some((left, right)) = interval(frame.x, dy, sin, cos, plane.width()) else {
            continue;
        };
        for start in (left..=right).step_by(RUN) {
            let count = RUN.min(right + 1 - start);
            let run = polar_run(plane, start, row, count);
            let dx = start as f32 - frame.x;
            add_run(
                &mut bins,
                &run,
                count,
                [dx, dy, sin, cos, falloff, frame.angle],
            );
        }
    }
    bins
}

/// First and last column of the row at `dy` inside the turned square and the image, if any.
fn interval(x: f32, dy: f32, sin: f32, cos: f32, width: usize) -> Option<(usize, usize)> {
    let (mut low, mut high) = (1.0 - x, (width - 2) as f32 - x);
    for (slope, base) in [(cos, sin * dy), (-sin, cos * dy)] {
        // |slope dx + base| < REACH
        if slope.abs() > 1e-9 {
            let (a, b) = ((-REACH_CELLS - base) / slope, (REACH_CELLS - base) / slope);
            low = low.max(a.min(b));
            high = high.min(a.max(b));
        } else if base.abs() >= REACH_CELLS {
            return None;
        }
    }
    let (first, last) = (
        (x + low).ceil().max(1.0),
        (x + high).floor().min((width - 2) as f32),
    );
    (first <= last).then_some((first as usize, last as usize))
}

/// Adds one run of gradients; `dx` of its first sample, `dy`, the turned axes in cells per pixel, the window, the angle.
#[inline(always)]
fn add_run(
    bins: &mut Histogram,
    run: &PolarRun,
    count: usize,
    [dx, dy, sin, cos, falloff, angle]: [f32; 6],
) {
    const BINS_PER_RADIAN: f32 = DESCRIPTOR_BINS as f32 / TAU;
    const MAX_CELL: f32 = (DESCRIPTOR_CELLS + 1) as f32 * (1.0 - f32::EPSILON);
    const MAX_BIN: f32 = DESCRIPTOR_BINS as f32 * (1.0 - f32::EPSILON);
    let (mut cell, mut value) = ([0_u32; RUN], [0.0; RUN]);
    let (mut row_part, mut column_part, mut bin_part) = ([0.0; RUN], [0.0; RUN], [0.0; RUN]);
    for i in 0..RUN {
        let dx = dx + i as f32;
        value[i] = run.magnitude[i] * exp_of_window(falloff * (dx * dx + dy * dy));
        // Rounding at the edge of the square must not leave the padded cells.
        let column = clamp(dx * cos + dy * sin + REACH_CELLS, MAX_CELL);
        let row = clamp(dy * cos - dx * sin + REACH_CELLS, MAX_CELL);
        let turned = (angle - run.angle[i]) * BINS_PER_RADIAN;
        let turned = if turned < 0.0 {
            turned + DESCRIPTOR_BINS as f32
        } else {
            turned
        };
        let turned = if turned >= DESCRIPTOR_BINS as f32 {
            turned - DESCRIPTOR_BINS as f32
        } else {
            turned
        };
        let bin = clamp(turned, MAX_BIN);
        let (row_floor, column_floor, bin_floor) = (floor(row), floor(column), floor(bin));
        row_part[i] = row - row_floor;
        column_part[i] = column - column_floor;
        bin_part[i] = bin - bin_floor;
        cell[i] = nearest(
            (row_floor * PADDED_CELLS as f32 + column_floor) * PADDED_BINS as f32 + bin_floor,
        );
    }
    for i in 0..count {
        let lower = value[i] * row_part[i];
        let upper = value[i] - lower;
        let (upper_right, lower_right) = (upper * column_part[i], lower * column_part[i]);
        let shares = [
            upper - upper_right,
            upper_right,
            lower - lower_right,
            lower_right,
        ];
        let cells: &mut [f32; ROW_STEP + PADDED_BINS + 2] = bins[cell[i] as usize..]
            .first_chunk_mut()
            .expect("the indices are clamped to the padded cells");
        for (share, at) in
            shares
                .into_iter()
                .zip([0, PADDED_BINS, ROW_STEP, ROW_STEP + PADDED_BINS])
        {
            let next = share * bin_part[i];
            cells[at] += share - next;
            cells[at + 1] += next;
        }
    }
}

/// Into `[0, high]`. Written as comparisons, which are single vector instructions.
#[inline(always)]
fn clamp(value: f32, high: f32) -> f32 {
    let value = if value > 0.0 { value } else { 0.0 };
    if value < high { value } else { high }
}

/// The integer below a value in `[0, 2^22)`. At an integer it may give the integer before, the part then being 1: both
/// share a weight in the same way.
#[inline(always)]
fn floor(value: f32) -> f32 {
    const ROUNDER: f32 = 12_582_912.0;
    let below = (value - 0.5 + ROUNDER) - ROUNDER;
    if below > 0.0 { below } else { 0.0 }
}

/// `exp(t)` for `t` in `[-1.5625, 0]`, the exponents of the window (`2.5^2 + 2.5^2 = 12.5` cells give `-12.5 / 8 = -1.5625`):
/// `exp(t / 4)^4` by the Taylor polynomial of degree 5, relative error below 3e-5.
#[inline(always)]
fn exp_of_window(t: f32) -> f32 {
    let t = 0.25 * t;
    let e =
        1.0 + t * (1.0 + t * (1.0 / 2.0 + t * (1.0 / 6.0 + t * (1.0 / 24.0 + t * (1.0 / 120.0)))));
    let e = e * e;
    e * e
}

/// Folds the padding away, normalises, clips, normalises again, rounds to bytes.
fn quantised(bins: &Histogram) -> [u8; DESCRIPTOR_LENGTH] {
    let mut values = [0.0; DESCRIPTOR_LENGTH];
    for (i, cell) in values.chunks_exact_mut(DESCRIPTOR_BINS).enumerate() {
        let (row, column) = (i / DESCRIPTOR_CELLS + 1, i % DESCRIPTOR_CELLS + 1);
        let from = row * ROW_STEP + column * PADDED_BINS;
        cell.copy_from_slice(&bins[from..from + DESCRIPTOR_BINS]);
        cell[0] += bins[from + DESCRIPTOR_BINS];
    }
    let clip = DESCRIPTOR_CLIP * squared_length(&values).sqrt();
    for v in &mut values {
        *v = v.min(clip);
    }
    let length = squared_length(&values).sqrt();
    if length == 0.0 {
        return [0; DESCRIPTOR_LENGTH];
    }
    let scale = DESCRIPTOR_BYTE_SCALE / length;
    // Casts from float to integer saturate.
    values.map(|v| (v * scale).round() as u8)
}

/// Sum of squares over eight interleaved lanes.
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
    fn direct(plane: &Plane, frame: Frame) -> Vec<f64> {
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
        let scale = 512.0 / length(&values);
        values.iter().map(|v| (v * scale).min(255.0)).collect()
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
                let got = describe(&plane, frame);
                for (g, e) in got.iter().zip(direct(&plane, frame)) {
                    // Half a unit of rounding, plus the window's 3e-5 and f32 sums of 2500 terms on 255.
                    assert!((f64::from(*g) - e).abs() < 0.53, "{frame:?}: {g} {e}");
                }
            }
        }
    }

    #[test]
    fn window_exponential_keeps_its_bound() {
        for i in 0..=1000 {
            let t = -1.5625 * f64::from(i) / 1000.0;
            let error = f64::from(exp_of_window(t as f32)) / t.exp() - 1.0;
            assert!(error.abs() < 3e-5, "{t}: {error}");
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
        assert_eq!(describe(&plane, frame), [0; DESCRIPTOR_LENGTH]);
    }
}
