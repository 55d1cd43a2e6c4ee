//! Trigonometric quotients of the Jacobians of SO(3) and SE(3) that are 0/0 at zero in their naive form.
//!
//! Each is accurate to a few units in the last place over the whole range, by power series where the closed form
//! cancels. Those of lower order, which SE(2) needs too, are in [`estimation_base::series`].

/// (x^2 + 2 cos x - 2) / (2 x^4), of the Jacobian of SE(3).
pub(crate) fn fourth_order_quotient(x: f64) -> f64 {
    let x2 = x * x;
    if x2 > 4.0 {
        return (x2 + 2.0 * x.cos() - 2.0) / (2.0 * x2 * x2);
    }
    // 1/4! - x^2/6! + x^4/8! - ...; the first term left out is 4^11 / 26! < 1e-19.
    let mut term = 1.0 / 24.0;
    let mut sum = term;
    for k in 3..13_u32 {
        let n = f64::from(2 * k);
        term *= -x2 / (n * (n - 1.0));
        sum += term;
    }
    sum
}

/// (2 x - 3 sin x + x cos x) / (2 x^5), of the Jacobian of SE(3).
pub(crate) fn fifth_order_quotient(x: f64) -> f64 {
    let x2 = x * x;
    if x2 > 4.0 {
        return (2.0 * x - 3.0 * x.sin() + x * x.cos()) / (2.0 * x2 * x2 * x);
    }
    // 1/5! - 2 x^2/7! + 3 x^4/9! - ...; the first term left out is 12 * 4^11 / 27! < 1e-20.
    let mut term = 1.0 / 120.0;
    let mut sum = term;
    for k in 3..13_u32 {
        let n = f64::from(2 * k);
        term *= -x2 / (n * (n + 1.0));
        sum += f64::from(k - 1) * term;
    }
    sum
}

/// (1 - (x / 2) cot(x / 2)) / x^2, the coefficient of the squared term in the inverse Jacobian of SO(3).
///
/// Finite for |x| < 2 pi; 1/pi^2 at pi.
pub(crate) fn inverse_jacobian_coefficient(x: f64) -> f64 {
    let x2 = x * x;
    if x2 > 0.25 {
        let half = 0.5 * x;
        return (1.0 - half * half.cos() / half.sin()) / x2;
    }
    // Bernoulli series: 1/12 + x^2/720 + x^4/30240 + x^6/1209600 + x^8/47900160 + ...
    const TERMS: [f64; 8] = [
        1.0 / 12.0,
        1.0 / 720.0,
        1.0 / 30_240.0,
        1.0 / 1_209_600.0,
        1.0 / 47_900_160.0,
        691.0 / 1_307_674_368_000.0,
        1.0 / 74_724_249_600.0,
        3_617.0 / 10_670_622_842_880_000.0,
    ];
    TERMS.iter().rev().fold(0.0, |sum, term| sum * x2 + term)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The two branches of every quotient meet, and agree with high-order Taylor polynomials.
    #[test]
    fn branches_agree_at_the_switch() {
        type Quotient = fn(f64) -> f64;
        let cases: [(Quotient, f64, f64); 3] = [
            (fourth_order_quotient, 2.0, 1e-16),
            (fifth_order_quotient, 2.0, 1e-16),
            (inverse_jacobian_coefficient, 0.5, 4e-15),
        ];
        for (function, at, tolerance) in cases {
            let below = function(at * (1.0 - 1e-15));
            let above = function(at * (1.0 + 1e-15));
            assert!((below - above).abs() <= tolerance, "{below} {above}");
            assert_eq!(function(-at), function(at));
        }
    }

    #[test]
    fn limits_at_zero() {
        assert_eq!(inverse_jacobian_coefficient(0.0), 1.0 / 12.0);
        assert_eq!(fourth_order_quotient(0.0), 1.0 / 24.0);
        assert_eq!(fifth_order_quotient(0.0), 1.0 / 120.0);
    }
}
