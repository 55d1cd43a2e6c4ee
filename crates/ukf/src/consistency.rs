//! Does the error of a filter match the covariance it reports?
//!
//! For a consistent filter the normalised innovation squared (NIS) of an M-dimensional measurement
//! is chi-square of M degrees of freedom, and the normalised estimation error squared (NEES) of an
//! L-dimensional state of L (Bar-Shalom, Li and Kirubarajan 2001, section 5.4). The sum of n
//! independent ones has n M (n L) degrees, so the mean lies with probability p between
//!
//! ```text
//! chi2_{n M}((1 - p)/2) / n   and   chi2_{n M}((1 + p)/2) / n
//! ```
//!
//! Below: the covariance is larger than the error (underconfident); above: smaller (overconfident).
//! Values of successive frames of one run are correlated for NEES; average over runs.

use estimation_base::{Real, chi_square_quantile};
use nalgebra::{SMatrix, SVector};

use crate::covariance::{definite, finite};
use crate::error::{Step, UkfError};

/// The verdict of the mean NIS or NEES on a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Verdict {
    /// Errors smaller than the covariance says.
    Underconfident,
    /// Within the bounds.
    Consistent,
    /// Errors larger than the covariance says.
    Overconfident,
}

/// A verdict with its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Consistency {
    /// Mean of the values.
    pub mean: f64,
    /// Number of values.
    pub samples: u32,
    /// Lower bound of the mean.
    pub lower: f64,
    /// Upper bound of the mean.
    pub upper: f64,
    /// The side of the bounds on which the mean lies.
    pub verdict: Verdict,
}

/// d^T P^-1 d: NEES of an error, NIS of an innovation.
///
/// # Errors
/// [`UkfError::Covariance`], [`UkfError::NotFinite`].
pub fn normalized_error_squared<T: Real, const N: usize>(
    difference: &SVector<T, N>,
    covariance: &SMatrix<T, N, N>,
) -> Result<T, UkfError> {
    let difference = finite(*difference, Step::Consistency, "the difference")?;
    let factor = definite(covariance, Step::Consistency)?;
    Ok(factor.mahalanobis_squared(&difference))
}

/// Judges independent NIS or NEES values of `dof` degrees of freedom each, with two-sided
/// bounds that a consistent filter meets with the given probability.
///
/// # Errors
/// [`UkfError::NoValues`], [`UkfError::ChiSquare`] for no degrees of freedom or a probability outside (0, 1),
/// [`UkfError::NotFinite`] for a value that is not.
///
/// ```
/// use ukf::{Verdict, assess_consistency};
///
/// // NIS of two-dimensional measurements, 2 on average where the filter is consistent.
/// let judged = assess_consistency((0..100).map(|k| f64::from(k % 5)), 2, 0.95)?;
/// assert_eq!(judged.verdict, Verdict::Consistent);
/// assert_eq!(assess_consistency([9.0; 100], 2, 0.95)?.verdict, Verdict::Overconfident);
/// # Ok::<(), ukf::UkfError>(())
/// ```
pub fn assess_consistency(
    values: impl IntoIterator<Item = f64>,
    dof: u32,
    probability: f64,
) -> Result<Consistency, UkfError> {
    let (mut sum, mut samples) = (0.0, 0_u32);
    for value in values {
        sum += value;
        samples += 1;
    }
    if samples == 0 {
        return Err(UkfError::NoValues);
    }
    if !sum.is_finite() {
        return Err(UkfError::NotFinite {
            step: Step::Consistency,
            what: "the values",
        });
    }
    let all_dof = f64::from(dof) * f64::from(samples);
    let lower = chi_square_quantile(all_dof, 0.5 * (1.0 - probability))? / f64::from(samples);
    let upper = chi_square_quantile(all_dof, 0.5 * (1.0 + probability))? / f64::from(samples);
    let mean = sum / f64::from(samples);
    let verdict = if mean < lower {
        Verdict::Underconfident
    } else if mean > upper {
        Verdict::Overconfident
    } else {
        Verdict::Consistent
    };
    Ok(Consistency {
        mean,
        samples,
        lower,
        upper,
        verdict,
    })
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use estimation_base::CholeskyError;
    use nalgebra::{Matrix2, Vector2};
    use std::vec;

    #[test]
    fn verdicts() {
        let verdict = |value: f64| {
            assess_consistency(vec![value; 50], 2, 0.95)
                .unwrap()
                .verdict
        };
        assert_eq!(verdict(2.0), Verdict::Consistent);
        assert_eq!(verdict(1.3), Verdict::Underconfident);
        assert_eq!(verdict(2.8), Verdict::Overconfident);
        let judged = assess_consistency(vec![2.0; 50], 2, 0.95).unwrap();
        assert!((judged.lower - 74.222 / 50.0).abs() < 1e-4);
        assert!((judged.upper - 129.561 / 50.0).abs() < 1e-4);
    }

    #[test]
    fn bad_questions_are_errors() {
        assert_eq!(assess_consistency([], 2, 0.9), Err(UkfError::NoValues));
        assert!(assess_consistency([1.0], 0, 0.9).is_err());
        assert!(assess_consistency([f64::NAN], 2, 0.9).is_err());
        for p in [-1.0, 1.5, f64::NAN] {
            assert!(matches!(
                assess_consistency([1.0], 2, p),
                Err(UkfError::ChiSquare(_))
            ));
        }
        let indefinite = Matrix2::new(1.0, 2.0, 2.0, 1.0);
        assert!(matches!(
            normalized_error_squared(&Vector2::new(1.0, 0.0), &indefinite),
            Err(UkfError::Covariance {
                step: Step::Consistency,
                reason: CholeskyError::NotPositiveDefinite { pivot: 1, .. },
            })
        ));
        let nees = normalized_error_squared(&Vector2::new(1.0, 2.0), &Matrix2::identity());
        assert_eq!(nees, Ok(5.0));
    }
}
