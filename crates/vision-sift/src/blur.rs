//! The separable convolution of a plane with a symmetric kernel.
//!
//! Steps, for each [`BLUR_ROWS`] output rows:
//! 1. Columns: each source row within reach is read once and added to all the output rows it belongs to, top to bottom.
//!    The sums stay in registers; they go to padded rows that stay in the first cache.
//! 2. Rows: the padded rows are mirrored at their ends and summed from the centre outwards, pair by pair.
//!
//! Every output sample adds the same terms in the same order whatever its place in a vector, a row block or a thread.
//! Outside the image the samples are mirrored about the border sample.
//!
//! Cost per sample, for a kernel of radius `r`: `2 r + 4` products and sums for the columns, `r` products and `2 r` sums for
//! the rows. Reading the source row by row instead, `2 r + 1` rows for each output row, took twice the time: those
//! rows do not fit the first cache.

use simd_level::SimdLevel;

use crate::image::Plane;
use crate::kernel::{BLUR_ROWS, Kernel};
use crate::simd::{self, Body, LANES, Lanes, Run, load, store};
use crate::threads::for_each_block;

/// The number of rows that one parallel task takes.
const BLOCK_ROWS: usize = 32;

/// The most source rows that one step reads: scale 32 from scale 16 (`base_sigma` 4, one scale an octave) takes a radius of
/// 111.
const MAX_SOURCE_ROWS: usize = 2 * 111 + BLUR_ROWS;

/// The number of scratch samples that [`blur`] needs for a plane.
pub(crate) fn scratch_length(width: usize, height: usize, radius: usize) -> usize {
    height.div_ceil(BLOCK_ROWS) * BLUR_ROWS * padded_length(width, radius)
}

/// Blurs `source` into `target`, which must have the same size.
pub(crate) fn blur(
    level: SimdLevel,
    source: &Plane,
    kernel: &Kernel,
    target: &mut Plane,
    scratch: &mut [f32],
) {
    let (width, height, stride) = (source.width(), source.height(), source.stride());
    let padded = BLUR_ROWS * padded_length(width, kernel.radius());
    for_each_block(
        target.samples_mut(),
        BLOCK_ROWS * stride,
        &mut scratch[..height.div_ceil(BLOCK_ROWS) * padded],
        padded,
        |block, rows, padded_rows| {
            simd::run(
                level,
                BlurRows {
                    source,
                    kernel,
                    first: block * BLOCK_ROWS,
                    rows,
                    padded_rows,
                },
            );
        },
    );
}

/// The number of samples before the first of a padded row: the kernel radius, rounded up to whole vectors.
fn margin(radius: usize) -> usize {
    radius.next_multiple_of(LANES)
}

fn padded_length(width: usize, radius: usize) -> usize {
    width.next_multiple_of(LANES) + 2 * margin(radius)
}

/// Makes the rows of the blurred plane that begin with `first`, as many as `rows` holds.
struct BlurRows<'a> {
    source: &'a Plane,
    kernel: &'a Kernel,
    first: usize,
    rows: &'a mut [f32],
    padded_rows: &'a mut [f32],
}

impl Body for BlurRows<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (width, height, stride) = (
            self.source.width(),
            self.source.height(),
            self.source.stride(),
        );
        let radius = self.kernel.radius();
        let (margin, padded) = (margin(radius), padded_length(width, radius));
        let samples = self.source.samples();
        let mut starts = [0; MAX_SOURCE_ROWS];
        let starts = &mut starts[..2 * radius + BLUR_ROWS];
        for (step, rows) in self.rows.chunks_mut(BLUR_ROWS * stride).enumerate() {
            let top = (self.first + step * BLUR_ROWS) as isize - radius as isize;
            for (start, y) in starts.iter_mut().zip(top..) {
                *start = mirror(y, height) * stride;
            }
            let mut x = 0;
            while x + 2 * LANES <= stride {
                let sums = column_sums::<L, 2>(samples, starts, self.kernel, x);
                store_sums(sums, &mut self.padded_rows[margin + x..], padded);
                x += 2 * LANES;
            }
            if x < stride {
                let sums = column_sums::<L, 1>(samples, starts, self.kernel, x);
                store_sums(sums, &mut self.padded_rows[margin + x..], padded);
            }
            let out = rows.chunks_exact_mut(stride);
            for (out, row) in out.zip(self.padded_rows.chunks_exact_mut(padded)) {
                mirror_ends(row, margin, width, radius);
                row_sums::<L>(row, self.kernel, out);
            }
        }
    }
}

