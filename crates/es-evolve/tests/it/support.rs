//! Generators and statistical checks shared by the tests.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

pub(crate) fn generator(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// One independent generator for each (step, slot).
pub(crate) fn stream(seed: u64) -> impl Fn(usize, usize) -> ChaCha8Rng + Sync {
    move |step, slot| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream((step as u64) << 32 | slot as u64);
        rng
    }
}

/// The sample mean lies within four standard errors of the expected one.
pub(crate) fn check_mean(name: &str, sample: &[f64], expected: f64, variance: f64) {
    let count = sample.len() as f64;
    let mean = sample.iter().sum::<f64>() / count;
    let bound = 4.0 * (variance / count).sqrt();
    assert!(
        (mean - expected).abs() <= bound,
        "{name}: mean {mean}, expected {expected} within {bound}"
    );
}
