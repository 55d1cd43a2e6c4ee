//! The Gaussian pyramid and the differences of Gaussians (Lowe, section 3).
//!
//! ```text
//! L(x, y, sigma) = G(x, y, sigma) * I(x, y)
//! D(x, y, sigma) = L(x, y, k sigma) - L(x, y, sigma),   k = 2^(1/s)
//! ```
//!
//! Steps:
//! 1. The image is doubled by linear interpolation (other [`Conventions`](crate::Conventions) than the default are not
//!    described here). Sample `2x` of the doubled row *is* sample `x`, so octave
//!    coordinates are exact multiples of input coordinates: `x_input = x_octave * step`. The doubled row has `2w - 1`
//!    samples; nothing is extrapolated. (Resizing "area to area" instead would shift all coordinates by 0.25 pixels.)
//! 2. The first level is brought from the camera's blur to `base_sigma`; each next level adds the blur that is missing,
//!    `sqrt(sigma_i^2 - sigma_(i-1)^2)`. An octave has `s + 3` levels, hence `s + 2` differences.
//! 3. Level `s` has twice the first scale: every second sample of it starts the next octave.
//!
//! The differences are not stored: the search for extrema and the refinement subtract where they look, which saves
//! writing and reading five planes an octave.

use simd_level::SimdLevel;

use crate::blur::{blur, scratch_length};
use crate::constants::BORDER;
use crate::conventions::Doubling;
use crate::image::{GrayImage, Plane};
use crate::kernel::{Kernel, Kernels};
use crate::params::SiftParams;
use crate::pixel::Pixel;
use crate::simd::{self, Body, Lanes};

/// The shortest side of an octave: a shorter one leaves no sample to examine.
const MIN_OCTAVE_SIDE: usize = 2 * BORDER + 1;

/// The differences of one octave: level `i` is Gaussian level `i + 1` minus level `i`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Differences<'a>(pub(crate) &'a [Plane]);

impl Differences<'_> {
    /// The number of levels of differences, `s + 2`.
    pub(crate) fn levels(&self) -> usize {
        self.0.len() - 1
    }

    pub(crate) fn width(&self) -> usize {
        self.0[0].width()
    }

    pub(crate) fn height(&self) -> usize {
        self.0[0].height()
    }

    /// The difference at a sample.
    #[inline]
    pub(crate) fn at(&self, level: usize, x: usize, y: usize) -> f32 {
        self.0[level + 1].at(x, y) - self.0[level].at(x, y)
    }
}

/// The pyramid: the Gaussian levels of all octaves.
#[derive(Debug, Clone, Default)]
pub(crate) struct ScaleSpace {
    levels_per_octave: usize,
    octaves: usize,
    gaussians: Vec<Plane>,
    input: Plane,
    scratch: Vec<f32>,
}

impl ScaleSpace {
    /// The number of octaves of the image last given to [`ScaleSpace::start`].
    pub(crate) fn octaves(&self) -> usize {
        self.octaves
    }

    /// Gaussian level `level` of octave `octave`.
    pub(crate) fn gaussian(&self, octave: usize, level: usize) -> &Plane {
        &self.gaussians[octave * self.levels_per_octave + level]
    }

    /// The differences of octave `octave`.
    pub(crate) fn differences(&self, octave: usize) -> Differences<'_> {
        Differences(&self.gaussians[octave * self.levels_per_octave..][..self.levels_per_octave])
    }

    /// The memory held on the heap, bytes.
    pub(crate) fn memory_usage(&self) -> usize {
        let planes = self.gaussians.iter().chain([&self.input]);
        planes.map(Plane::memory_usage).sum::<usize>() + self.scratch.capacity() * size_of::<f32>()
    }

    /// Sizes the pyramid for `image` and writes its grey values, scaled to `[0, 1]`, to the input plane.
    pub(crate) fn start<P: Pixel>(
        &mut self,
        level: SimdLevel,
        image: &GrayImage<'_, P>,
        params: &SiftParams,
    ) {
        let conventions = params.conventions;
        let (mut width, mut height) = (image.width(), image.height());
        if params.double_image {
            let left_out = usize::from(conventions.doubling == Doubling::Exact);
            (width, height) = (2 * width - left_out, 2 * height - left_out);
        }
        self.input.resize(width, height);
        simd::run(
            level,
            LoadRows {
                image,
                doubling: params.double_image.then_some(conventions.doubling),
                plane: &mut self.input,
            },
        );
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
            (width, height) = (conventions.halved(width), conventions.halved(height));
        }
    }

    /// Builds the levels of octave `octave`; the octave before must have been built.
    pub(crate) fn build_octave(&mut self, level: SimdLevel, octave: usize, kernels: &Kernels) {
        let n = self.levels_per_octave;
        let (before, rest) = self.gaussians.split_at_mut(octave * n);
        let levels = &mut rest[..n];
        let (width, height) = (levels[0].width(), levels[0].height());
        let radius = kernels
            .steps
            .iter()
            .map(Kernel::radius)
            .fold(kernels.first.radius(), usize::max);
        let needed = scratch_length(width, height, radius);
        if self.scratch.len() < needed {
            self.scratch.resize(needed, 0.0);
        }
        let scratch = &mut self.scratch;
        if octave == 0 {
            blur(level, &self.input, &kernels.first, &mut levels[0], scratch);
        } else {
            simd::run(
                level,
                Halve {
                    source: &before[octave * n - 3],
                    target: &mut levels[0],
                },
            );
        }
        for (i, kernel) in kernels.steps.iter().enumerate() {
            let (done, next) = levels.split_at_mut(i + 1);
            blur(level, &done[i], kernel, &mut next[0], scratch);
        }
    }
}