/// The column sums of [`BLUR_ROWS`] rows, for `N` vectors from column `x` on.
#[inline(always)]
fn column_sums<L: Lanes, const N: usize>(
    samples: &[f32],
    starts: &[usize],
    kernel: &Kernel,
    x: usize,
) -> [[L; N]; BLUR_ROWS] {
    let mut sums = [[L::splat(0.0); N]; BLUR_ROWS];
    for (start, weights) in starts.iter().zip(kernel.padded().windows(BLUR_ROWS)) {
        let source = &samples[start + x..][..N * LANES];
        for i in 0..N {
            let value = load::<L>(source, i * LANES);
            for (t, sums) in sums.iter_mut().enumerate() {
                let weight = L::splat(weights[BLUR_ROWS - 1 - t]);
                sums[i] = sums[i].add(weight.mul(value));
            }
        }
    }
    sums
}

/// Writes column sums to the padded rows.
#[inline(always)]
fn store_sums<L: Lanes, const N: usize>(
    sums: [[L; N]; BLUR_ROWS],
    padded_rows: &mut [f32],
    padded: usize,
) {
    for (t, sums) in sums.into_iter().enumerate() {
        for (i, sum) in sums.into_iter().enumerate() {
            store(sum, padded_rows, t * padded + i * LANES);
        }
    }
}

/// Mirrors the samples about the first and the last one into `radius` samples of the margins.
#[inline(always)]
fn mirror_ends(row: &mut [f32], margin: usize, width: usize, radius: usize) {
    for k in 1..=radius {
        row[margin - k] = row[margin + mirror(-(k as isize), width)];
        row[margin + width - 1 + k] = row[margin + mirror((width - 1 + k) as isize, width)];
    }
}

/// Writes to `out[x]` the weighted sum around sample `x` of the padded row.
#[inline(always)]
fn row_sums<L: Lanes>(row: &[f32], kernel: &Kernel, out: &mut [f32]) {
    let mut x = 0;
    while x + 4 * LANES <= out.len() {
        row_sums_at::<L, 4>(row, kernel, x, &mut out[x..]);
        x += 4 * LANES;
    }
    while x < out.len() {
        row_sums_at::<L, 1>(row, kernel, x, &mut out[x..]);
        x += LANES;
    }
}

/// Writes `N` vectors of row sums from sample `x` on.
#[inline(always)]
fn row_sums_at<L: Lanes, const N: usize>(row: &[f32], kernel: &Kernel, x: usize, out: &mut [f32]) {
    let radius = kernel.radius();
    let half = kernel.half();
    // Sample `x - radius` comes first.
    let window = &row[margin(radius) + x - radius..][..2 * radius + N * LANES];
    let centre = L::splat(half[0]);
    let mut sums = [centre; N];
    for (i, sum) in sums.iter_mut().enumerate() {
        *sum = centre.mul(load(&window[radius..], i * LANES));
    }
    for (k, weight) in half.iter().enumerate().skip(1) {
        let weight = L::splat(*weight);
        let before = &window[radius - k..][..N * LANES];
        let after = &window[radius + k..][..N * LANES];
        for (i, sum) in sums.iter_mut().enumerate() {
            let pair = load::<L>(before, i * LANES).add(load(after, i * LANES));
            *sum = sum.add(weight.mul(pair));
        }
    }
    for (out, sum) in out.as_chunks_mut().0.iter_mut().zip(sums) {
        let out: &mut Run = out;
        sum.store(out);
    }
}

