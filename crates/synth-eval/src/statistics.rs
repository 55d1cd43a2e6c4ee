//! Means over seeds with their uncertainty.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Resamples of a bootstrap.
const RESAMPLES: usize = 4000;
/// Seed of every bootstrap: the same sample gives the same interval.
const SEED: u64 = 0x6261_6e64;

/// A mean with its 95 % bootstrap interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Interval {
    /// Mean of the sample.
    pub(crate) mean: f64,
    /// 2.5 % quantile of the resampled means.
    pub(crate) low: f64,
    /// 97.5 % quantile.
    pub(crate) high: f64,
    /// Standard deviation of the sample: how far one seed is from another.
    pub(crate) spread: f64,
}

/// Percentile bootstrap of the mean: resample with replacement, take the quantiles of the
/// means. `None` for an empty sample. With three values the interval can hardly be narrower
/// than their range: read it as that.
pub(crate) fn bootstrap_mean(sample: &[f64]) -> Option<Interval> {
    if sample.is_empty() {
        return None;
    }
    let count = sample.len() as f64;
    let mut rng = ChaCha8Rng::seed_from_u64(SEED);
    let mut means: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let draw = || sample[rng.random_range(0..sample.len())];
            std::iter::repeat_with(draw).take(sample.len()).sum::<f64>() / count
        })
        .collect();
    means.sort_by(f64::total_cmp);
    let quantile = |p: f64| means[(p * (RESAMPLES - 1) as f64).round() as usize];
    let mean = sample.iter().sum::<f64>() / count;
    let square: f64 = sample.iter().map(|value| (value - mean).powi(2)).sum();
    Some(Interval {
        mean,
        spread: (square / (count - 1.0).max(1.0)).sqrt(),
        low: quantile(0.025),
        high: quantile(0.975),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bootstrap_of_a_known_sample() {
        assert_eq!(bootstrap_mean(&[]), None);
        let constant = bootstrap_mean(&[2.5; 7]).unwrap();
        assert_eq!(
            (constant.mean, constant.low, constant.high),
            (2.5, 2.5, 2.5)
        );

        // 0 .. 99: the mean's standard error is sqrt((100^2 - 1) / 12 / 100) = 2.887.
        let sample: Vec<f64> = (0..100).map(f64::from).collect();
        let interval = bootstrap_mean(&sample).unwrap();
        assert_eq!(interval.mean, 49.5);
        assert!((interval.spread - 29.0115).abs() < 1e-4);
        let half = 1.96 * 2.8866;
        // A 2.5 % quantile of 4000 means is known to 0.04 standard errors; allow four times that.
        assert!((interval.low - (49.5 - half)).abs() < 0.5, "{interval:?}");
        assert!((interval.high - (49.5 + half)).abs() < 0.5, "{interval:?}");
        assert_eq!(bootstrap_mean(&sample), Some(interval));
    }

    #[test]
    fn three_values_span_their_range() {
        // All three draws are the smallest one with probability 1/27 > 2.5 %.
        let interval = bootstrap_mean(&[1.0, 2.0, 6.0]).unwrap();
        assert_eq!(
            (interval.low, interval.mean, interval.high),
            (1.0, 3.0, 6.0)
        );
    }
}
