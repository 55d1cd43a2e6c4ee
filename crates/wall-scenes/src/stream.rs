//! Random streams by key: one for each seed, purpose and index.
//!
//! No stream is shared, so neither threads nor the order of work can change a pixel.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The purpose of a random stream; part of its key.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Purpose {
    Layout = 1,
    Skin = 2,
    Light = 3,
    Path = 4,
    Odometry = 5,
    Exposure = 6,
    Sensor = 7,
    Slip = 8,
    Sway = 9,
    Poster = 10,
}

/// The stream of one (seed, purpose, index).
pub(crate) fn stream(seed: u64, purpose: Purpose, index: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream((purpose as u64) << 48 | index);
    rng
}