/// Index `i` mirrored into `0..n` about the first and the last sample, as often as needed.
fn mirror(i: isize, n: usize) -> usize {
    if (0..n as isize).contains(&i) {
        return i as usize;
    }
    if n == 1 {
        return 0;
    }
    let period = 2 * (n - 1);
    let i = i.rem_euclid(period as isize) as usize;
    if i < n { i } else { period - i }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey values without structure, from a linear congruential step.
    fn noise(width: usize, height: usize) -> Plane {
        let mut plane = Plane::default();
        plane.resize(width, height);
        let mut state = 12345_u32;
        for y in 0..height {
            for v in plane.row_mut(y) {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                *v = (state >> 8) as f32 / (1 << 24) as f32;
            }
        }
        plane
    }

    fn blurred(level: SimdLevel, source: &Plane, kernel: &Kernel) -> Plane {
        let (width, height) = (source.width(), source.height());
        let mut out = Plane::default();
        out.resize(width, height);
        let mut scratch = vec![0.0; scratch_length(width, height, kernel.radius())];
        blur(level, source, kernel, &mut out, &mut scratch);
        out
    }

    #[test]
    fn mirroring_keeps_the_border_sample_single() {
        let got: Vec<usize> = (-5..9).map(|i| mirror(i, 4)).collect();
        assert_eq!(got, [1, 2, 3, 2, 1, 0, 1, 2, 3, 2, 1, 0, 1, 2]);
        assert_eq!(mirror(-7, 1), 0);
    }

    #[test]
    fn blur_is_the_direct_convolution_on_every_level() {
        // Sides shorter than the kernel and than a vector, heights above one row block.
        for (width, height) in [(11, 13), (16, 11), (37, 70), (50, 33), (130, 35)] {
            let source = noise(width, height);
            for sigma in [1.2, 2.5, 5.0] {
                let kernel = Kernel::gaussian(sigma, (4.0 * sigma).ceil() as usize);
                let out = blurred(SimdLevel::Portable, &source, &kernel);
                let radius = kernel.radius() as isize;
                for y in 0..height {
                    for x in 0..width {
                        let mut exact = 0.0;
                        for j in -radius..=radius {
                            for i in -radius..=radius {
                                let w = f64::from(kernel.half()[i.unsigned_abs()])
                                    * f64::from(kernel.half()[j.unsigned_abs()]);
                                let v = source.at(
                                    mirror(x as isize + i, width),
                                    mirror(y as isize + j, height),
                                );
                                exact += w * f64::from(v);
                            }
                        }
                        // Two passes of 2 r + 1 terms of mass 1: the rounding stays within a few ulp of 1.
                        assert!(
                            (f64::from(out.at(x, y)) - exact).abs() < 8.0 * f64::from(f32::EPSILON)
                        );
                    }
                }
                for level in SimdLevel::available() {
                    let other = blurred(level, &source, &kernel);
                    for y in 0..height {
                        assert_eq!(out.row(y), other.row(y), "{level} {width}x{height} row {y}");
                    }
                }
            }
        }
    }

    #[test]
    fn the_longest_kernel_fits() {
        let sigma = (32.0_f32.powi(2) - 16.0_f32.powi(2)).sqrt();
        let kernel = Kernel::gaussian(sigma, (4.0 * sigma).ceil() as usize);
        assert_eq!(2 * kernel.radius() + BLUR_ROWS, MAX_SOURCE_ROWS);
        let source = noise(20, 17);
        let mean = blurred(SimdLevel::best(), &source, &kernel).at(7, 7);
        assert!((0.4..0.6).contains(&mean), "{mean}");
    }
}
