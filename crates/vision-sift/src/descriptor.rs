//! The descriptor of an oriented keypoint (Lowe, section 6).
//!
//! A square of 4 x 4 cells, each `3 sigma` wide, turned to the keypoint's orientation, covers the keypoint. For a sample
//! at offset `(u, v)` from the refined position, in the turned frame and in cells,
//! ```text
//! u = ( dx cos a + dy sin a) / 3 sigma,     v = (-dx sin a + dy cos a) / 3 sigma,     o = (a - theta) 8 / 2 pi,
//! weight = m exp(-(u^2 + v^2) / (2 * 2^2)),
//! ```
//! and the weight is shared linearly among the 2 x 2 cells and 2 orientation bins around `(u, v, o)`, so that no sample
//! jumps from bin to bin (section 6.1). Samples with `|u|` or `|v|` of 2.5 cells and more contribute nothing.
//!
//! The 128 values are scaled to unit length, cut at 0.2 and scaled again (or, with [`Normalisation::Root`], scaled to unit
//! sum and replaced by their roots, which also gives unit length), multiplied by 512 and rounded to bytes with saturation
//! at 255. The order of the values, `(row * 4 + column) * 8 + orientation` with the orientation counted against the sense
//! of the angle, is that of OpenCV, so descriptors of both may be compared.
//!
//! Steps:
//! 1. Each row of the window is cut to the interval inside the turned square (`square`).
//! 2. The samples left are packed side by side, so that vectors are full whatever the shape of the window.
//! 3. Full vectors are added to the histogram (`boxes`).
//! 4. The histogram is normalised and quantised.
//!
//! Degenerate cases: a window without gradients gives zeros. Near the border the part outside the image is left out.
//! Cost: `(15 sigma)^2` gradients, about 600 to 2500.

mod boxes;
mod square;

use simd_level::SimdLevel;

use crate::constants::{
    Arctangent, DESCRIPTOR_BINS, DESCRIPTOR_BYTE_SCALE, DESCRIPTOR_CELL_SIGMAS, DESCRIPTOR_CLIP,
    DESCRIPTOR_LENGTH, DESCRIPTOR_WINDOW_SIGMA_CELLS, MAX_WINDOW_COLUMNS,
};
use crate::gradient::{WindowTable, falloff, prefetch_window};
use crate::image::Plane;
use crate::params::Normalisation;
use crate::samples::Samples;
use crate::simd::{self, Body, LANES, Lanes};
use boxes::{BOX_SLOTS, BOXES, Boxes, WindowSamples, cells_of};
use square::{REACH_CELLS, Side, inside, interval};

/// Position, scale and orientation of a keypoint in the pixels of its plane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    pub(crate) x: f32,
    pub(crate) y: f32,
    pub(crate) sigma: f32,
    /// Radians in `[0, 2 pi)`.
    pub(crate) angle: f32,
}

/// The descriptor of the keypoint at `frame`; `plane` is the Gaussian level nearest in scale.
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

/// The memory of [`describe`], kept between calls because clearing it takes time.
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

/// Asks for the samples that [`describe`] will read to be brought into the caches.
pub(crate) fn prefetch(plane: &Plane, frame: Frame) {
    let (sin, cos) = frame.angle.sin_cos();
    let reach = REACH_CELLS * DESCRIPTOR_CELL_SIGMAS * frame.sigma * (sin.abs() + cos.abs());
    prefetch_window(plane, frame.x, frame.y, reach);
}

/// The choices that all descriptors of a detector share.
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
            if samples.0.is_fuller_than_room_for(MAX_WINDOW_COLUMNS) {
                samples.share_out::<L>(frame.angle, &style.arctangent, boxes);
            }
        }
        // Samples of zero weight complete the last vector.
        samples.0.fill_up::<L>();
        samples.share_out::<L>(frame.angle, &style.arctangent, boxes);
        quantised(&cells_of(boxes), style.normalisation)
    }
}

/// Cuts the values at 0.2 of their length, normalises them and rounds them to bytes.
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

/// The sum of squares, added up in eight interleaved lanes.
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
    use std::f32::consts::TAU;

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
