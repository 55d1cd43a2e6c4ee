//! The Gaussian kernels of the pyramid (Lowe, section 3).
//!
//! Blurs add in squares: a level of scale `sigma_i` becomes the next by a blur of `sqrt(sigma_(i+1)^2 - sigma_i^2)`.
//!
//! A Gaussian cut at three standard deviations has 3 % less variance than the whole one. The taps are therefore those of a
//! slightly wider Gaussian whose cut form has the variance asked for. Without this the last level of an octave falls short
//! of the first of the next, and extrema of a scale between the two are found in neither.

use crate::params::SiftParams;

/// The number of rows that a blur makes at a time: each source row is then read once for four output rows.
pub(crate) const BLUR_ROWS: usize = 4;

/// A normalised, symmetric Gaussian kernel.
#[derive(Debug, Clone)]
pub(crate) struct Kernel {
    /// The weights: `half[k]` belongs to the offsets `+k` and `-k`.
    half: Vec<f32>,
    /// All taps in order between [`BLUR_ROWS`]` - 1` zeros on either side.
    padded: Vec<f32>,
}

impl Kernel {
    /// The kernel whose taps up to `radius` have the variance `sigma^2`, or as much of it as they can have.
    pub(crate) fn of_variance(sigma: f32, radius: usize) -> Self {
        let wanted = f64::from(sigma).powi(2);
        // The variance of the cut kernel grows with the standard deviation of its taps.
        let (mut low, mut high) = (sigma, 2.0 * sigma);
        for _ in 0..f32::MANTISSA_DIGITS {
            let middle = 0.5 * (low + high);
            if Self::gaussian(middle, radius).variance() < wanted {
                low = middle;
            } else {
                high = middle;
            }
        }
        Self::gaussian(high, radius)
    }

    /// The weighted sum of the squared offsets.
    fn variance(&self) -> f64 {
        let half = self.half.iter().enumerate();
        half.map(|(k, &weight)| 2.0 * f64::from(weight) * (k * k) as f64)
            .sum()
    }

    /// The Gaussian of standard deviation `sigma` samples, cut after `radius` samples.
    pub(crate) fn gaussian(sigma: f32, radius: usize) -> Self {
        let value =
            |k: usize| (-((k * k) as f64) / (2.0 * f64::from(sigma) * f64::from(sigma))).exp();
        let sum = 1.0 + 2.0 * (1..=radius).map(value).sum::<f64>();
        let half: Vec<f32> = (0..=radius).map(|k| (value(k) / sum) as f32).collect();
        let zeros = [0.0; BLUR_ROWS - 1];
        let mut padded = zeros.to_vec();
        padded.extend(half.iter().rev());
        padded.extend(&half[1..]);
        padded.extend(zeros);
        Self { half, padded }
    }

    /// The number of taps on either side of the centre.
    pub(crate) fn radius(&self) -> usize {
        self.half.len() - 1
    }

    /// The weights: `half()[k]` belongs to the offsets `+k` and `-k`.
    #[inline(always)]
    pub(crate) fn half(&self) -> &[f32] {
        &self.half
    }

    /// The weights of offsets `-radius..=radius` with [`BLUR_ROWS`]` - 1` zeros before and after.
    #[inline(always)]
    pub(crate) fn padded(&self) -> &[f32] {
        &self.padded
    }
}

/// The kernels of one octave: `first` makes level 0 from the image, `steps[i]` makes level `i + 1` from level `i`.
#[derive(Debug, Clone)]
pub(crate) struct Kernels {
    pub(crate) first: Kernel,
    pub(crate) steps: Vec<Kernel>,
}

impl Kernels {
    /// The kernels for parameters that have been checked.
    pub(crate) fn new(params: &SiftParams) -> Self {
        let start = params.camera_sigma / params.octave_step(0);
        let conventions = params.conventions;
        let kernel = |sigma| {
            let radius = conventions.kernel_radius(sigma);
            if conventions.wide_kernels {
                Kernel::gaussian(sigma, radius)
            } else {
                Kernel::of_variance(sigma, radius)
            }
        };
        let first = kernel((params.base_sigma.powi(2) - start.powi(2)).sqrt());
        let steps = (0..params.scales_per_octave + 2)
            .map(|i| {
                let (from, to) = (
                    params.level_sigma(i as f32),
                    params.level_sigma(i as f32 + 1.0),
                );
                kernel((to.powi(2) - from.powi(2)).sqrt())
            })
            .collect();
        Self { first, steps }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_have_unit_mass_and_the_asked_variance() {
        for sigma in [0.8_f32, 1.25, 3.1, 27.0] {
            let k = Kernel::gaussian(sigma, (4.0 * sigma).ceil() as usize);
            let sum = |f: &dyn Fn(usize) -> f64| -> f64 {
                let half = k.half.iter().enumerate();
                half.map(|(i, &w)| f64::from(w) * f(i) * if i == 0 { 1.0 } else { 2.0 })
                    .sum()
            };
            let (mass, variance) = (sum(&|_| 1.0), sum(&|i| (i * i) as f64));
            assert!((mass - 1.0).abs() < 1e-6, "mass {mass}");
            // The tails beyond 4 sigma hold about 1e-3 of the variance.
            assert!(
                (variance / f64::from(sigma * sigma) - 1.0).abs() < 2e-3,
                "variance {variance}"
            );
        }
    }

    #[test]
    fn kernels_cut_early_have_the_asked_variance_too() {
        for sigma in [0.35_f32, 0.8, 1.25, 3.1, 27.0] {
            for radius in [
                (2.5 * sigma).ceil() as usize,
                (3.0 * sigma).round() as usize,
            ] {
                let got = Kernel::of_variance(sigma, radius).variance();
                // Taps are rounded to f32: each by half an epsilon, and their sum of squares is of order sigma^2.
                let tolerance = 4.0 * f64::from(f32::EPSILON);
                assert!(
                    (got / f64::from(sigma).powi(2) - 1.0).abs() < tolerance,
                    "{sigma}, {radius}: {got}"
                );
            }
        }
    }

    #[test]
    fn padded_weights_are_the_mirrored_half() {
        let k = Kernel::gaussian(1.3, 6);
        let taps = &k.padded[BLUR_ROWS - 1..k.padded.len() - (BLUR_ROWS - 1)];
        assert_eq!(taps.len(), 2 * k.radius() + 1);
        for (i, tap) in taps.iter().enumerate() {
            assert_eq!(*tap, k.half[i.abs_diff(k.radius())]);
        }
        assert_eq!(k.padded[..BLUR_ROWS - 1], [0.0; BLUR_ROWS - 1]);
        assert_eq!(k.padded.len(), taps.len() + 2 * (BLUR_ROWS - 1));
    }
}
