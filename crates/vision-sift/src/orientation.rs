//! Orientations of a keypoint (Lowe, section 5).
//!
//! Steps:
//! 1. The gradients of the Gaussian level nearest in scale, in a disc-like window of standard deviation `1.5 sigma`
//!    around the refined position (not the nearest sample), are added with weight `m exp(-d^2 / 2 (1.5 sigma)^2)` to a
//!    histogram of 36 bins, each shared linearly between the two bins nearest to its angle.
//! 2. The histogram is smoothed around the circle with `[1 4 6 4 1] / 16`.
//! 3. Each local maximum of at least 0.8 of the highest gives an orientation; a parabola through the bin and its two
//!    neighbours gives the angle between bins.
//!
//! Degenerate cases: a flat window, without any gradient, gives no orientation and hence no keypoint.
//! Cost: about 230 to 900 gradients.

use std::f32::consts::TAU;

use simd_level::SimdLevel;

use crate::constants::{
    Arctangent, ORIENTATION_BINS, ORIENTATION_PEAK_RATIO, ORIENTATION_SIGMA_FACTOR,
};
use crate::gradient::{WindowTable, atan2, falloff, length};
use crate::image::Plane;
use crate::samples::Samples;
use crate::simd::{self, Body, LANES, Lanes};

/// The most orientations of a point: at most every second bin can be a strict local maximum.
const MAX_PEAKS: usize = ORIENTATION_BINS / 2;

/// The longest row of a window: `base_sigma` 4 and one scale per octave give a radius of 55.
const MAX_WINDOW: usize = 128;

/// The number of partial histograms.
const PARTS: usize = 4;

/// Places of a partial histogram: a power of two above the number of bins, so that no index needs a check.
const BIN_SLOTS: usize = 64;

/// Adding this, `1.5 * 2^23`, rounds to the nearest integer, ties to even, and leaves it in the low bits.
const INDEX_ROUNDER: f32 = 12_582_912.0;

/// The window of a point, in the pixels of its plane, and the way in which its gradients are counted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OrientationWindow {
    pub(crate) x: f32,
    pub(crate) y: f32,
    /// The scale of the point.
    pub(crate) sigma: f32,
    /// Samples count up to this distance in x and in y.
    pub(crate) radius: f32,
    pub(crate) arctangent: Arctangent,
    /// Whether a gradient counts in the nearest bin only, instead of being shared between two.
    pub(crate) to_nearest_bin: bool,
}

/// The orientations of one point, in the order of the histogram bins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Orientations {
    count: usize,
    angles: [f32; MAX_PEAKS],
}

impl Default for Orientations {
    fn default() -> Self {
        Self {
            count: 0,
            angles: [0.0; MAX_PEAKS],
        }
    }
}

impl Orientations {
    /// The angles in radians, in `[0, 2 pi)`, from the x axis towards the y axis.
    pub(crate) fn angles(&self) -> &[f32] {
        &self.angles[..self.count]
    }
}

/// Finds the orientations of a point.
pub(crate) fn orientations(
    level: SimdLevel,
    plane: &Plane,
    window: OrientationWindow,
    scratch: &mut Scratch,
) -> Orientations {
    let histogram = smoothed(&simd::run(
        level,
        GradientHistogram {
            plane,
            window,
            scratch,
        },
    ));
    let highest = histogram.iter().fold(0.0_f32, |a, &b| a.max(b));
    let mut result = Orientations::default();
    if highest <= 0.0 {
        return result;
    }
    for bin in 0..ORIENTATION_BINS {
        let left = histogram[(bin + ORIENTATION_BINS - 1) % ORIENTATION_BINS];
        let right = histogram[(bin + 1) % ORIENTATION_BINS];
        let here = histogram[bin];
        if here > left && here > right && here >= ORIENTATION_PEAK_RATIO * highest {
            let position = bin as f32 + 0.5 * (left - right) / (left - 2.0 * here + right);
            let angle = position * (TAU / ORIENTATION_BINS as f32);
            // A tiny negative angle plus a turn can round to a whole turn.
            let angle = if angle < 0.0 { angle + TAU } else { angle };
            result.angles[result.count] = if angle < TAU { angle } else { 0.0 };
            result.count += 1;
        }
    }
    result
}

/// The memory of [`orientations`], kept between calls because clearing it takes time.
pub(crate) struct Scratch {
    columns: WindowTable,
    samples: Samples<2>,
}

