//! Gaussian pyramid and differences of Gaussians (Lowe, section 3).
//!
//! ```text
//! L(x, y, sigma) = G(x, y, sigma) * I(x, y)
//! D(x, y, sigma) = L(x, y, k sigma) - L(x, y, sigma),   k = 2^(1/s)
//! ```
//!
//! Steps:
//! 1. The image is doubled by linear interpolation. Sample `2x` of the doubled row *is* sample `x`, so octave
//!    coordinates are exact multiples of input coordinates: `x_input = x_octave * step`. The doubled row has `2w - 1`
//!    samples; nothing is extrapolated. (Resizing "area to area" instead would shift all coordinates by 0.25 pixels.)
//! 2. The first level is brought from the camera's blur to `base_sigma`; each next level adds the blur that is missing,
//!    `sqrt(sigma_i^2 - sigma_(i-1)^2)`. An octave has `s + 3` levels, hence `s + 2` differences.
//! 3. Level `s` has twice the first scale: every second sample of it starts the next octave.
//!
//! A blur is two passes over one row at a time: the column sum of the source rows into a padded row, then the row sum.
//! Each output sample adds its taps from the centre outwards, in the same order whatever the vector width, the row block
//! or the thread, so the values are the same on any number of threads. Outside the image the samples are mirrored about
//! the border sample.
//!
//! Cost: per sample and level `3 r` operations a pass, `r` the kernel radius (5 to 12 at the defaults).

use crate::image::{GrayImage, Plane};
use crate::params::{BORDER, KERNEL_REACH_SIGMAS, SiftParams};

/// Rows of one parallel task.
const BLOCK_ROWS: usize = 32;

/// Shorter sides than this leave no sample to examine.
const MIN_OCTAVE_SIDE: usize = 2 * BORDER + 1;

/// The right half of a normalised, symmetric Gaussian kernel: `weights[k]` belongs to the offsets `+k` and `-k`.
#[derive(Debug, Clone)]
pub(crate) struct Kernel {
    weights: Vec<f32>,
}

impl Kernel {
    /// Kernel of standard deviation `sigma` samples, cut at [`KERNEL_REACH_SIGMAS`].
    pub(crate) fn gaussian(sigma: f32) -> Self {
        let radius = (KERNEL_REACH_SIGMAS * sigma).ceil().max(1.0) as usize;
        let value =
            |k: usize| (-((k * k) as f64) / (2.0 * f64::from(sigma) * f64::from(sigma))).exp();
        let sum = 1.0 + 2.0 * (1..=radius).map(value).sum::<f64>();
        Self {
            weights: (0..=radius).map(|k| (value(k) / sum) as f32).collect(),
        }
    }

    pub(crate) fn radius(&self) -> usize {
        self.weights.len() - 1
    }
}

/// The kernels of one octave: `first` makes level 0 from the image, `steps[i]` makes level `i + 1` from level `i`.
#[derive(Debug, Clone)]
pub(crate) struct Kernels {
    first: Kernel,
    steps: Vec<Kernel>,
}

impl Kernels {
    /// Kernels for checked parameters.
    pub(crate) fn new(params: &SiftParams) -> Self {
        let start = params.camera_sigma / params.octave_step(0);
        let first = Kernel::gaussian((params.base_sigma.powi(2) - start.powi(2)).sqrt());
        let steps = (0..params.scales_per_octave + 2)
            .map(|i| {
                let (from, to) = (
                    params.level_sigma(i as f32),
                    params.level_sigma(i as f32 + 1.0),
                );
                Kernel::gaussian((to.powi(2) - from.powi(2)).sqrt())
            })
            .collect();
        Self { first, steps }
    }

    fn max_radius(&self) -> usize {
        self.steps
            .iter()
            .map(Kernel::radius)
            .fold(self.first.radius(), usize::max)
    }
}

/// The pyramid: the Gaussian levels of all octaves, the differences of the current octave only.
#[derive(Debug, Clone, Default)]
pub(crate) struct ScaleSpace {
    levels_per_octave: usize,
    octaves: usize,
    gaussians: Vec<Plane>,
    differences: Vec<Plane>,
    input: Plane,
    padded_rows: Vec<f32>,
}

impl ScaleSpace {
    /// Number of octaves of the image last given to [`ScaleSpace::start`].
    pub(crate) fn octaves(&self) -> usize {
        self.octaves
    }

