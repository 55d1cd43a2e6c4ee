//! All real roots of a polynomial of small degree.
//!
//! Between two neighbouring critical points a polynomial is monotonic, so it has a root there exactly if its sign
//! changes. The critical points are the roots of the derivative, found in the same way, down to degree one: only
//! evaluations, no Sturm remainders (which lose digits where leading coefficients are small) and no eigenvalues. Roots
//! with |z| > 1 are those of the reversed polynomial in (-1, 1), so that nothing is evaluated at large arguments.
//!
//! Degenerate: at a root of even multiplicity the sign does not change; a critical value of rounding size counts as a
//! root. A polynomial of rounding size has every number as its root, and gives none.

/// A real root as the ratio numerator / denominator, |both| <= 1 and one of them 1: infinite roots included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ratio {
    pub(super) numerator: f64,
    pub(super) denominator: f64,
}

/// Appends the real roots of sum_k c_k z^k, C coefficients, at most C - 1 roots. O(C^3) evaluations at worst.
pub(super) fn real_roots<const C: usize>(coefficients: &[f64; C], roots: &mut Vec<Ratio>) {
    let scale = coefficients.iter().fold(0.0_f64, |a, c| a.max(c.abs()));
    let usable = scale > 0.0 && coefficients.iter().all(|c| c.is_finite());
    if !usable {
        return;
    }
    let forward = coefficients.map(|c| c / scale);
    let (found, count) = roots_within_one(&forward);
    roots.extend(found[..count].iter().map(|z| Ratio {
        numerator: *z,
        denominator: 1.0,
    }));
    let mut backward = forward;
    backward.reverse();
    let (found, count) = roots_within_one(&backward);
    // +-1 belong to the first half.
    roots.extend(
        found[..count]
            .iter()
            .filter(|z| z.abs() < 1.0)
            .map(|z| Ratio {
                numerator: 1.0,
                denominator: *z,
            }),
    );
}

/// Newton's last step towards a root; the error left behind is of the order of its square.
const ROOT_STEP: f64 = 1.5e-8;
/// The same towards a critical point.
const CRITICAL_STEP: f64 = 1e-6;

/// Ascending roots in [-1, 1] and their number.
fn roots_within_one<const C: usize>(coefficients: &[f64; C]) -> ([f64; C], usize) {
    let mut roots = [0.0; C];
    let mut count = 0;
    // The derivatives from degree one upwards; d[k] holds the coefficients of the current one.
    for degree in 1..C {
        let order = C - 1 - degree;
        let mut derivative = [0.0; C];
        for k in 0..=degree {
            // (k + order)! / k! / order!: a common factor does not move roots, and this one keeps them in range.
            derivative[k] = coefficients[k + order] * binomial(k + order, order);
        }
        let polynomial = &derivative[..=degree];
        let size: f64 = polynomial.iter().map(|c| c.abs()).sum();
        let negligible = 4.0 * C as f64 * f64::EPSILON * size;
        let mut next = [0.0; C];
        let mut found = 0;
        let mut low = -1.0;
        let mut at_low = evaluate(polynomial, low).0;
        if at_low == 0.0 {
            next[found] = low;
            found += 1;
        }
        for k in 0..=count {
            let high = if k < count { roots[k] } else { 1.0 };
            let at_high = evaluate(polynomial, high).0;
            // Only an extremum can touch zero unseen.
            let touches = k < count && at_high.abs() <= negligible;
            if (at_low < 0.0 && at_high > 0.0 || at_low > 0.0 && at_high < 0.0) && found < degree {
                // A critical point only separates roots, and there the value is flat: less will do.
                let tolerance = if order == 0 { ROOT_STEP } else { CRITICAL_STEP };
                next[found] = bracketed_root(polynomial, low, high, at_low < 0.0, tolerance);
                found += 1;
            } else if (at_high == 0.0 || touches) && found < degree {
                next[found] = high;
                found += 1;
            }
            low = high;
            at_low = at_high;
        }
        roots = next;
        count = found;
    }
    (roots, count)
}