impl Scratch {
    pub(crate) fn new() -> Self {
        Self {
            columns: WindowTable::new(),
            samples: Samples::new(),
        }
    }
}

/// The histogram before smoothing. Four partial histograms take every fourth sample each: samples beside one another mostly
/// fall into one bin, and four additions in a row to the same place would wait for one another.
struct GradientHistogram<'a> {
    plane: &'a Plane,
    window: OrientationWindow,
    scratch: &'a mut Scratch,
}

impl Body for GradientHistogram<'_> {
    type Output = [f32; ORIENTATION_BINS];

    #[inline(always)]
    fn run<L: Lanes>(self) -> [f32; ORIENTATION_BINS] {
        let OrientationWindow {
            x,
            y,
            sigma,
            radius,
            ref arctangent,
            to_nearest_bin,
        } = self.window;
        let plane = self.plane;
        let Scratch { columns, samples } = self.scratch;
        let window_sigma = ORIENTATION_SIGMA_FACTOR * sigma;
        let scale = -0.5 / (window_sigma * window_sigma);
        let (left, right) = reach(x, radius, plane.width());
        let (top, bottom) = reach(y, radius, plane.height());
        columns.set::<L>(x, left, right, scale);
        samples.clear();
        let mut bins = [[0.0; BIN_SLOTS]; PARTS];
        for row in top..=bottom {
            let dy = L::splat(row as f32 - y);
            let row_factor = falloff(dy.mul(dy).mul(L::splat(scale)));
            for start in (left..=right).step_by(LANES) {
                let (gx, gy) = columns.gradients::<L>(plane, start, row, row_factor);
                samples.push([gx, gy], LANES.min(right + 1 - start));
            }
            if samples.is_fuller_than_room_for(MAX_WINDOW) {
                add_up::<L>(samples, arctangent, to_nearest_bin, &mut bins);
            }
        }
        // Samples of zero weight complete the last vector.
        samples.fill_up::<L>();
        add_up::<L>(samples, arctangent, to_nearest_bin, &mut bins);
        std::array::from_fn(|i| {
            // The last bin shares with the one after it, and an angle just below a whole turn may round up to it.
            let sum = |k: usize| (bins[0][k] + bins[1][k]) + (bins[2][k] + bins[3][k]);
            match i {
                0 | 1 => sum(i) + sum(ORIENTATION_BINS + i),
                _ => sum(i),
            }
        })
    }
}

/// Adds the gradients of all full vectors to the histogram and keeps the samples left over.
#[inline(always)]
fn add_up<L: Lanes>(
    samples: &mut Samples<2>,
    arctangent: &Arctangent,
    to_nearest_bin: bool,
    bins: &mut [[f32; BIN_SLOTS]; PARTS],
) {
    for at in samples.full_vectors() {
        let (gx, gy) = (samples.vector::<L>(0, at), samples.vector::<L>(1, at));
        samples.set_vector(0, at, bin_position::<L>(atan2(gy, gx, arctangent)));
        samples.set_vector(1, at, length(gx, gy));
    }
    for at in samples.full_vectors() {
        let (angle, weight) = (samples.vector::<L>(0, at), samples.vector::<L>(1, at));
        if to_nearest_bin {
            add_to_nearest::<L>(angle, weight, bins);
        } else {
            share::<L>(angle, weight, bins);
        }
    }
    samples.drop_full_vectors();
}

/// Angles in `[-pi, pi]` as places in the histogram, `[0, 36]`.
#[inline(always)]
fn bin_position<L: Lanes>(angle: L) -> L {
    const BINS_PER_RADIAN: f32 = ORIENTATION_BINS as f32 / TAU;
    let position = angle.mul(L::splat(BINS_PER_RADIAN));
    let turn = L::splat(ORIENTATION_BINS as f32);
    L::select(
        L::splat(0.0).greater(position),
        position.add(turn),
        position,
    )
}

/// Shares the weights between the bins below and above.
#[inline(always)]
fn share<L: Lanes>(position: L, weight: L, bins: &mut [[f32; BIN_SLOTS]; PARTS]) {
    let below = position.floor();
    let upper = weight.mul(position.sub(below));
    let (mut index, mut low, mut high) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    below.add(L::splat(INDEX_ROUNDER)).store(&mut index);
    weight.sub(upper).store(&mut low);
    upper.store(&mut high);
    for i in 0..LANES {
        let bin = index[i].to_bits() as usize % BIN_SLOTS;
        bins[i % PARTS][bin] += low[i];
        bins[i % PARTS][(bin + 1) % BIN_SLOTS] += high[i];
    }
}