    /// Gaussian level `level` of octave `octave`.
    pub(crate) fn gaussian(&self, octave: usize, level: usize) -> &Plane {
        &self.gaussians[octave * self.levels_per_octave + level]
    }

    /// The differences of the octave built last, `s + 2` of them.
    pub(crate) fn differences(&self) -> &[Plane] {
        &self.differences
    }

    /// Bytes held.
    pub(crate) fn memory_usage(&self) -> usize {
        let planes = self
            .gaussians
            .iter()
            .chain(&self.differences)
            .chain([&self.input]);
        planes.map(Plane::memory_usage).sum::<usize>()
            + self.padded_rows.capacity() * size_of::<f32>()
    }

    /// Sizes the pyramid for `image` and scales the grey values into the input plane.
    pub(crate) fn start(&mut self, image: &GrayImage<'_>, params: &SiftParams) {
        load(image, params.double_image, &mut self.input);
        let (mut width, mut height) = (self.input.width(), self.input.height());
        self.levels_per_octave = params.scales_per_octave + 3;
        self.octaves = 0;
        while width.min(height) >= MIN_OCTAVE_SIDE {
            self.octaves += 1;
            let needed = self.octaves * self.levels_per_octave;
            if self.gaussians.len() < needed {
                self.gaussians.resize_with(needed, Plane::default);
            }
            for plane in &mut self.gaussians[needed - self.levels_per_octave..needed] {
                plane.resize(width, height);
            }
            (width, height) = (width.div_ceil(2), height.div_ceil(2));
        }
        self.differences
            .resize_with(params.scales_per_octave + 2, Plane::default);
    }

    /// Builds the levels and differences of octave `octave`; the octave before must have been built.
    pub(crate) fn build_octave(&mut self, octave: usize, kernels: &Kernels) {
        let n = self.levels_per_octave;
        let (before, rest) = self.gaussians.split_at_mut(octave * n);
        let levels = &mut rest[..n];
        let (width, height) = (levels[0].width(), levels[0].height());
        for plane in &mut self.differences {
            plane.resize(width, height);
        }
        let blocks = height.div_ceil(BLOCK_ROWS);
        self.padded_rows
            .resize(blocks * (width + 2 * kernels.max_radius()), 0.0);
        if octave == 0 {
            // The difference to the unblurred image is of no use; the next line's successor overwrites it.
            blur(
                &self.input,
                &kernels.first,
                &mut levels[0],
                &mut self.differences[0],
                &mut self.padded_rows,
            );
        } else {
            halve(&before[octave * n - 3], &mut levels[0]);
        }
        for (i, kernel) in kernels.steps.iter().enumerate() {
            let (done, next) = levels.split_at_mut(i + 1);
            blur(
                &done[i],
                kernel,
                &mut next[0],
                &mut self.differences[i],
                &mut self.padded_rows,
            );
        }
    }
}

/// Grey values to `[0, 1]`, doubled by linear interpolation if asked: sample `2x` is sample `x`.
fn load(image: &GrayImage<'_>, double: bool, plane: &mut Plane) {
    const SCALE: f32 = 1.0 / 255.0;
    let (width, height) = (image.width(), image.height());
    if !double {
        plane.resize(width, height);
        for y in 0..height {
            for (out, &grey) in plane.row_mut(y).iter_mut().zip(image.row(y)) {
                *out = f32::from(grey) * SCALE;
            }
        }
        return;
    }
    plane.resize(2 * width - 1, 2 * height - 1);
    for y in 0..2 * height - 1 {
        // Even rows average a row with itself: exact.
        let (upper, lower) = (image.row(y / 2), image.row(y.div_ceil(2)));
        let sum = |x: usize| f32::from(u16::from(upper[x]) + u16::from(lower[x]));
        let row = plane.row_mut(y);
        for x in 0..width - 1 {
            let (here, next) = (sum(x), sum(x + 1));
            row[2 * x] = here * (0.5 * SCALE);
            row[2 * x + 1] = (here + next) * (0.25 * SCALE);
        }
        row[2 * width - 2] = sum(width - 1) * (0.5 * SCALE);
    }
}

