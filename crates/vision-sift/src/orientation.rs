//! Orientations of a keypoint (Lowe, section 5).
//!
//! Steps:
//! 1. The gradients of the Gaussian level nearest in scale, in a disc-like window of standard deviation `1.5 sigma`
//!    around the refined position (not the nearest sample), are added with weight `m exp(-d^2 / 2 (1.5 sigma)^2)` to a
//!    histogram of 36 bins.
//! 2. The histogram is smoothed around the circle with `[1 4 6 4 1] / 16`.
//! 3. Each local maximum of at least 0.8 of the highest gives an orientation; a parabola through the bin and its two
//!    neighbours gives the angle between bins.
//!
//! A flat window (no gradient at all) gives no orientation and so no keypoint. Cost: about 230 to 900 gradients.

use std::f32::consts::TAU;

use crate::gradient::{WindowTable, atan2, falloff, length};
use crate::image::Plane;
use crate::params::{
    ORIENTATION_BINS, ORIENTATION_PEAK_RATIO, ORIENTATION_REACH_SIGMAS, ORIENTATION_SIGMA_FACTOR,
};
use crate::simd::{Body, LANES, Lanes, SimdLevel};

/// At most every second bin can be a strict local maximum.
const MAX_PEAKS: usize = ORIENTATION_BINS / 2;

/// Longest row of the window: `base_sigma` 4 and one scale per octave give a radius of 55.
const MAX_WINDOW: usize = 128;

/// Partial histograms.
const PARTS: usize = 4;

/// Places of a partial histogram: a power of two above the number of bins, so that no index needs a check.
const BIN_SLOTS: usize = 64;

/// Adding `1.5 * 2^23` rounds to the nearest integer, ties to even, and leaves it in the low bits.
const INDEX_ROUNDER: f32 = 12_582_912.0;

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
    /// Radians in `[0, 2 pi)`, from the x axis towards the y axis.
    pub(crate) fn angles(&self) -> &[f32] {
        &self.angles[..self.count]
    }
}

/// Orientations at `(x, y)` of `plane`, a point of scale `sigma`; all in the pixels of the plane.
pub(crate) fn orientations(
    simd: SimdLevel,
    plane: &Plane,
    x: f32,
    y: f32,
    sigma: f32,
) -> Orientations {
    let histogram = smoothed(&simd.run(GradientHistogram { plane, x, y, sigma }));
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

/// The histogram before smoothing. Four partial histograms take every fourth sample: samples beside one another mostly
/// fall into one bin, and adding to the same place four times in a row would wait for itself.
struct GradientHistogram<'a> {
    plane: &'a Plane,
    x: f32,
    y: f32,
    sigma: f32,
}

impl Body for GradientHistogram<'_> {
    type Output = [f32; ORIENTATION_BINS];

    #[inline(always)]
    fn run<L: Lanes>(self) -> [f32; ORIENTATION_BINS] {
        let Self { plane, x, y, sigma } = self;
        let window_sigma = ORIENTATION_SIGMA_FACTOR * sigma;
        let radius = ORIENTATION_REACH_SIGMAS * window_sigma;
        let scale = -0.5 / (window_sigma * window_sigma);
        let (left, right) = window(x, radius, plane.width());
        let (top, bottom) = window(y, radius, plane.height());
        let columns = WindowTable::new::<L>(x, left, right, scale);
        let mut bins = [[0.0; BIN_SLOTS]; PARTS];
        for row in top..=bottom {
            let dy = L::splat(row as f32 - y);
            let row_factor = falloff(dy.mul(dy).mul(L::splat(scale)));
            for start in (left..=right).step_by(LANES) {
                let (gx, gy) = columns.gradients::<L>(plane, start, row, row_factor);
                let count = LANES.min(right + 1 - start);
                add::<L>(gx, gy, count, &mut bins);
            }
        }
        std::array::from_fn(|i| {
            // An angle just below a whole turn rounds up to the bin after the last.
            let sum = |k: usize| (bins[0][k] + bins[1][k]) + (bins[2][k] + bins[3][k]);
            if i == 0 {
                sum(0) + sum(ORIENTATION_BINS)
            } else {
                sum(i)
            }
        })
    }
}

/// Adds the first `count` of a vector of gradients.
#[inline(always)]
fn add<L: Lanes>(gx: L, gy: L, count: usize, bins: &mut [[f32; BIN_SLOTS]; PARTS]) {
    const BINS_PER_RADIAN: f32 = ORIENTATION_BINS as f32 / TAU;
    let angle = atan2(gy, gx).mul(L::splat(BINS_PER_RADIAN));
    let turn = L::splat(ORIENTATION_BINS as f32);
    let angle = L::select(L::splat(0.0).greater(angle), angle.add(turn), angle);
    let (mut index, mut weight) = ([0.0; LANES], [0.0; LANES]);
    angle.add(L::splat(INDEX_ROUNDER)).store(&mut index);
    length(gx, gy).store(&mut weight);
    for i in 0..count {
        let bin = index[i].to_bits() as usize % BIN_SLOTS;
        bins[i % PARTS][bin] += weight[i];
    }
}

/// First and last sample within `radius` of `centre` that have neighbours on both sides.
fn window(centre: f32, radius: f32, length: usize) -> (usize, usize) {
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

    /// The orientations, the same on every level.
    fn found_in(plane: &Plane, x: f32, y: f32, sigma: f32) -> Orientations {
        let found = orientations(SimdLevel::PORTABLE, plane, x, y, sigma);
        for level in SimdLevel::available() {
            assert_eq!(orientations(level, plane, x, y, sigma), found, "{level}");
        }
        found
    }

    #[test]
    fn a_ramp_points_uphill() {
        // All gradients fall into one bin: the peak is its centre, at most half a bin (5 degrees) away.
        for degrees in (0..360).step_by(7) {
            let angle = (degrees as f32).to_radians();
            let found = found_in(&ramp(angle), 20.3, 18.6, 1.8);
            assert_eq!(found.angles().len(), 1, "{degrees}");
            let error = (found.angles()[0] - angle + TAU * 1.5) % TAU - TAU * 0.5;
            assert!(
                error.abs() <= 5.01_f32.to_radians(),
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
