//! Simulated descriptors of a scene, shared by tests, benches and examples.

use feature_kdtree::Descriptor;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Descriptors of a scene that repeats itself: each is one of `clusters` patterns plus variation.
pub(crate) struct Scene {
    rng: ChaCha8Rng,
    centres: Vec<[f64; 128]>,
}

impl Scene {
    pub(crate) fn new(seed: u64, clusters: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let centres = (0..clusters)
            .map(|_| std::array::from_fn(|_| exponential(&mut rng)))
            .collect();
        Self { rng, centres }
    }

    /// A new entry: a pattern mixed with 60 % of its own gradient histogram, as SIFT would quantise it.
    pub(crate) fn entry(&mut self) -> Descriptor {
        let centre = self.rng.random_range(0..self.centres.len());
        let values =
            std::array::from_fn(|i| self.centres[centre][i] + 0.6 * exponential(&mut self.rng));
        quantise(values)
    }

    pub(crate) fn entries(&mut self, count: usize) -> Vec<Descriptor> {
        (0..count).map(|_| self.entry()).collect()
    }

    /// The entry seen again: noise of standard deviation `sigma` in each component.
    pub(crate) fn seen_again(&mut self, entry: &Descriptor, sigma: f64) -> Descriptor {
        std::array::from_fn(|i| {
            // Sum of 12 uniforms: variance one, no second distribution crate needed.
            let normal: f64 = (0..12).map(|_| self.rng.random::<f64>()).sum::<f64>() - 6.0;
            (f64::from(entry[i]) + sigma * normal)
                .round()
                .clamp(0.0, 255.0) as u8
        })
    }

    pub(crate) fn position(&mut self, count: usize) -> usize {
        self.rng.random_range(0..count)
    }
}

/// Gradient histograms are sparse and skewed: exponential components are close.
fn exponential(rng: &mut ChaCha8Rng) -> f64 {
    -(1.0 - rng.random::<f64>()).ln()
}

/// Normalise, clip at 0.2, normalise again, times 512: the last steps of SIFT.
fn quantise(mut values: [f64; 128]) -> Descriptor {
    for _ in 0..2 {
        let norm = values.iter().map(|v| v * v).sum::<f64>().sqrt();
        values = values.map(|v| (v / norm).min(0.2));
    }
    let norm = values.iter().map(|v| v * v).sum::<f64>().sqrt();
    values.map(|v| (512.0 * v / norm).round().min(255.0) as u8)
}