/// Every second sample of every second row, beginning with the first.
fn halve(source: &Plane, target: &mut Plane) {
    for y in 0..target.height() {
        let from = source.row(2 * y);
        for (out, value) in target.row_mut(y).iter_mut().zip(from.iter().step_by(2)) {
            *out = *value;
        }
    }
}

/// `target` = `source` blurred, `difference` = `target - source`. `padded_rows` holds one padded row per row block.
fn blur(
    source: &Plane,
    kernel: &Kernel,
    target: &mut Plane,
    difference: &mut Plane,
    padded_rows: &mut [f32],
) {
    let (width, height) = (source.width(), source.height());
    let padded = padded_rows.len() / height.div_ceil(BLOCK_ROWS);
    let chunk = BLOCK_ROWS * width;
    let run = |block: usize, target: &mut [f32], difference: &mut [f32], padded_row: &mut [f32]| {
        let rows = target
            .chunks_exact_mut(width)
            .zip(difference.chunks_exact_mut(width));
        for (i, (out, diff)) in rows.enumerate() {
            blur_row(
                source,
                block * BLOCK_ROWS + i,
                kernel,
                padded_row,
                out,
                diff,
            );
        }
    };
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        target
            .data_mut()
            .par_chunks_mut(chunk)
            .zip(difference.data_mut().par_chunks_mut(chunk))
            .zip(padded_rows.par_chunks_mut(padded))
            .enumerate()
            .for_each(|(block, ((out, diff), row))| run(block, out, diff, row));
    }
    #[cfg(not(feature = "parallel"))]
    for (block, ((out, diff), row)) in target
        .data_mut()
        .chunks_mut(chunk)
        .zip(difference.data_mut().chunks_mut(chunk))
        .zip(padded_rows.chunks_mut(padded))
        .enumerate()
    {
        run(block, out, diff, row);
    }
}

/// One output row of [`blur`].
fn blur_row(
    source: &Plane,
    y: usize,
    kernel: &Kernel,
    padded: &mut [f32],
    out: &mut [f32],
    diff: &mut [f32],
) {
    let (width, height, radius) = (source.width(), source.height(), kernel.radius());
    let padded = &mut padded[..width + 2 * radius];
    let row = |offset: isize| source.row(mirror(y as isize + offset, height));
    weighted_sum(kernel, &mut padded[radius..radius + width], row);
    for k in 1..=radius {
        padded[radius - k] = padded[radius + mirror(-(k as isize), width)];
        padded[radius + width - 1 + k] = padded[radius + mirror((width - 1 + k) as isize, width)];
    }
    let shifted = |offset: isize| &padded[radius.wrapping_add_signed(offset)..];
    weighted_sum(kernel, out, shifted);
    for ((d, a), b) in diff.iter_mut().zip(&*out).zip(source.row(y)) {
        *d = *a - *b;
    }
}

/// `sum[x] = sum over k of weights[|k|] samples(k)[x]`, two pairs of taps a pass: the row stays in the first cache and
/// each pass is plain vector code.
#[inline(always)]
fn weighted_sum<'a>(kernel: &Kernel, sum: &mut [f32], samples: impl Fn(isize) -> &'a [f32]) {
    let pair = |k: usize| (samples(-(k as isize)), samples(k as isize));
    for (s, centre) in sum.iter_mut().zip(samples(0)) {
        *s = kernel.weights[0] * *centre;
    }
    let mut k = 1;
    while k < kernel.radius() {
        add_two_pairs(
            sum,
            [kernel.weights[k], kernel.weights[k + 1]],
            [pair(k), pair(k + 1)],
        );
        k += 2;
    }
    if k == kernel.radius() {
        let (a, b) = pair(k);
        for ((s, a), b) in sum.iter_mut().zip(a).zip(b) {
            *s += kernel.weights[k] * (*a + *b);
        }
    }
}

