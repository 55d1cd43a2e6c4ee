//! Weighted means and covariances of states with headings.
//!
//! The arithmetic mean of the angles pi - 0.1 and -pi + 0.1 is 0, the opposite of the truth. The
//! reference-point mean is taken in the tangent at one of the samples,
//!
//! ```text
//! mean = wrap(ref + sum_i w_i wrap(x_i - ref)),   sum w_i = 1
//! ```
//!
//! and does not depend on the choice of the reference while all samples lie within half a turn of it.
//! The reference here is the sample of the largest weight, the first of several. Samples spread over the
//! whole circle have no meaningful mean; their covariance shows it.

use crate::models::Gaussian;
use estimation_base::wrap;
use nalgebra::{SMatrix, SVector};

/// Weighted mean and covariance of states, such as the poses of a particle set.
///
/// The entries listed in `angular` are angles in radians; those of the mean lie in (-pi, pi]. `weights`
/// sum to one and run over the same samples (the shorter slice decides). The covariance is
/// sum w d d^T about the mean, without small-sample correction. `None` without samples. O(n D^2), summed
/// in sample order.
#[must_use]
pub fn weighted_moments<const D: usize>(
    states: &[SVector<f64, D>],
    weights: &[f64],
    angular: &[usize],
) -> Option<Gaussian<D>> {
    let reference = states[heaviest(weights, states.len())?];
    let difference = |to: &SVector<f64, D>, from: &SVector<f64, D>| {
        let mut delta = to - from;
        for &index in angular.iter().filter(|&&index| index < D) {
            delta[index] = wrap(delta[index]);
        }
        delta
    };
    let mut offset = SVector::<f64, D>::zeros();
    for (state, weight) in states.iter().zip(weights) {
        offset += difference(state, &reference) * *weight;
    }
    let mut mean = reference + offset;
    for &index in angular.iter().filter(|&&index| index < D) {
        mean[index] = wrap(mean[index]);
    }
    let mut covariance = SMatrix::<f64, D, D>::zeros();
    for (state, weight) in states.iter().zip(weights) {
        let delta = difference(state, &mean);
        covariance += delta * delta.transpose() * *weight;
    }
    Some(Gaussian { mean, covariance })
}

/// Index of the largest weight, the first of several.
fn heaviest(weights: &[f64], samples: usize) -> Option<usize> {
    let count = samples.min(weights.len());
    let mut best = None;
    for index in 0..count {
        if best.is_none_or(|held: usize| weights[index] > weights[held]) {
            best = Some(index);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Vector1, Vector3};
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn circular_mean(angles: &[f64], weights: &[f64]) -> Option<f64> {
        let states: Vec<_> = angles.iter().map(|angle| Vector1::new(*angle)).collect();
        weighted_moments(&states, weights, &[0]).map(|moments| moments.mean[0])
    }

    #[test]
    fn mean_across_the_cut_is_not_the_arithmetic_one() {
        let mean = circular_mean(&[PI - 0.1, -PI + 0.3], &[0.5, 0.5]).unwrap();
        assert!((mean - (-PI + 0.1)).abs() < 1e-14, "{mean}");
        assert_eq!(circular_mean(&[], &[]), None);
    }

    #[test]
    fn moments_of_two_poses() {
        let states = [
            Vector3::new(0.0, 1.0, PI - 0.1),
            Vector3::new(2.0, 1.0, -PI + 0.1),
        ];
        let moments = weighted_moments(&states, &[0.5, 0.5], &[2]).unwrap();
        assert!((moments.mean[0] - 1.0).abs() < 1e-15);
        assert!((moments.mean[2].abs() - PI).abs() < 1e-14);
        assert!((moments.covariance[(0, 0)] - 1.0).abs() < 1e-14);
        assert!((moments.covariance[(2, 2)] - 0.01).abs() < 1e-14);
        assert!((moments.covariance[(0, 2)] - 0.1).abs() < 1e-14);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn turning_all_samples_turns_the_mean(
            angles in prop::collection::vec(-1.0..1.0_f64, 1..20),
            turn in -10.0..10.0_f64,
        ) {
            let weights = vec![1.0 / angles.len() as f64; angles.len()];
            let turned: Vec<f64> = angles.iter().map(|a| wrap(a + turn)).collect();
            let mean = circular_mean(&angles, &weights).unwrap();
            let expected = angles.iter().sum::<f64>() / angles.len() as f64;
            prop_assert!((mean - expected).abs() < 1e-13);
            let after = circular_mean(&turned, &weights).unwrap();
            prop_assert!(wrap(after - mean - turn).abs() < 1e-13);
        }
    }
}
