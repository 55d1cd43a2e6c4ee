//! Spaces, generators and statistical checks shared by the tests.

use es_evolve::Space;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::{PI, TAU};

pub(crate) struct Line;

impl Space<1> for Line {
    type Genome = f64;
    fn retract(&self, at: &f64, step: &[f64; 1]) -> f64 {
        at + step[0]
    }
    fn local(&self, from: &f64, to: &f64) -> [f64; 1] {
        [to - from]
    }
}

/// Poses (x, y, heading) with the exponential of the planar group.
pub(crate) struct PlanarGroup;

impl Space<3> for PlanarGroup {
    type Genome = [f64; 3];

    fn retract(&self, at: &[f64; 3], step: &[f64; 3]) -> [f64; 3] {
        let (sinc, versine) = arc(step[2]);
        let along = sinc * step[0] - versine * step[1];
        let across = versine * step[0] + sinc * step[1];
        let (sin, cos) = at[2].sin_cos();
        [
            at[0] + cos * along - sin * across,
            at[1] + sin * along + cos * across,
            wrap(at[2] + step[2]),
        ]
    }

    fn local(&self, from: &[f64; 3], to: &[f64; 3]) -> [f64; 3] {
        let (sin, cos) = from[2].sin_cos();
        let (dx, dy) = (to[0] - from[0], to[1] - from[1]);
        let (along, across) = (cos * dx + sin * dy, -sin * dx + cos * dy);
        let turn = wrap(to[2] - from[2]);
        let (sinc, versine) = arc(turn);
        let square = sinc * sinc + versine * versine;
        [
            (sinc * along + versine * across) / square,
            (sinc * across - versine * along) / square,
            turn,
        ]
    }
}

/// sin(a) / a and (1 - cos(a)) / a.
fn arc(angle: f64) -> (f64, f64) {
    if angle.abs() < 1e-4 {
        // The next terms are below 1e-16 and 1e-13.
        (1.0 - angle * angle / 6.0, angle / 2.0)
    } else {
        (angle.sin() / angle, (1.0 - angle.cos()) / angle)
    }
}

pub(crate) fn wrap(angle: f64) -> f64 {
    angle - TAU * ((angle + PI) / TAU).floor()
}

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
