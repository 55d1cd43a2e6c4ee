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
//!
//! The distribution is the regularised incomplete gamma function P(k/2, x/2), by series below
//! x = k + 2 and continued fraction above, with log Gamma by Stirling's series above 16:
//! relative error below 1e-12 for up to 10^4 degrees of freedom. The quantile is its bisection.

use crate::cholesky::Cholesky;
use crate::error::{Step, UkfError};
use crate::math::{exp, ln};
use core::f64::consts::TAU;
use nalgebra::{SMatrix, SVector};

/// What the mean of NIS or NEES says about a filter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    /// Which side of the bounds the mean is on.
    pub verdict: Verdict,
}

/// d^T P^-1 d: NEES of an error, NIS of an innovation.
///
/// # Errors
/// [`UkfError::NotPositiveDefinite`], [`UkfError::NotFinite`].
pub fn normalized_error_squared<const N: usize>(
    difference: &SVector<f64, N>,
    covariance: &SMatrix<f64, N, N>,
) -> Result<f64, UkfError> {
    if !difference.iter().all(|entry| entry.is_finite()) {
        return Err(UkfError::NotFinite {
            step: Step::Consistency,
            what: "the difference",
        });
    }
    let factor = Cholesky::positive_definite(covariance, Step::Consistency)?;
    Ok(factor.mahalanobis_squared(difference))
}

/// Judges independent NIS or NEES values of `dof` degrees of freedom each, with two-sided
/// bounds that a consistent filter meets with the given probability.
///
/// # Errors
/// [`UkfError::Empty`] without values or degrees of freedom, [`UkfError::InvalidProbability`],
/// [`UkfError::NotFinite`] if a value is.
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
        return Err(UkfError::Empty { what: "values" });
    }
    if !sum.is_finite() {
        return Err(UkfError::NotFinite {
            step: Step::Consistency,
            what: "the values",
        });
    }
    let all_dof = f64::from(dof) * f64::from(samples);
    let lower = quantile(all_dof, 0.5 * (1.0 - probability))? / f64::from(samples);
    let upper = quantile(all_dof, 0.5 * (1.0 + probability))? / f64::from(samples);
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

/// Probability that a chi-square variable of `dof` degrees of freedom is at most `x`; 0 for
/// negative x, NaN for NaN or no degrees of freedom.
#[must_use]
pub fn chi_square_cdf(dof: u32, x: f64) -> f64 {
    if dof == 0 {
        f64::NAN
    } else {
        cdf(f64::from(dof), x)
    }
}

/// The x that a chi-square variable of `dof` degrees of freedom does not exceed with the given
/// probability: the gate of a match, 9.21 for 2 degrees and 0.99.
///
/// # Errors
/// [`UkfError::InvalidProbability`] outside (0, 1), [`UkfError::Empty`] for no degrees of freedom.
pub fn chi_square_quantile(dof: u32, probability: f64) -> Result<f64, UkfError> {
    quantile(f64::from(dof), probability)
}

fn quantile(dof: f64, probability: f64) -> Result<f64, UkfError> {
    if !(probability > 0.0 && probability < 1.0) {
        return Err(UkfError::InvalidProbability { value: probability });
    }
    if dof < 1.0 {
        return Err(UkfError::Empty {
            what: "degrees of freedom",
        });
    }
    let (mut low, mut high) = (0.0, dof + 10.0);
    while cdf(dof, high) < probability && high < 1e300 {
        low = high;
        high *= 2.0;
    }
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            return Ok(middle);
        }
        if cdf(dof, middle) < probability {
            low = middle;
        } else {
            high = middle;
        }
    }
}

fn cdf(dof: f64, x: f64) -> f64 {
    if x.is_nan() {
        return f64::NAN;
    }
    if x <= 0.0 {
        return 0.0;
    }
    if x.is_infinite() {
        return 1.0;
    }
    let (a, t) = (0.5 * dof, 0.5 * x);
    // t^a e^-t / Gamma(a)
    let scale = exp(a * ln(t) - t - ln_gamma(a));
    if t < a + 1.0 {
        scale * series(a, t)
    } else {
        1.0 - scale * continued_fraction(a, t)
    }
}

/// sum_k t^k / (a (a+1) ... (a+k)).
fn series(a: f64, t: f64) -> f64 {
    let mut term = 1.0 / a;
    let mut sum = term;
    let mut denominator = a;
    while term > sum * 1e-17 {
        denominator += 1.0;
        term *= t / denominator;
        sum += term;
    }
    sum
}

/// 1/(t+1-a- 1(1-a)/(t+3-a- 2(2-a)/(t+5-a- ...))) by Lentz's method.
fn continued_fraction(a: f64, t: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let mut b = t + 1.0 - a;
    let mut c = 1.0 / TINY;
    let mut d = 1.0 / b;
    let mut result = d;
    let mut k = 1.0;
    // needs of the order of sqrt(a) terms
    while k < 1e6 {
        let numerator = -k * (k - a);
        b += 2.0;
        d = numerator * d + b;
        d = 1.0 / if d.abs() < TINY { TINY } else { d };
        c = b + numerator / c;
        c = if c.abs() < TINY { TINY } else { c };
        let factor = c * d;
        result *= factor;
        if (factor - 1.0).abs() < 2.0 * f64::EPSILON {
            break;
        }
        k += 1.0;
    }
    result
}

