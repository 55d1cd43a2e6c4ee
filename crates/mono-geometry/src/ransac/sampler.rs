//! Which data to try next, and when enough has been tried.
//!
//! With uniform samples of m out of N data of which I are good, a trial draws only good ones with probability
//! P = C(I, m) / C(N, m); after k = ln(1 - c) / ln(1 - P) trials one of them did with confidence c. Degenerate: I < m
//! gives no bound (infinite), I = N gives zero.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Draws samples.
pub trait Sampler {
    /// Prepares for a run on `data` data with samples of `sample_size`; 1 <= `sample_size` <= `data`.
    fn start(&mut self, data: usize, sample_size: usize);

    /// Fills `sample` with different indices below the number of data.
    fn draw(&mut self, rng: &mut ChaCha8Rng, sample: &mut [usize]);

    /// Number of trials after which the run may stop, given which data the best model has as inliers (may be infinite).
    fn trials_needed(&mut self, inliers: &[bool], sample_size: usize, confidence: f64) -> f64;
}

/// Every sample is equally probable.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Uniform {
    data: usize,
}

impl Sampler for Uniform {
    fn start(&mut self, data: usize, _sample_size: usize) {
        self.data = data;
    }

    fn draw(&mut self, rng: &mut ChaCha8Rng, sample: &mut [usize]) {
        draw_distinct(rng, self.data, sample);
    }

    fn trials_needed(&mut self, inliers: &[bool], sample_size: usize, confidence: f64) -> f64 {
        let good = inliers.iter().filter(|inlier| **inlier).count();
        uniform_trials_needed(good, inliers.len(), sample_size, confidence)
    }
}

/// Number of uniform samples after which one of them holds inliers only with probability `confidence`. O(sample size).
#[must_use]
pub fn uniform_trials_needed(
    inliers: usize,
    data: usize,
    sample_size: usize,
    confidence: f64,
) -> f64 {
    if inliers < sample_size {
        return f64::INFINITY;
    }
    let all_good: f64 = (0..sample_size)
        .map(|i| (inliers - i) as f64 / (data - i) as f64)
        .product();
    if all_good >= 1.0 {
        return 0.0;
    }
    // The quotient is -0.0 or NaN only for confidences outside (0, 1), which the driver clamps.
    (-confidence).ln_1p() / (-all_good).ln_1p()
}

/// Different indices below `end`, every set equally probable (Floyd's algorithm); at most `end` of them. O(m^2).
pub(super) fn draw_distinct(rng: &mut ChaCha8Rng, end: usize, sample: &mut [usize]) {
    let size = sample.len();
    for k in 0..size {
        let last = end - size + k;
        let candidate = rng.random_range(0..=last);
        sample[k] = if sample[..k].contains(&candidate) {
            last
        } else {
            candidate
        };
    }
}
