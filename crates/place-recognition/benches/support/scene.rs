//! Simulated descriptors: patterns that repeat, with variation, quantised as SIFT does.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::world::normal;

/// Patterns of which every descriptor is a variation.
pub(crate) struct Patterns(Vec<[f64; 128]>);

impl Patterns {
    pub(crate) fn new(rng: &mut ChaCha8Rng, count: usize) -> Self {
        let pattern = |_| std::array::from_fn(|_| exponential(rng));
        Self((0..count).map(pattern).collect())
    }

    /// A pattern mixed with 60 % of a gradient histogram of its own.
    pub(crate) fn descriptor(&self, rng: &mut ChaCha8Rng) -> [u8; 128] {
        let pattern = &self.0[rng.random_range(0..self.0.len())];
        quantise(std::array::from_fn(|i| pattern[i] + 0.6 * exponential(rng)))
    }
}

/// The descriptor seen again with noise of 10 a component.
pub(crate) fn seen_again(rng: &mut ChaCha8Rng, descriptor: &[u8; 128]) -> [u8; 128] {
    descriptor.map(|v| {
        (f64::from(v) + 10.0 * normal(rng))
            .round()
            .clamp(0.0, 255.0) as u8
    })
}

/// Gradient histograms are sparse and skewed: exponential components are close.
fn exponential(rng: &mut ChaCha8Rng) -> f64 {
    -(1.0 - rng.random::<f64>()).ln()
}

/// Normalise, clip at 0.2, normalise again, times 512: the last steps of SIFT.
fn quantise(mut values: [f64; 128]) -> [u8; 128] {
    let norm = |values: &[f64; 128]| values.iter().map(|v| v * v).sum::<f64>().sqrt();
    for _ in 0..2 {
        let length = norm(&values);
        values = values.map(|v| (v / length).min(0.2));
    }
    let length = norm(&values);
    values.map(|v| (512.0 * v / length).round().min(255.0) as u8)
}