fn binomial(n: usize, k: usize) -> f64 {
    (0..k).fold(1.0, |product, i| product * (n - i) as f64 / (i + 1) as f64)
}

/// Value and derivative by Horner's rule.
fn evaluate(polynomial: &[f64], z: f64) -> (f64, f64) {
    let mut value = 0.0;
    let mut slope = 0.0;
    for c in polynomial.iter().rev() {
        slope = slope * z + value;
        value = value * z + c;
    }
    (value, slope)
}

/// The root between two arguments of different sign: Newton's method, bisection where it leaves the bracket; ends after a
/// step of at most `tolerance`.
fn bracketed_root(
    polynomial: &[f64],
    mut low: f64,
    mut high: f64,
    rising: bool,
    tolerance: f64,
) -> f64 {
    let mut z = 0.5 * (low + high);
    for _ in 0..100 {
        let (value, slope) = evaluate(polynomial, z);
        if value == 0.0 {
            return z;
        }
        if (value < 0.0) == rising {
            low = z;
        } else {
            high = z;
        }
        let newton = z - value / slope;
        // NaN from a zero slope is outside too.
        let next = if newton > low && newton < high {
            newton
        } else {
            0.5 * (low + high)
        };
        if (next - z).abs() <= tolerance || next == low || next == high {
            return next;
        }
        z = next;
    }
    z
}

#[cfg(test)]
mod tests {
    use super::*;

    fn from_roots<const C: usize>(roots: &[f64]) -> [f64; C] {
        let mut c = [0.0; C];
        c[0] = 1.0;
        for (n, root) in roots.iter().enumerate() {
            for k in (0..=n + 1).rev() {
                c[k] = if k > 0 { c[k - 1] } else { 0.0 } - root * c[k];
            }
        }
        c
    }

    fn found<const C: usize>(c: &[f64; C]) -> Vec<f64> {
        let mut roots = Vec::new();
        real_roots(c, &mut roots);
        let mut values: Vec<f64> = roots.iter().map(|r| r.numerator / r.denominator).collect();
        values.sort_by(f64::total_cmp);
        values
    }

    #[test]
    fn products_of_linear_factors_give_their_roots_back() {
        for roots in [
            vec![-3.0, -0.5, 0.25, 0.9, 40.0],
            vec![-1.0, 0.0, 1.0],
            vec![-0.9, -0.6, -0.3, -0.1, 0.0, 0.2, 0.4, 0.7, 0.95, 2.0],
            vec![1e-6, 1e6],
        ] {
            let values = match roots.len() {
                2 => found(&from_roots::<3>(&roots)),
                3 => found(&from_roots::<4>(&roots)),
                5 => found(&from_roots::<6>(&roots)),
                _ => found(&from_roots::<11>(&roots)),
            };
            assert_eq!(values.len(), roots.len(), "{values:?}");
            for (a, b) in values.iter().zip(&roots) {
                // Wilkinson: a root of a degree-10 polynomial in double precision.
                assert!((a - b).abs() <= 1e-11 * (1.0 + b.abs()), "{a} {b}");
            }
        }
    }

    #[test]
    fn a_double_root_is_found_and_complex_ones_are_not() {
        // (z - 0.5)^2 (z^2 + 1)
        let c = [0.25, -1.0, 1.25, -1.0, 1.0];
        let values = found(&c);
        assert!(
            !values.is_empty() && values.iter().all(|z| (z - 0.5).abs() < 1e-7),
            "{values:?}"
        );
        assert!(found(&[1.0, 0.0, 1.0]).is_empty());
        assert!(found(&[0.0; 5]).is_empty());
        assert!(found(&[f64::NAN, 1.0]).is_empty());
        // A vanishing leading coefficient is a root at infinity.
        let mut roots = Vec::new();
        real_roots(&[1.0, -2.0, 0.0], &mut roots);
        assert!(
            roots.iter().any(|r| r.denominator == 0.0) && roots.iter().any(|r| r.numerator == 0.5)
        );
    }
}
