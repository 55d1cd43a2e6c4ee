//! Importance weights in log space.
//!
//! A frame with a hundred matches multiplies a hundred densities: a weight of exp(-5000) is
//! ordinary, and underflows as a plain number. All weights are therefore logarithms, normalised by
//!
//! ```text
//! log sum_i exp(l_i) = m + log sum_i exp(l_i - m),   m = max_i l_i
//! ```
//!
//! and the effective number of particles (section II.C of the paper), N_eff = 1 / sum w_i^2 for
//! normalised w, comes from the logarithms without normalising them first:
//! log N_eff = 2 lse(l) - lse(2 l). Adding a constant to all l_i changes neither.
//!
//! Degenerate cases: -inf is a legal weight of zero; a set of zeros only, or any NaN or
//! +inf, is an error, because there is no distribution to go on with. Sums run in index order.

use crate::error::RbpfError;

/// Logarithm of the sum of exponentials: -inf for an empty slice or for zeros only, NaN if any entry is
/// NaN. O(n), exact to a few units in the last place times log n.
pub(crate) fn log_sum_exp(log_values: &[f64]) -> f64 {
    let mut largest = f64::NEG_INFINITY;
    for &value in log_values {
        if value.is_nan() {
            return f64::NAN;
        }
        largest = largest.max(value);
    }
    if largest.is_infinite() {
        return largest;
    }
    let sum: f64 = log_values.iter().map(|value| (value - largest).exp()).sum();
    largest + sum.ln()
}

/// Normalises log weights in place, so that their exponentials sum to one, and returns the
/// logarithm of the sum they had before. That is the logarithm of a frame's evidence if the weights
/// were normalised before the increments of the frame were added.
///
/// # Errors
/// [`RbpfError::NoParticles`] for an empty slice, [`RbpfError::DegenerateWeights`] if any weight
/// is NaN or +inf or all are -inf; the slice is then unchanged.
pub(crate) fn normalize(log_weights: &mut [f64]) -> Result<f64, RbpfError> {
    let log_evidence = checked_log_sum(log_weights)?;
    for weight in log_weights {
        *weight -= log_evidence;
    }
    Ok(log_evidence)
}

/// Effective number of particles, 1 / sum w_i^2, between 1 and n. The log weights need not be
/// normalised. The result is 0 if no weight is positive, and NaN if one is NaN.
pub(crate) fn effective_count(log_weights: &[f64]) -> f64 {
    let largest = log_weights
        .iter()
        .copied()
        .fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        // max skips NaN, so a slice of NaN and -inf ends here as well
        let any_nan = log_weights.iter().any(|weight| weight.is_nan());
        return if any_nan { f64::NAN } else { 0.0 };
    }
    let (mut sum, mut sum_of_squares) = (0.0, 0.0);
    for &log_weight in log_weights {
        let weight = (log_weight - largest).exp();
        sum += weight;
        sum_of_squares += weight * weight;
    }
    sum * sum / sum_of_squares
}

/// The normalised weights as plain numbers, summing to one up to rounding.
///
/// # Errors
/// As [`normalize`].
pub(crate) fn linear_weights(log_weights: &[f64]) -> Result<Vec<f64>, RbpfError> {
    let log_sum = checked_log_sum(log_weights)?;
    Ok(log_weights
        .iter()
        .map(|log_weight| (log_weight - log_sum).exp())
        .collect())
}