/// Scales grey values to `[0, 1]`, and doubles the image by linear interpolation where `doubling` says so.
struct LoadRows<'a, P> {
    image: &'a GrayImage<'a, P>,
    doubling: Option<Doubling>,
    plane: &'a mut Plane,
}

impl<P: Pixel> Body for LoadRows<'_, P> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (image, stride) = (self.image, self.plane.stride());
        let rows = self.plane.samples_mut().chunks_exact_mut(stride);
        for (y, row) in rows.enumerate() {
            match self.doubling {
                None => {
                    for (out, &grey) in row.iter_mut().zip(image.row(y)) {
                        *out = grey.raw() * P::SCALE;
                    }
                }
                Some(Doubling::Exact | Doubling::LastRepeated) => double_on_samples(image, y, row),
                Some(Doubling::Area) => double_by_area(image, y, row),
            }
        }
    }
}

/// Writes row `y` of the doubled image: sample `2x` is sample `x`, the odd ones are means, and the last is repeated where
/// the row has room.
#[inline(always)]
fn double_on_samples<P: Pixel>(image: &GrayImage<'_, P>, y: usize, row: &mut [f32]) {
    let (width, height) = (image.width(), image.height());
    // Even rows average a row with itself: exact.
    let (upper, lower) = (image.row(y / 2), image.row(y.div_ceil(2).min(height - 1)));
    let (pairs, _) = row.as_chunks_mut::<2>();
    let pairs = pairs[..width - 1].iter_mut();
    let here = upper.iter().zip(lower);
    let next = upper[1..].iter().zip(&lower[1..]);
    for ((pair, (u, l)), (v, m)) in pairs.zip(here).zip(next) {
        // Exact for integers: sums far below 2^24.
        let here = u.raw() + l.raw();
        let next = v.raw() + m.raw();
        *pair = [here * (0.5 * P::SCALE), (here + next) * (0.25 * P::SCALE)];
    }
    let last = upper[width - 1].raw() + lower[width - 1].raw();
    for out in row[2 * width - 2..].iter_mut().take(2) {
        *out = last * (0.5 * P::SCALE);
    }
}

/// Writes row `y` of the doubled image whose sample `i` lies at `i / 2 - 1/4`: three parts of the nearer sample and one of
/// the next, with the border repeated.
#[inline(always)]
fn double_by_area<P: Pixel>(image: &GrayImage<'_, P>, y: usize, row: &mut [f32]) {
    let (width, height) = (image.width(), image.height());
    let (near, far) = (image.row(y / 2), image.row(beside(y, height)));
    for (x, out) in row[..2 * width].iter_mut().enumerate() {
        let (a, b) = (x / 2, beside(x, width));
        let a = 3.0 * near[a].raw() + far[a].raw();
        let b = 3.0 * near[b].raw() + far[b].raw();
        *out = (3.0 * a + b) * (P::SCALE / 16.0);
    }
}

/// The other of the two input samples beside output `i`; the nearer one is `i / 2`.
#[inline(always)]
fn beside(i: usize, n: usize) -> usize {
    if i % 2 == 1 {
        (i / 2 + 1).min(n - 1)
    } else {
        (i / 2).saturating_sub(1)
    }
}

/// Takes every second sample of every second row, beginning with the first.
struct Halve<'a> {
    source: &'a Plane,
    target: &'a mut Plane,
}