/// Adds the weights to the nearest bins.
#[inline(always)]
fn add_to_nearest<L: Lanes>(position: L, weight: L, bins: &mut [[f32; BIN_SLOTS]; PARTS]) {
    let (mut index, mut whole) = ([0.0; LANES], [0.0; LANES]);
    position.add(L::splat(INDEX_ROUNDER)).store(&mut index);
    weight.store(&mut whole);
    for i in 0..LANES {
        let bin = index[i].to_bits() as usize % BIN_SLOTS;
        bins[i % PARTS][bin] += whole[i];
    }
}

/// The first and the last sample within `radius` of `centre` that have neighbours on both sides.
fn reach(centre: f32, radius: f32, length: usize) -> (usize, usize) {
    let first = ((centre - radius).ceil().max(1.0) as usize).min(length - 2);
    let last = ((centre + radius).floor().max(1.0) as usize).min(length - 2);
    (first, last.min(first + MAX_WINDOW - 1))
}

fn smoothed(bins: &[f32; ORIENTATION_BINS]) -> [f32; ORIENTATION_BINS] {
    let at = |i: usize| bins[i % ORIENTATION_BINS];
    std::array::from_fn(|i| {
        let i = i + ORIENTATION_BINS;
        (at(i - 2) + at(i + 2)) * (1.0 / 16.0)
            + (at(i - 1) + at(i + 1)) * (4.0 / 16.0)
            + at(i) * (6.0 / 16.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constants::ARCTANGENT;

    fn ramp(angle: f32) -> Plane {
        let mut plane = Plane::default();
        plane.resize(41, 37);
        for y in 0..37 {
            for x in 0..41 {
                plane.row_mut(y)[x] = 0.01 * (angle.cos() * x as f32 + angle.sin() * y as f32);
            }
        }
        plane
    }

    /// The orientations, after a check that every level finds the same.
    fn found_in(plane: &Plane, x: f32, y: f32, sigma: f32) -> Orientations {
        let window = |to_nearest_bin| OrientationWindow {
            x,
            y,
            sigma,
            radius: 4.5 * sigma,
            arctangent: ARCTANGENT,
            to_nearest_bin,
        };
        let mut scratch = Scratch::new();
        for to_nearest_bin in [true, false] {
            let window = window(to_nearest_bin);
            let found = orientations(SimdLevel::Portable, plane, window, &mut scratch);
            for level in SimdLevel::available() {
                let again = orientations(level, plane, window, &mut scratch);
                assert_eq!(again, found, "{level}");
            }
        }
        orientations(SimdLevel::best(), plane, window(false), &mut scratch)
    }

    #[test]
    fn a_ramp_points_uphill() {
        // All gradients share two bins, the upper with part p. Smoothed, the parabola's top is at 2.5 p / (4 - 3 p) for
        // p <= 1/2, at most 0.0586 bins (0.586 degrees) from p.
        for degrees in (0..360).step_by(7) {
            let angle = (degrees as f32).to_radians();
            let found = found_in(&ramp(angle), 20.3, 18.6, 1.8);
            assert_eq!(found.angles().len(), 1, "{degrees}");
            let error = (found.angles()[0] - angle + TAU * 1.5) % TAU - TAU * 0.5;
            assert!(
                error.abs() <= 0.59_f32.to_radians(),
                "{degrees}: {}",
                error.to_degrees()
            );
        }
    }

    #[test]
    fn a_roof_has_two_opposite_orientations() {
        let mut plane = Plane::default();
        plane.resize(41, 41);
        for y in 0..41_usize {
            for x in 0..41_usize {
                plane.row_mut(y)[x] = 0.01 * x.abs_diff(20) as f32;
            }
        }
        let found = found_in(&plane, 20.0, 20.0, 2.0);
        assert_eq!(found.angles().len(), 2);
        assert!(found.angles()[0] < 1e-3);
        assert!((found.angles()[1] - TAU / 2.0).abs() < 1e-3);
        // Moved off the ridge by one sigma the lesser side falls below 0.8.
        assert_eq!(found_in(&plane, 22.0, 20.0, 2.0).angles().len(), 1);
    }

    #[test]
    fn a_flat_window_has_none() {
        let mut plane = Plane::default();
        plane.resize(30, 30);
        assert!(found_in(&plane, 15.0, 15.0, 2.0).angles().is_empty());
    }
}
