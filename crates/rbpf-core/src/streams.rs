//! Counter-based random streams: one independent generator per (seed, frame, particle, purpose).
//!
//! A filter that draws all its numbers from one generator changes its results with the order of
//! evaluation. Here nothing is shared: the 256-bit key of a `ChaCha8` generator *is* the tuple of
//! counters, four little-endian 64-bit words
//!
//! ```text
//! key = seed | frame | particle | purpose
//! ```
//!
//! The packing is injective, so distinct tuples always have distinct keys, and `ChaCha` under
//! distinct keys gives unrelated streams of 2^70 bytes. A stream costs 32 bytes of packing and one
//! block of eight rounds at the first draw. It needs no state between frames, so a run that is resumed
//! at frame t continues with the same numbers.
//!
//! Not for cryptography: eight rounds and keys that anyone can guess.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The purpose of a stream. Its number is part of the key and never changes its meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u64)]
#[non_exhaustive]
pub enum Purpose {
    /// Drawing the pose of a particle; one stream per frame and particle.
    Proposal = 1,
    /// Choosing ancestors; one stream per frame, particle [`Streams::SHARED`].
    Resampling = 2,
    /// Mutation, crossover and acceptance of an evolution step.
    Evolution = 3,
    /// The first particle set.
    Initialisation = 4,
    /// Starting, accepting and dropping landmarks.
    MapManagement = 5,
    /// Robust estimation by random samples.
    Consensus = 6,
    /// Rendering or drawing a synthetic scene.
    Scene = 7,
    /// Noise of simulated odometry.
    OdometryNoise = 8,
    /// Noise of simulated measurements.
    MeasurementNoise = 9,
    /// Choosing the particles that a set is thinned to.
    Thinning = 10,
}

/// The family of random streams of one seed: a generator for every (frame, particle, purpose).
///
/// ```
/// use rbpf_core::rand::RngExt;
/// use rbpf_core::{Purpose, Streams};
///
/// let draw = |particle| {
///     let mut rng = Streams::new(3).stream(10, particle, Purpose::Proposal);
///     rng.random::<u64>()
/// };
/// assert_eq!(draw(4), draw(4)); // whenever and on whichever thread it is asked
/// assert_ne!(draw(4), draw(5));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Streams {
    seed: u64,
}

impl Streams {
    /// The particle number of draws made once for the whole set.
    pub const SHARED: u64 = u64::MAX;

    /// The streams of `seed`.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self { seed }
    }

    /// The seed given at construction, for the record of a run.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.seed
    }

    /// The generator of (frame, particle, purpose), at its beginning. O(1).
    #[must_use]
    pub fn stream(&self, frame: u64, particle: u64, purpose: Purpose) -> ChaCha8Rng {
        let mut key = [0_u8; 32];
        key[0..8].copy_from_slice(&self.seed.to_le_bytes());
        key[8..16].copy_from_slice(&frame.to_le_bytes());
        key[16..24].copy_from_slice(&particle.to_le_bytes());
        key[24..32].copy_from_slice(&(purpose as u64).to_le_bytes());
        ChaCha8Rng::from_seed(key)
    }

    /// The generator of draws that are made once per frame for all particles.
    #[must_use]
    pub fn shared(&self, frame: u64, purpose: Purpose) -> ChaCha8Rng {
        self.stream(frame, Self::SHARED, purpose)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, RngExt};
    use std::collections::BTreeSet;

    #[test]
    fn first_draws_are_the_recorded_ones() {
        let streams = Streams::new(2006);
        let mut rng = streams.stream(7, 3, Purpose::Proposal);
        assert_eq!(rng.next_u64(), GOLDEN_WORDS[0]);
        assert_eq!(rng.next_u64(), GOLDEN_WORDS[1]);
        let uniform: f64 = streams.shared(7, Purpose::Resampling).random();
        assert_eq!(uniform.to_bits(), GOLDEN_UNIFORM_BITS);
        let normal: f64 = streams
            .stream(0, 0, Purpose::Evolution)
            .sample(rand_distr::StandardNormal);
        assert_eq!(normal.to_bits(), GOLDEN_NORMAL_BITS);
    }

    // words and uniform computed by an independent implementation of ChaCha with eight rounds
    const GOLDEN_WORDS: [u64; 2] = [2_287_722_149_145_785_077, 17_893_622_208_988_472_719];
    const GOLDEN_UNIFORM_BITS: u64 = 4_606_985_490_182_159_956;
    const GOLDEN_NORMAL_BITS: u64 = 4_599_454_181_270_231_459;

    #[test]
    fn every_part_of_the_key_changes_the_stream() {
        let mut firsts = BTreeSet::new();
        let mut count = 0;
        for seed in [0, 1, u64::MAX] {
            for frame in [0, 1, 256] {
                for particle in [0, 1, 255, 256, Streams::SHARED] {
                    for purpose in [Purpose::Proposal, Purpose::Resampling, Purpose::Scene] {
                        let mut rng = Streams::new(seed).stream(frame, particle, purpose);
                        firsts.insert(rng.next_u64());
                        count += 1;
                    }
                }
            }
        }
        assert_eq!(firsts.len(), count);
    }

    /// The mean of n uniforms has standard deviation 1/sqrt(12 n); neighbouring keys must not
    /// be correlated: the mean product of centred first draws has deviation 1/(12 sqrt n).
    #[test]
    fn neighbouring_streams_are_uniform_and_uncorrelated() {
        let streams = Streams::new(1);
        let draws: Vec<f64> = (0..4000)
            .map(|particle| {
                streams
                    .stream(0, particle, Purpose::Proposal)
                    .random::<f64>()
                    - 0.5
            })
            .collect();
        let n = draws.len() as f64;
        let mean = draws.iter().sum::<f64>() / n;
        assert!(mean.abs() < 4.5 / (12.0 * n).sqrt(), "mean {mean}");
        let lagged = draws.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / (n - 1.0);
        assert!(
            lagged.abs() < 4.5 / (12.0 * n.sqrt()),
            "covariance {lagged}"
        );
    }
}
