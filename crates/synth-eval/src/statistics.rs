//! Means over seeds with their uncertainty, and the band a consistent filter's NEES keeps to.

use estimation_base::chi_square_quantile;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// Resamples of a bootstrap.
const RESAMPLES: usize = 4000;
/// Seed of every bootstrap: the same sample gives the same interval.
const SEED: u64 = 0x6261_6e64;

/// A mean with its 95 % bootstrap interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(crate) struct Interval {
    /// Mean of the sample.
    pub(crate) mean: f64,
    /// 2.5 % quantile of the resampled means.
    pub(crate) low: f64,
    /// 97.5 % quantile.
    pub(crate) high: f64,
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
    Some(Interval {
        mean: sample.iter().sum::<f64>() / count,
        low: quantile(0.025),
        high: quantile(0.975),
    })
}

/// 95 % band of the mean over `seeds` independent runs of one frame's NEES (three degrees of
/// freedom): chi-square quantiles with 3 seeds degrees of freedom over seeds.
///
/// Frames of one run are correlated, so the mean over frames and seeds scatters less than one
/// frame's but more than independent frames would: this band is on the wide side for it.
///
/// # Errors
/// `seeds` is zero.
pub(crate) fn nees_band(seeds: usize) -> anyhow::Result<(f64, f64)> {
    let dof = 3.0 * seeds as f64;
    let at = |p: f64| chi_square_quantile(dof, p).map(|x| x / seeds as f64);
    Ok((at(0.025)?, at(0.975)?))
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

    #[test]
    fn band_of_three_and_of_many_seeds() {
        // Tables of chi-square with 9 degrees of freedom: 2.700 and 19.023.
        let (low, high) = nees_band(3).unwrap();
        assert!((low - 0.9001).abs() < 1e-3 && (high - 6.3409).abs() < 1e-3);
        let (low, high) = nees_band(1000).unwrap();
        let half = 1.96 * (6.0_f64 / 1000.0).sqrt();
        assert!((low - (3.0 - half)).abs() < 0.01 && (high - (3.0 + half)).abs() < 0.01);
        assert!(nees_band(0).is_err());
    }
}