fn checked_log_sum(log_weights: &[f64]) -> Result<f64, RbpfError> {
    if log_weights.is_empty() {
        return Err(RbpfError::NoParticles);
    }
    let (mut zero, mut nan, mut infinite) = (0, 0, 0);
    for &weight in log_weights {
        if weight.is_nan() {
            nan += 1;
        } else if weight == f64::NEG_INFINITY {
            zero += 1;
        } else if weight == f64::INFINITY {
            infinite += 1;
        }
    }
    let particles = log_weights.len();
    if nan > 0 || infinite > 0 || zero == particles {
        return Err(RbpfError::DegenerateWeights {
            particles,
            zero,
            nan,
            infinite,
        });
    }
    Ok(log_sum_exp(log_weights))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn no_files() -> ProptestConfig {
        ProptestConfig {
            failure_persistence: None,
            ..ProptestConfig::default()
        }
    }

    #[test]
    fn far_below_underflow() {
        let mut weights = [-50_000.0, -50_000.0 + 3.0_f64.ln()];
        let evidence = normalize(&mut weights).unwrap();
        assert!((evidence - (-50_000.0 + 4.0_f64.ln())).abs() < 1e-10);
        assert!((weights[0].exp() - 0.25).abs() < 1e-10);
        assert!((effective_count(&[-50_000.0, -50_000.0]) - 2.0).abs() < 1e-12);
    }

    #[test]
    fn zeros_are_legal_unless_alone() {
        let mut weights = [f64::NEG_INFINITY, -3.0];
        assert!((normalize(&mut weights).unwrap() + 3.0).abs() < 1e-15);
        assert_eq!(weights, [f64::NEG_INFINITY, 0.0]);
        assert_eq!(effective_count(&weights), 1.0);
        assert_eq!(effective_count(&[f64::NEG_INFINITY; 3]), 0.0);
        assert_eq!(log_sum_exp(&[]), f64::NEG_INFINITY);
    }

    #[test]
    fn degenerate_weights_are_counted_and_left_alone() {
        let mut weights = [f64::NEG_INFINITY; 4];
        assert_eq!(
            normalize(&mut weights),
            Err(RbpfError::DegenerateWeights {
                particles: 4,
                zero: 4,
                nan: 0,
                infinite: 0
            })
        );
        let mut weights = [1.0, f64::NAN, f64::INFINITY];
        assert_eq!(
            normalize(&mut weights),
            Err(RbpfError::DegenerateWeights {
                particles: 3,
                zero: 0,
                nan: 1,
                infinite: 1
            })
        );
        assert_eq!(weights[0], 1.0);
        assert_eq!(normalize(&mut []), Err(RbpfError::NoParticles));
        assert!(effective_count(&[0.0, f64::NAN]).is_nan());
        assert!(effective_count(&[f64::NAN, f64::NEG_INFINITY]).is_nan());
        assert!(log_sum_exp(&[f64::NAN, f64::INFINITY]).is_nan());
    }

    proptest! {
        #![proptest_config(no_files())]
        #[test]
        fn a_constant_changes_nothing(
            weights in prop::collection::vec(-30.0..30.0_f64, 1..40),
            shift in -1e4..1e4_f64,
        ) {
            let shifted: Vec<f64> = weights.iter().map(|w| w + shift).collect();
            // the shift itself rounds each weight by eps * 1e4
            prop_assert!((log_sum_exp(&shifted) - log_sum_exp(&weights) - shift).abs() < 1e-10);
            let (a, b) = (effective_count(&weights), effective_count(&shifted));
            prop_assert!((a - b).abs() < 1e-10 * a);
            let (mut a, mut b) = (weights, shifted);
            normalize(&mut a).unwrap();
            normalize(&mut b).unwrap();
            for (a, b) in a.iter().zip(&b) {
                prop_assert!((a - b).abs() < 1e-10);
            }
        }

        #[test]
        fn effective_count_is_one_over_the_sum_of_squares(
            plain in prop::collection::vec(1e-3..1.0_f64, 1..40),
        ) {
            let total: f64 = plain.iter().sum();
            let direct = 1.0 / plain.iter().map(|w| (w / total).powi(2)).sum::<f64>();
            let logs: Vec<f64> = plain.iter().map(|w| w.ln()).collect();
            let counted = effective_count(&logs);
            prop_assert!((counted - direct).abs() < 1e-12 * direct);
            prop_assert!(counted > 1.0 - 1e-12 && counted < plain.len() as f64 * (1.0 + 1e-12));
            let sum: f64 = linear_weights(&logs).unwrap().iter().sum();
            prop_assert!((sum - 1.0).abs() < 1e-13);
        }
    }
}