/// `sum += w0 (a0 + b0)`, then `sum += w1 (a1 + b1)`.
fn add_two_pairs(sum: &mut [f32], [w0, w1]: [f32; 2], [(a0, b0), (a1, b1)]: [(&[f32], &[f32]); 2]) {
    let n = sum.len();
    let (a0, b0, a1, b1) = (&a0[..n], &b0[..n], &a1[..n], &b1[..n]);
    for x in 0..n {
        sum[x] = (sum[x] + w0 * (a0[x] + b0[x])) + w1 * (a1[x] + b1[x]);
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
        for v in plane.data_mut() {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *v = (state >> 8) as f32 / (1 << 24) as f32;
        }
        plane
    }

    #[test]
    fn mirroring_keeps_the_border_sample_single() {
        let got: Vec<usize> = (-5..9).map(|i| mirror(i, 4)).collect();
        assert_eq!(got, [1, 2, 3, 2, 1, 0, 1, 2, 3, 2, 1, 0, 1, 2]);
        assert_eq!(mirror(-7, 1), 0);
    }

    #[test]
    fn kernels_have_unit_mass_and_the_asked_variance() {
        for sigma in [0.8_f32, 1.25, 3.1, 27.0] {
            let k = Kernel::gaussian(sigma);
            let mass: f64 = k
                .weights
                .iter()
                .enumerate()
                .map(|(i, &w)| f64::from(w) * if i == 0 { 1.0 } else { 2.0 })
                .sum();
            let variance: f64 = k
                .weights
                .iter()
                .enumerate()
                .map(|(i, &w)| 2.0 * f64::from(w) * (i * i) as f64)
                .sum();
            assert!((mass - 1.0).abs() < 1e-6, "mass {mass}");
            // The tails beyond 4 sigma hold about 1e-3 of the variance.
            assert!(
                (variance / f64::from(sigma * sigma) - 1.0).abs() < 2e-3,
                "variance {variance}"
            );
        }
    }

    #[test]
    fn blur_is_the_direct_convolution() {
        // Sides shorter than the kernel, heights above one row block.
        for (width, height) in [(11, 13), (16, 11), (37, 70), (50, 33)] {
            let source = noise(width, height);
            for sigma in [1.2, 2.5, 5.0] {
                let kernel = Kernel::gaussian(sigma);
                let radius = kernel.radius() as isize;
                let (mut out, mut diff) = (source.clone(), source.clone());
                let mut scratch =
                    vec![0.0; height.div_ceil(BLOCK_ROWS) * (width + 2 * kernel.radius())];
                blur(&source, &kernel, &mut out, &mut diff, &mut scratch);
                for y in 0..height {
                    for x in 0..width {
                        let mut exact = 0.0;
                        for j in -radius..=radius {
                            for i in -radius..=radius {
                                let w = f64::from(kernel.weights[i.unsigned_abs()])
                                    * f64::from(kernel.weights[j.unsigned_abs()]);
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
                        assert_eq!(diff.at(x, y), out.at(x, y) - source.at(x, y));
                    }
                }
            }
        }
    }

    #[test]
    fn doubling_keeps_the_samples_and_halves_between() {
        let data: Vec<u8> = (0..17 * 16).map(|i| (i * 37 % 251) as u8).collect();
        let image = GrayImage::new(17, 16, &data).unwrap();
        let mut plane = Plane::default();
        load(&image, true, &mut plane);
        assert_eq!((plane.width(), plane.height()), (33, 31));
        let grey = |x: usize, y: usize| f32::from(data[y * 17 + x]) / 255.0;
        for y in 0..15 {
            for x in 0..16 {
                let corners = [
                    grey(x, y),
                    grey(x + 1, y),
                    grey(x, y + 1),
                    grey(x + 1, y + 1),
                ];
                let close = |a: f32, b: f32| (a - b).abs() < 2.0 * f32::EPSILON;
                assert!(close(plane.at(2 * x, 2 * y), corners[0]));
                assert!(close(
                    plane.at(2 * x + 1, 2 * y),
                    (corners[0] + corners[1]) / 2.0
                ));
                assert!(close(
                    plane.at(2 * x, 2 * y + 1),
                    (corners[0] + corners[2]) / 2.0
                ));
                assert!(close(
                    plane.at(2 * x + 1, 2 * y + 1),
                    corners.iter().sum::<f32>() / 4.0
                ));
            }
        }
    }

    #[test]
    fn octaves_halve_down_to_the_border() {
        let data = vec![7_u8; 41 * 30];
        let params = SiftParams::default();
        let mut space = ScaleSpace::default();
        space.start(&GrayImage::new(41, 30, &data).unwrap(), &params);
        let sides: Vec<_> = (0..space.octaves())
            .map(|o| (space.gaussian(o, 0).width(), space.gaussian(o, 0).height()))
            .collect();
        assert_eq!(sides, [(81, 59), (41, 30), (21, 15)]);
    }
}
