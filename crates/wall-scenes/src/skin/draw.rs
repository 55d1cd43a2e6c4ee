//! Random drawing material: draws between bounds, smooth noise, letters.
//!
//! Descriptor matching throws away what looks alike, so nothing here repeats:
//! a letter is a random walk of strokes over a 3x4 grid of nodes, and noise is keyed by a
//! seed of its own at each use.

use super::canvas::{Canvas, TEXEL_M};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// A number drawn evenly between two bounds.
pub(crate) fn between(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

/// True with the given probability.
pub(crate) fn chance(rng: &mut ChaCha8Rng, probability: f64) -> bool {
    rng.random::<f64>() < probability
}

/// A whole number in `0..count`.
pub(crate) fn pick(rng: &mut ChaCha8Rng, count: usize) -> usize {
    ((rng.random::<f64>() * count as f64) as usize).min(count - 1)
}

/// A tone clearly different from `ground`.
pub(super) fn ink_on(rng: &mut ChaCha8Rng, ground: f64) -> f64 {
    if ground > 0.5 {
        between(rng, 0.03, ground - 0.35)
    } else {
        between(rng, ground + 0.35, 0.95)
    }
}

/// Smooth noise over the plane: value noise on a unit lattice, in -1..1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Noise {
    key: u64,
}

impl Noise {
    pub(super) fn new(rng: &mut ChaCha8Rng) -> Self {
        Self { key: rng.random() }
    }

    /// One octave; features are about one unit wide.
    pub(super) fn at(self, x: f64, y: f64) -> f64 {
        let (cell_x, cell_y) = (x.floor(), y.floor());
        let ease = |t: f64| t * t * (3.0 - 2.0 * t);
        let (ax, ay) = (ease(x - cell_x), ease(y - cell_y));
        let (ix, iy) = (cell_x as i64, cell_y as i64);
        let top = self.node(ix, iy) * (1.0 - ax) + self.node(ix + 1, iy) * ax;
        let bottom = self.node(ix, iy + 1) * (1.0 - ax) + self.node(ix + 1, iy + 1) * ax;
        top * (1.0 - ay) + bottom * ay
    }

    /// Sum of octaves, each twice as fine and `gain` as strong.
    pub(super) fn octaves(self, x: f64, y: f64, count: usize, gain: f64) -> f64 {
        let (mut sum, mut strength, mut scale) = (0.0, 1.0, 1.0);
        for octave in 0..count {
            let shift = octave as f64 * 17.3;
            sum += strength * self.at(x * scale + shift, y * scale - shift);
            strength *= gain;
            scale *= 2.0;
        }
        sum
    }

    /// A hash of the lattice node in -1..1 (the mixing steps of splitmix64).
    pub(super) fn node(self, x: i64, y: i64) -> f64 {
        let mut bits = self
            .key
            .wrapping_add((x as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15))
            .wrapping_add((y as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F));
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^= bits >> 31;
        (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// A made-up letter in the box with corner (x, y), width `w`, height `h`.
pub(super) fn letter(
    canvas: &mut Canvas,
    rng: &mut ChaCha8Rng,
    [x, y]: [f64; 2],
    w: f64,
    h: f64,
    tone: f64,
) {
    let thickness = h * between(rng, 0.12, 0.2);
    let node = |index: usize| {
        [
            x + (index % 3) as f64 / 2.0 * (w - thickness) + thickness / 2.0,
            y + (index / 3) as f64 / 3.0 * (h - thickness) + thickness / 2.0,
        ]
    };
    let mut at = pick(rng, 12);
    for _ in 0..3 + pick(rng, 3) {
        let next = pick(rng, 12);
        canvas.stroke(node(at), node(next), thickness, tone);
        at = if chance(rng, 0.25) {
            pick(rng, 12)
        } else {
            next
        };
    }
    if chance(rng, 0.2) {
        canvas.ring(x + w / 2.0, y + h / 2.0, w * 0.28, w * 0.45, tone);
    }
}

/// Lines of letters that fill a rectangle, with gaps between words; nothing when a
/// letter would be under a texel.
pub(super) fn text(
    canvas: &mut Canvas,
    rng: &mut ChaCha8Rng,
    [x0, y0, x1, y1]: [f64; 4],
    height: f64,
    tone: f64,
) {
    if height < TEXEL_M {
        return;
    }
    let mut y = y0;
    while y + height <= y1 {
        let mut x = x0;
        let line_end = x0 + (x1 - x0) * between(rng, 0.55, 1.0);
        while x + 0.7 * height <= line_end {
            let w = height * between(rng, 0.45, 0.75);
            if !chance(rng, 0.16) {
                letter(canvas, rng, [x, y], w, height, tone);
            }
            x += w + height * 0.18;
        }
        y += height * between(rng, 1.35, 1.6);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn noise_is_bounded_centred_and_continuous() {
        let noise = Noise::new(&mut ChaCha8Rng::seed_from_u64(9));
        let mut sum = 0.0;
        for k in 0..4000_i32 {
            let (x, y) = (f64::from(k) * 0.37, f64::from(k) * 0.11);
            let value = noise.at(x, y);
            assert!(value.abs() <= 1.0);
            assert!((noise.at(x + 1e-6, y) - value).abs() < 1e-4);
            sum += value;
        }
        assert!((sum / 4000.0).abs() < 0.05);
    }

    #[test]
    fn ink_differs_from_its_ground() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        for k in 0..100 {
            let ground = f64::from(k) / 100.0;
            let ink = ink_on(&mut rng, ground);
            assert!((ink - ground).abs() >= 0.1 && (0.0..=1.0).contains(&ink));
        }
    }
}
