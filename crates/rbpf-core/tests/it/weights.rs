//! Weights are carried from frame to frame.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rbpf_core::{
    FilterConfig, NoMapUpdate, NoRejuvenation, ParticleFilter, ParticleSet, Proposal, Streams,
};
use std::convert::Infallible;

/// A random walk of unit variance, measured with variance 1/2.
struct Walk;

impl Proposal<f64, f64> for Walk {
    type Error = Infallible;

    fn propose(&self, x: &mut f64, z: &f64, rng: &mut ChaCha8Rng) -> Result<f64, Infallible> {
        *x += rng.sample::<f64, _>(StandardNormal);
        Ok(-(z - *x).powi(2))
    }
}

/// Two frames without resampling: the carried weights give the posterior of the pose under both;
/// forgetting the first gives another, many standard errors away. Unit walk from N(0, 1), measured
/// with variance r at -1.5 and then at 2, seen from a prior that is sampled.
#[test]
fn dropping_the_previous_weight_fails() {
    let (measurements, r) = ([-1.5, 2.0], 0.5);
    let (mut mean, mut variance) = (0.0, 0.0);
    for z in measurements {
        variance += 1.0;
        let gain = variance / (variance + r);
        mean += gain * (z - mean);
        variance -= gain * variance;
    }
    let estimate = |seed, shift: f64, forget: bool| {
        let set = ParticleSet::from_parts(vec![0.0; 400], vec![shift; 400], (0..400).collect())
            .expect("valid set");
        let config = FilterConfig {
            resampling_threshold: 0.0,
            ..FilterConfig::default()
        };
        let mut filter = ParticleFilter::new(set, Streams::new(seed), config).expect("valid");
        for (frame, z) in (0..).zip(measurements) {
            if forget {
                let particles = filter.set().particles().to_vec();
                let set = ParticleSet::new(particles).expect("valid set");
                filter = ParticleFilter::new(set, Streams::new(seed), config).expect("valid");
            }
            filter
                .step(frame, &z, &Walk, &NoRejuvenation, &NoMapUpdate)
                .expect("valid step");
        }
        filter.set().weighted_mean(|x| *x).expect("normalised")
    };
    let over_seeds = |forget| {
        let values: Vec<f64> = (0..100).map(|seed| estimate(seed, 0.0, forget)).collect();
        let n = values.len() as f64;
        let average = values.iter().sum::<f64>() / n;
        let spread = values.iter().map(|v| (v - average).powi(2)).sum::<f64>() / (n - 1.0);
        (average, (spread / n).sqrt())
    };
    // the bias of a ratio of sums over 400 particles is about the variance over 400, inside the error
    let (carried, error) = over_seeds(false);
    assert!(
        (carried - mean).abs() < 4.5 * error,
        "{carried} {mean} {error}"
    );
    let (forgotten, error) = over_seeds(true);
    assert!(
        (forgotten - mean).abs() > 20.0 * error,
        "{forgotten} {mean} {error}"
    );
    // a constant on all log weights: eps * 1e4 on each, over weights that sum to one
    for shift in [-1e4, 1e4] {
        assert!((estimate(1, shift, false) - estimate(1, 0.0, false)).abs() < 1e-10);
    }
}
