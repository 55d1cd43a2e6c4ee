//! The first positive zero of a polynomial: where a lens model folds over.
//!
//! Between the sign changes of its derivative a polynomial is monotone, so each such piece holds at most one simple
//! zero, found by bisection; the derivative's own sign changes come from the same search, one degree lower. A double
//! zero, where the sign does not change, is no fold: the radial part only pauses there.

/// A ray 89.99994 degrees off the axis has the squared normalised radius 1e12; nothing beyond it is a pixel.
const FARTHEST: f64 = 1e12;

/// Smallest root in (0, bound] of a polynomial (lowest coefficient first) that is positive at zero; O(degree^2).
///
/// The bound is reduced to Cauchy's, above which no polynomial has a root, and to 1e12.
pub(super) fn first_root(coefficients: &[f64], bound: f64) -> Option<f64> {
    let leading = coefficients.iter().rev().find(|c| **c != 0.0)?;
    let cauchy = 1.0
        + coefficients
            .iter()
            .fold(0.0, |m: f64, c| m.max((c / leading).abs()));
    sign_changes(coefficients, cauchy.min(bound).min(FARTHEST))
        .first()
        .copied()
}

/// Points of (0, bound] where the polynomial changes sign, ascending.
fn sign_changes(coefficients: &[f64], bound: f64) -> Vec<f64> {
    if coefficients.len() < 2 {
        return Vec::new();
    }
    let value = |s: f64| coefficients.iter().rev().fold(0.0, |sum, c| sum * s + c);
    let derivative: Vec<f64> = coefficients
        .iter()
        .enumerate()
        .skip(1)
        .map(|(power, c)| c * power as f64)
        .collect();
    let mut ends = sign_changes(&derivative, bound);
    ends.push(bound);
    let mut roots = Vec::new();
    let mut start = 0.0;
    for end in ends {
        let positive_first = value(start) > 0.0;
        if positive_first != (value(end) > 0.0) {
            let (mut low, mut high) = (start, end);
            for _ in 0..200 {
                let middle = 0.5 * (low + high);
                if (value(middle) > 0.0) == positive_first {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            roots.push(low);
        }
        start = end;
    }
    roots
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_root_is_the_smallest() {
        // (1 - s)(1 - s/2)(1 + s): roots 1, 2, -1.
        let root = first_root(&[1.0, -0.5, -1.0, 0.5], 10.0).unwrap();
        assert!((root - 1.0).abs() < 1e-14);
        assert!(first_root(&[1.0, 1.0, 1.0], 1e6).is_none());
        assert!(first_root(&[1.0, 0.0, 0.0, 0.0], 1e6).is_none());
        // The root is beyond the bound.
        assert!(first_root(&[1.0, -0.1], 9.0).is_none());
    }

    #[test]
    fn a_polynomial_of_degree_six_with_all_its_roots_positive() {
        // Product of (1 - s / n) for n = 1 ... 6, expanded by hand of the recurrence.
        let mut product = vec![1.0];
        for n in 1..=6 {
            let mut next = vec![0.0; product.len() + 1];
            for (power, c) in product.iter().enumerate() {
                next[power] += c;
                next[power + 1] -= c / f64::from(n);
            }
            product = next;
        }
        let roots = sign_changes(&product, 100.0);
        assert_eq!(roots.len(), 6);
        for (root, expected) in roots.iter().zip(1..=6) {
            assert!((root - f64::from(expected)).abs() < 1e-11, "{root}");
        }
    }
}
