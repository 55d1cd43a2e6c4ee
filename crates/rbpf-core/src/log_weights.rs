//! Importance weights in log space.
//!
//! A frame with a hundred matches multiplies a hundred densities: a weight of exp(-5000) is
//! ordinary, and underflows as a plain number. All weights are therefore logarithms, normalised by
//!
//! ```text
//! log sum_i exp(l_i) = m + log sum_i exp(l_i - m),   m = max_i l_i
//! ```
//!
//! A normalised weight is (l_i - m) - log sum_i exp(l_i - m), in this order where m is large: beyond
//! 1e16 the sum m + log(...) rounds to m, and every weight of a tie would come out as one. Below
//! 2^17 the sum comes off at once: it rounds by 7e-12 at most, and runs recorded before give the same
//! bits. The effective number
//! of particles (section II.C of the paper), N_eff = 1 / sum w_i^2 for normalised w, comes from the
//! logarithms without normalising them first: log N_eff = 2 lse(l) - lse(2 l). Adding a constant to
//! all l_i changes neither.
//!
//! Degenerate cases: -inf is a legal weight of zero; a set of zeros only, or any NaN or
//! +inf, is an error, because there is no distribution to go on with. Sums run in index order.

use crate::error::RbpfError;

/// log sum_i exp(l_i) in two parts, so that what is small beside the largest is not rounded away.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LogSum {
    /// m, the largest of the l_i; finite.
    largest: f64,
    /// log sum_i exp(l_i - m), between 0 and log n.
    rest: f64,
}

/// Largest magnitude of logarithms that are added as they are: their sums round by 7e-12.
const ORDINARY: f64 = 131_072.0;

impl LogSum {
    fn total(self) -> f64 {
        self.largest + self.rest
    }

    /// The log weight less the sum: beyond the ordinary first the largest, then the rest.
    fn taken_from(self, log_weight: f64) -> f64 {
        if self.largest.abs() <= ORDINARY {
            log_weight - self.total()
        } else {
            (log_weight - self.largest) - self.rest
        }
    }
}

/// Normalises log weights in place, so that their exponentials sum to one, and returns the
/// logarithm of the sum they had before. That is the logarithm of a frame's evidence if the weights
/// were normalised before the increments of the frame were added.
///
/// # Errors
/// [`RbpfError::NoParticles`] for an empty slice, [`RbpfError::DegenerateWeights`] if any weight
/// is NaN or +inf or all are -inf; the slice is then unchanged.
pub(crate) fn normalize(log_weights: &mut [f64]) -> Result<f64, RbpfError> {
    let sum = checked_log_sum(log_weights)?;
    for weight in log_weights {
        *weight = sum.taken_from(*weight);
    }
    Ok(sum.total())
}

/// Adds increments to normalised log weights, normalises them again, and returns the logarithm of the sum
/// between, log sum_i w_i exp(increment_i). Beyond the ordinary the largest increment of a particle that is still there
/// comes off first: a weight of -3 is not lost beside an increment of -1e17, and no sum overflows. The two are of one length.
///
/// # Errors
/// As [`normalize`], for the sums; the weights are then unchanged.
pub(crate) fn reweight(
    log_weights: &mut Vec<f64>,
    log_increments: &[f64],
) -> Result<f64, RbpfError> {
    let shift = log_weights
        .iter()
        .zip(log_increments)
        .filter(|(weight, _)| **weight > f64::NEG_INFINITY)
        .map(|(_, increment)| *increment)
        .fold(f64::NEG_INFINITY, f64::max);
    // an increment of +inf, or none that is left, is told by the sums themselves
    let shift = if shift.is_finite() && shift.abs() > ORDINARY {
        shift
    } else {
        0.0
    };
    let mut sums: Vec<f64> = log_weights
        .iter()
        .zip(log_increments)
        .map(|(weight, increment)| {
            let gone = *weight == f64::NEG_INFINITY && *increment < f64::INFINITY;
            // what is gone stays gone: its increment less the shift may overflow
            if gone {
                *weight
            } else {
                weight + (increment - shift)
            }
        })
        .collect();
    let log_sum = normalize(&mut sums)?;
    *log_weights = sums;
    Ok(shift + log_sum)
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
    let sum = checked_log_sum(log_weights)?;
    Ok(log_weights
        .iter()
        .map(|log_weight| sum.taken_from(*log_weight).exp())
        .collect())
}

fn checked_log_sum(log_weights: &[f64]) -> Result<LogSum, RbpfError> {
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
    let largest = log_weights
        .iter()
        .copied()
        .fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = log_weights
        .iter()
        .map(|weight| (weight - largest).exp())
        .sum();
    Ok(LogSum {
        largest,
        rest: sum.ln(),
    })
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
            let (a, b) = (effective_count(&weights), effective_count(&shifted));
            prop_assert!((a - b).abs() < 1e-10 * a);
            let (mut a, mut b) = (weights, shifted);
            let before = normalize(&mut a).unwrap();
            prop_assert!((normalize(&mut b).unwrap() - before - shift).abs() < 1e-10);
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
