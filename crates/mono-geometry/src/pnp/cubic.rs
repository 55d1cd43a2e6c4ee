//! Real roots of a cubic in closed form, polished.
//!
//! x^3 + b x^2 + c x + d = 0 becomes y^3 - 3 q y - 2 r = 0 with x = y - b / 3. For r^2 < q^3 it has three real roots
//! 2 sqrt q cos(phi + 2 pi k / 3) (Viete), else one, by Cardano's formula in the form without cancellation. Two Newton steps
//! remove the rounding of the closed form. Degenerate: of a double root rounding may leave a complex pair, which is not
//! returned (the single root always is); a leading coefficient that is rounding error next to the others
//! leaves a quadratic (its missing root is infinite).

use std::f64::consts::TAU;

/// Real roots of c3 x^3 + c2 x^2 + c1 x + c0, `None` in the unused places. Coefficients finite.
pub(super) fn real_roots(c3: f64, c2: f64, c1: f64, c0: f64) -> [Option<f64>; 3] {
    let largest = c3.abs().max(c2.abs()).max(c1.abs()).max(c0.abs());
    if c3.abs() <= 4.0 * f64::EPSILON * largest {
        return quadratic(c2, c1, c0, largest);
    }
    let (b, c, d) = (c2 / c3, c1 / c3, c0 / c3);
    let third = b / 3.0;
    let q = third * third - c / 3.0;
    let r = 0.5 * (third * c - d) - third * third * third;
    let discriminant = r * r - q * q * q;
    let value = |x: f64| ((x + b) * x + c) * x + d;
    let polish = |mut x: f64| {
        for _ in 0..2 {
            let next = x - value(x) / ((3.0 * x + 2.0 * b) * x + c);
            // At a multiple root the slope is rounding too.
            let better = value(next).abs() < value(x).abs();
            if !better {
                break;
            }
            x = next;
        }
        Some(x)
    };
    if discriminant < 0.0 {
        let root = q.sqrt();
        let angle = (r / (q * root)).clamp(-1.0, 1.0).acos() / 3.0;
        let at = |k: f64| polish(2.0 * root * (angle + k * TAU / 3.0).cos() - third);
        [at(0.0), at(1.0), at(2.0)]
    } else {
        let large = (r.abs() + discriminant.sqrt()).cbrt().copysign(r);
        let small = if large == 0.0 { 0.0 } else { q / large };
        [polish(large + small - third), None, None]
    }
}

fn quadratic(a: f64, b: f64, c: f64, largest: f64) -> [Option<f64>; 3] {
    if a.abs() <= 4.0 * f64::EPSILON * largest {
        let root = -c / b;
        return [root.is_finite().then_some(root), None, None];
    }
    let discriminant = b * b - 4.0 * a * c;
    if discriminant < 0.0 {
        return [None; 3];
    }
    let sum = -0.5 * (b + discriminant.sqrt().copysign(b));
    let other = if sum == 0.0 { 0.0 } else { c / sum };
    [Some(sum / a), Some(other), None]
}

#[cfg(test)]
mod tests {
    use super::real_roots;

    #[test]
    fn products_of_linear_factors_give_their_roots() {
        for roots in [
            [1.0, 2.0, 3.0],
            [-1e3, 1e-3, 5.0],
            [0.0, 0.0, 1.0],
            [2.0, 2.0, 2.0],
            [-1.0, -1.0, 4.0],
        ] {
            let [p, q, r] = roots;
            let found = real_roots(
                2.0,
                -2.0 * (p + q + r),
                2.0 * (p * q + q * r + r * p),
                -2.0 * p * q * r,
            );
            // A root of multiplicity m moves by eps^(1/m).
            let tolerance = |root: f64| match roots.iter().filter(|x| **x == root).count() {
                1 => 1e-12,
                2 => 1e-7,
                _ => 1e-4,
            };
            for x in found.iter().flatten() {
                let near = |root: &f64| (x - root).abs() <= tolerance(*root) * (1.0 + root.abs());
                assert!(roots.iter().any(near), "{roots:?} {found:?}");
            }
            for root in roots {
                let near = |x: &f64| (x - root).abs() <= tolerance(root) * (1.0 + root.abs());
                let double = tolerance(root) == 1e-7;
                assert!(
                    double || found.iter().flatten().any(near),
                    "{roots:?} {found:?}"
                );
            }
        }
    }

    #[test]
    fn complex_pairs_are_left_out_and_lower_degrees_solved() {
        let only: Vec<f64> = real_roots(1.0, -3.0, 1.0, -3.0)
            .into_iter()
            .flatten()
            .collect();
        assert!(only.len() == 1 && (only[0] - 3.0).abs() < 1e-14);
        let two: Vec<f64> = real_roots(0.0, 1.0, -3.0, 2.0)
            .into_iter()
            .flatten()
            .collect();
        assert!(two.len() == 2 && (two[0] - 2.0).abs() < 1e-15 && (two[1] - 1.0).abs() < 1e-15);
        assert_eq!(real_roots(0.0, 0.0, 2.0, -1.0)[0], Some(0.5));
        assert_eq!(real_roots(0.0, 0.0, 0.0, 0.0), [None; 3]);
    }
}