impl Body for Halve<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self) {
        let stride = self.target.stride();
        let rows = self.target.samples_mut().chunks_exact_mut(stride);
        for (y, row) in rows.enumerate() {
            let (pairs, rest) = self.source.row(2 * y).as_chunks::<2>();
            for (out, pair) in row.iter_mut().zip(pairs) {
                *out = pair[0];
            }
            // An odd side keeps its last sample, unless sides are rounded down.
            if let ([last], Some(out)) = (rest, row.get_mut(pairs.len())) {
                *out = *last;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doubling_keeps_the_samples_and_halves_between() {
        let data: Vec<u8> = (0..17 * 16).map(|i| (i * 37 % 251) as u8).collect();
        let image = GrayImage::new(17, 16, &data).unwrap();
        let grey = |x: usize, y: usize| f32::from(data[y * 17 + x]) / 255.0;
        for level in SimdLevel::available() {
            let mut space = ScaleSpace::default();
            space.start(level, &image, &SiftParams::default());
            let plane = &space.input;
            assert_eq!((plane.width(), plane.height()), (33, 31));
            for y in 0..15 {
                for x in 0..16 {
                    let corners = [
                        grey(x, y),
                        grey(x + 1, y),
                        grey(x, y + 1),
                        grey(x + 1, y + 1),
                    ];
                    let close = |x: usize, y: usize, expected: f32| {
                        assert!((plane.at(x, y) - expected).abs() < 2.0 * f32::EPSILON);
                    };
                    close(2 * x, 2 * y, corners[0]);
                    close(2 * x + 1, 2 * y, (corners[0] + corners[1]) / 2.0);
                    close(2 * x, 2 * y + 1, (corners[0] + corners[2]) / 2.0);
                    close(2 * x + 1, 2 * y + 1, corners.iter().sum::<f32>() / 4.0);
                    close(32, 30, grey(16, 15));
                }
            }
        }
    }

    #[test]
    fn doubling_as_opencv_has_two_samples_a_pixel() {
        let data: Vec<u8> = (0..17 * 16).map(|i| (i * 37 % 251) as u8).collect();
        let image = GrayImage::new(17, 16, &data).unwrap();
        let grey = |x: usize, y: usize| f32::from(data[y * 17 + x]) / 255.0;
        // Linear interpolation at x / 2 + shift in both directions, the border repeated.
        let expected = |x: usize, y: usize, shift: f32| {
            let parts = |i: usize, n: usize| {
                let at = (i as f32 / 2.0 + shift).clamp(0.0, (n - 1) as f32);
                let low = at.floor() as usize;
                (low, (low + 1).min(n - 1), at - at.floor())
            };
            let ((x0, x1, u), (y0, y1, v)) = (parts(x, 17), parts(y, 16));
            let row = |y: usize| grey(x0, y) * (1.0 - u) + grey(x1, y) * u;
            row(y0) * (1.0 - v) + row(y1) * v
        };
        let mut space = ScaleSpace::default();
        for (doubling, shift) in [(Doubling::Area, -0.25), (Doubling::LastRepeated, 0.0)] {
            let mut params = SiftParams::opencv();
            params.conventions.doubling = doubling;
            space.start(SimdLevel::best(), &image, &params);
            let plane = &space.input;
            assert_eq!((plane.width(), plane.height()), (34, 32));
            for y in 0..32 {
                for x in 0..34 {
                    let error = plane.at(x, y) - expected(x, y, shift);
                    assert!(
                        error.abs() < 4.0 * f32::EPSILON,
                        "{doubling:?} {x} {y}: {error}"
                    );
                }
            }
        }
    }

    #[test]
    fn halving_keeps_every_second_sample() {
        for (width, height) in [(21, 13), (22, 14)] {
            let mut source = Plane::default();
            source.resize(width, height);
            for y in 0..height {
                for (x, v) in source.row_mut(y).iter_mut().enumerate() {
                    *v = (100 * y + x) as f32;
                }
            }
            let mut target = Plane::default();
            target.resize(11, 7);
            simd::run(
                SimdLevel::best(),
                Halve {
                    source: &source,
                    target: &mut target,
                },
            );
            for y in 0..7 {
                for x in 0..11 {
                    assert_eq!(target.at(x, y), (200 * y + 2 * x) as f32);
                }
            }
        }
    }

    #[test]
    fn octaves_halve_down_to_the_border() {
        let data = vec![7_u8; 41 * 30];
        let params = SiftParams::default();
        let mut space = ScaleSpace::default();
        space.start(
            SimdLevel::Portable,
            &GrayImage::new(41, 30, &data).unwrap(),
            &params,
        );
        let sides: Vec<_> = (0..space.octaves())
            .map(|o| (space.gaussian(o, 0).width(), space.gaussian(o, 0).height()))
            .collect();
        assert_eq!(sides, [(81, 59), (41, 30), (21, 15)]);
    }
}