/// log Gamma(a) for a > 0: raised above 16, then Stirling's series, whose first term left out,
/// 691/(360360 a^11), is below 2e-16 there.
fn ln_gamma(a: f64) -> f64 {
    let (mut raised, mut product) = (a, 1.0);
    while raised < 16.0 {
        product *= raised;
        raised += 1.0;
    }
    let inverse = 1.0 / raised;
    let square = inverse * inverse;
    let tail = inverse
        * (1.0 / 12.0
            - square
                * (1.0 / 360.0
                    - square * (1.0 / 1260.0 - square * (1.0 / 1680.0 - square / 1188.0))));
    (raised - 0.5) * ln(raised) - raised + 0.5 * ln(TAU) + tail - ln(product)
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use nalgebra::{Matrix2, Vector2};
    use std::vec;

    /// dof 2 is exponential, dof 4 a sum of two: closed forms.
    #[test]
    fn even_degrees_have_closed_forms() {
        for x in [1e-6, 0.1, 1.0, 3.9, 4.1, 9.0, 20.0] {
            let tail = (-0.5_f64 * x).exp();
            let cases = [
                (2, 1.0 - tail),
                (4, 1.0 - tail * (1.0 + 0.5 * x)),
                (6, 1.0 - tail * (1.0 + 0.5 * x + 0.125 * x * x)),
            ];
            for (dof, expected) in cases {
                assert!(
                    (chi_square_cdf(dof, x) - expected).abs() < 1e-14,
                    "{dof} {x}"
                );
            }
        }
        for p in [0.01_f64, 0.5, 0.95, 0.99, 0.9999] {
            let expected = -2.0 * (1.0 - p).ln();
            let found = chi_square_quantile(2, p).unwrap();
            assert!((found - expected).abs() < 1e-11 * expected.max(1.0), "{p}");
        }
    }

    /// Values of printed tables, three decimals.
    #[test]
    fn agrees_with_tables() {
        for (dof, p, expected) in [
            (1, 0.95, 3.841),
            (1, 0.99, 6.635),
            (3, 0.025, 0.216),
            (3, 0.975, 9.348),
            (10, 0.05, 3.940),
            (100, 0.975, 129.561),
        ] {
            let found = chi_square_quantile(dof, p).unwrap();
            assert!((found - expected).abs() < 6e-4, "{dof} {p} {found}");
        }
    }

    /// F_{k+2}(x) = F_k(x) - (x/2)^{k/2} e^{-x/2} / Gamma(k/2 + 1) across both branches and sizes.
    #[test]
    fn the_recurrence_holds_for_many_degrees() {
        for dof in [1_u32, 3, 7, 40, 501, 10_000] {
            for factor in [0.7, 0.97, 1.0, 1.03, 1.4] {
                let x = f64::from(dof) * factor;
                let a = 0.5 * f64::from(dof);
                let step = (a * (0.5 * x).ln() - 0.5 * x - ln_gamma(a + 1.0)).exp();
                let difference = chi_square_cdf(dof, x) - chi_square_cdf(dof + 2, x);
                assert!((difference - step).abs() < 1e-11, "{dof} {factor}");
            }
        }
        assert!((ln_gamma(0.5) - 0.5 * core::f64::consts::PI.ln()).abs() < 1e-14);
        assert!((ln_gamma(21.0) - 2_432_902_008_176_640_000_f64.ln()).abs() < 1e-13);
    }

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
        assert_eq!(
            assess_consistency([], 2, 0.9),
            Err(UkfError::Empty { what: "values" })
        );
        assert!(assess_consistency([1.0], 0, 0.9).is_err());
        assert!(assess_consistency([f64::NAN], 2, 0.9).is_err());
        for p in [0.0, 1.0, -1.0, f64::NAN] {
            assert!(matches!(
                chi_square_quantile(2, p),
                Err(UkfError::InvalidProbability { .. })
            ));
        }
        assert!(chi_square_cdf(0, 1.0).is_nan() && chi_square_cdf(1, f64::NAN).is_nan());
        assert_eq!(
            (chi_square_cdf(2, -1.0), chi_square_cdf(2, f64::INFINITY)),
            (0.0, 1.0)
        );
        let indefinite = Matrix2::new(1.0, 2.0, 2.0, 1.0);
        assert!(matches!(
            normalized_error_squared(&Vector2::new(1.0, 0.0), &indefinite),
            Err(UkfError::NotPositiveDefinite {
                pivot: 1,
                step: Step::Consistency,
                ..
            })
        ));
        let nees = normalized_error_squared(&Vector2::new(1.0, 2.0), &Matrix2::identity());
        assert_eq!(nees, Ok(5.0));
    }
}
