//! Optimal correction of a match between two views, and the point it gives.
//!
//! Problem: pixels p1, p2 with noise sigma_1, sigma_2 miss the epipolar constraint p2^T F p1 = 0. Find the pair that
//! fulfils it and minimises |dp1|^2 / sigma_1^2 + |dp2|^2 / sigma_2^2: the maximum-likelihood match, and, its rays
//! meeting exactly, the point of least reprojection error.
//!
//! Equation: in whitened moves a = dp1 / sigma_1, b = dp2 / sigma_2 the constraint is
//!
//! > q = b^T M a + g1 . a + g2 . b + c = 0,
//!
//! with M = sigma_1 sigma_2 times the upper left 2x2 of F, g1 = sigma_1 (F^T p2)_xy, g2 = sigma_2 (F p1)_xy and
//! c = p2^T F p1. A stationary point has a = -lambda n1, b = -lambda n2 with n1 = M^T b + g1, n2 = M a + g2.
//!
//! Steps:
//! 1. iterate (Lindstrom 2010, "Triangulation made easy"): n1, n2 from the last a, b; lambda the smaller root of
//!    (n2^T M n1) lambda^2 - (g1 . n1 + g2 . n2) lambda + c = 0; new a, b. Every iterate fulfils the constraint; two or
//!    three suffice for a match near its epipolar line;
//! 2. certify: a stationary point is the global minimum if |lambda| |M| <= 1, for then the Lagrangian is convex;
//! 3. otherwise (near an epipole, or a gross mismatch) solve for lambda itself: on |lambda| < 1 / |M| the constraint as
//!    a function of lambda falls monotonically, and its root there is the global minimum (the secular equation of a
//!    quadratic program with one quadratic constraint; More 1993). Newton's method kept in a bracket.
//!
//! Degenerate: without a baseline there is no F. With both pixels placed so that two corrections are equally short (as
//! between two epipoles) there is none to prefer: [`NoCorrection`] says so.

use estimation_base::Readable;
use nalgebra::{Matrix2, Matrix3, Rotation2, Vector2};

use super::accept::accept;
use super::observation::{
    Acceptance, Observation, Rejection, Triangulated, check, ray_parallax, require_in_front,
    require_parallax,
};
use super::refine::{Minimum, normal_equations};
use super::start::midpoint;
use crate::camera::Pinhole;
use crate::epipolar::EpipolarPair;
use crate::linalg::{self, cholesky};

/// A match moved onto the epipolar constraint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correction {
    /// Corrected pixel of the first view.
    pub first_px: Vector2<f64>,
    /// Corrected pixel of the second view.
    pub second_px: Vector2<f64>,
    /// |dp1|^2 / sigma_1^2 + |dp2|^2 / sigma_2^2, of one degree of freedom.
    pub chi_square: f64,
    /// Iterations of Lindstrom's method, and of Newton's where that had to follow.
    pub iterations: usize,
}

/// Why a match has no unique correction.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoCorrection {
    /// A number is not finite, or a sigma not positive.
    #[error(
        "match with constraint value {} is unusable, required: finite numbers, sigma above 0",
        Readable(*.constraint)
    )]
    Unusable {
        /// p2^T F p1.
        constraint: f64,
    },
    /// The shortest correction is not unique: as if both pixels were at their epipoles.
    #[error(
        "constraint {} is met by two moves of equal length: curvature {} between them, required: above {}",
        Readable(*.constraint),
        Readable(*.curvature),
        Readable(*.required)
    )]
    AtEpipole {
        /// p2^T F p1.
        constraint: f64,
        /// 1 - |lambda| |M|, the smallest curvature of the Lagrangian, between 0 and 1.
        curvature: f64,
        /// The smallest at which the correction keeps four digits.
        required: f64,
    },
}

/// A move that changes by less than this, in standard deviations, is settled: squared it is below the rounding of one.
const SETTLED: f64 = 1e-11;
/// The rounding of the move is eps over the curvature.
const MIN_CURVATURE: f64 = 1e-12;
/// Curvature from which on Lindstrom's point is certified; below, the secular equation measures it without cancellation.
const CERTAIN_CURVATURE: f64 = 1e-4;
const LINDSTROM_ITERATIONS: usize = 10;
const NEWTON_ITERATIONS: usize = 100;

/// The match of least squared move, in units of its noise, that fulfils p2^T F p1 = 0 exactly. O(1).
///
/// `fundamental` is F in ideal pixels ([`crate::epipolar::fundamental`], [`EpipolarPair::fundamental`]). The rounding
/// left is that of p2^T F p1, about 1e-13 of the image size.
///
/// # Errors
/// [`NoCorrection`]; the second kind only at the epipoles.
pub fn correct_match(
    fundamental: &Matrix3<f64>,
    first_px: &Vector2<f64>,
    second_px: &Vector2<f64>,
    sigma_first_px: f64,
    sigma_second_px: f64,
) -> Result<Correction, NoCorrection> {
    let roots = [sigma_first_px, sigma_second_px].map(Matrix2::from_diagonal_element);
    correct_match_of_roots(fundamental, first_px, second_px, &roots)
}

/// [`correct_match`] for noise of which square roots of the covariances are given.
fn correct_match_of_roots(
    fundamental: &Matrix3<f64>,
    first_px: &Vector2<f64>,
    second_px: &Vector2<f64>,
    [first_root, second_root]: &[Matrix2<f64>; 2],
) -> Result<Correction, NoCorrection> {
    let line_in_second = fundamental * first_px.push(1.0);
    let line_in_first = fundamental.transpose() * second_px.push(1.0);
    let in_first = first_root.transpose() * line_in_first.xy();
    let in_second = second_root.transpose() * line_in_second.xy();
    // The scale of F is arbitrary: unit gradient keeps every number in range.
    let scale = in_first.norm().hypot(in_second.norm());
    let constraint = second_px.push(1.0).dot(&line_in_second);
    let by_both = fundamental.fixed_view::<2, 2>(0, 0).into_owned();
    let problem = Problem {
        matrix: second_root.transpose() * by_both * first_root / scale,
        g1: in_first / scale,
        g2: in_second / scale,
        constant: constraint / scale,
    };
    let usable = problem.matrix.iter().all(|v| v.is_finite())
        && problem.constant.is_finite()
        && [first_root, second_root]
            .iter()
            .all(|root| root[(0, 0)] > 0.0 && root.determinant() > 0.0)
        && scale > 0.0;
    if !usable {
        return Err(NoCorrection::Unusable { constraint });
    }
    let (quick, spent) = problem.lindstrom();
    let (a, b, iterations) = match quick {
        Some((a, b)) => (a, b, spent),
        None => {
            let (a, b, curvature, more) = problem.secular();
            if curvature <= MIN_CURVATURE {
                return Err(NoCorrection::AtEpipole {
                    constraint,
                    curvature,
                    required: MIN_CURVATURE,
                });
            }
            (a, b, spent + more)
        }
    };
    let correction = Correction {
        first_px: first_px + first_root * a,
        second_px: second_px + second_root * b,
        chi_square: a.norm_squared() + b.norm_squared(),
        iterations,
    };
    let finite = correction.chi_square.is_finite()
        && correction.first_px.iter().all(|v| v.is_finite())
        && correction.second_px.iter().all(|v| v.is_finite());
    if finite {
        Ok(correction)
    } else {
        Err(NoCorrection::Unusable { constraint })
    }
}

/// [`super::triangulate`] for two views by the optimal correction: the same minimum, without steps in space. Behind a lens the
/// noise enters by its covariance alone, to first order. O(1).
///
/// # Errors
/// The [`Rejection`] with the measured value and the one required.
pub fn triangulate_two_views(
    pinhole: &Pinhole,
    observations: &[Observation; 2],
    acceptance: &Acceptance,
) -> Result<Triangulated, Rejection> {
    check(observations)?;
    let too_small = Rejection::ParallaxTooSmall {
        parallax_rad: require_parallax(ray_parallax(pinhole, observations), acceptance)?,
        required_rad: acceptance.min_parallax_rad,
    };
    let [first, second] = observations;
    let pair = EpipolarPair::new(
        pinhole,
        &first.camera_from_world.inverse(),
        &second.camera_from_world.inverse(),
    )
    .ok_or(too_small)?;
    let roots = [first, second].map(|o| o.shape.root(o.sigma_px));
    let Ok(correction) = correct_match_of_roots(
        pair.fundamental(),
        &first.pixel_ideal,
        &second.pixel_ideal,
        &roots,
    ) else {
        return Err(too_small);
    };
    let mut corrected = *observations;
    corrected[0].pixel_ideal = correction.first_px;
    corrected[1].pixel_ideal = correction.second_px;
    // The rays meet: the midpoint is the intersection.
    let point = midpoint(pinhole, &corrected).ok_or(too_small)?;
    require_in_front(observations, &point)?;
    let normal = normal_equations(pinhole, observations, &point)?;
    let covariance = cholesky(&normal.information)
        .and_then(|factor| linalg::covariance(&factor))
        .map_err(|_singular| too_small)?;
    let minimum = Minimum {
        point,
        covariance,
        chi_square: correction.chi_square,
        iterations: correction.iterations,
    };
    accept(observations, &minimum, acceptance)
}

/// Minimise |a|^2 + |b|^2 subject to b^T M a + g1 . a + g2 . b + c = 0.
struct Problem {
    matrix: Matrix2<f64>,
    g1: Vector2<f64>,
    g2: Vector2<f64>,
    constant: f64,
}

type Move = (Vector2<f64>, Vector2<f64>);

impl Problem {
    /// The settled and certified iterate, if any, and the iterations spent.
    fn lindstrom(&self) -> (Option<Move>, usize) {
        let (mut a, mut b) = (Vector2::zeros(), Vector2::zeros());
        if self.constant == 0.0 {
            return (Some((a, b)), 0);
        }
        for iteration in 1..=LINDSTROM_ITERATIONS {
            let n1 = self.matrix.transpose() * b + self.g1;
            let n2 = self.matrix * a + self.g2;
            let quadratic = n2.dot(&(self.matrix * n1));
            let half = 0.5 * (self.g1.dot(&n1) + self.g2.dot(&n2));
            let discriminant = half * half - quadratic * self.constant;
            let lambda = self.constant / (half + discriminant.sqrt());
            let settled = discriminant >= 0.0 && half > 0.0 && lambda.is_finite();
            if !settled {
                return (None, iteration);
            }
            let (next_a, next_b) = (n1 * -lambda, n2 * -lambda);
            let change = (next_a - a).norm_squared() + (next_b - b).norm_squared();
            let size = next_a.norm_squared() + next_b.norm_squared();
            (a, b) = (next_a, next_b);
            if change <= SETTLED * SETTLED * (1.0 + size) {
                let global = 1.0 - lambda.abs() * self.norm() > CERTAIN_CURVATURE;
                return (global.then_some((a, b)), iteration);
            }
        }
        (None, LINDSTROM_ITERATIONS)
    }

    /// Spectral norm of M.
    fn norm(&self) -> f64 {
        let m = &self.matrix;
        0.5 * ((m[(0, 0)] + m[(1, 1)]).hypot(m[(1, 0)] - m[(0, 1)])
            + (m[(0, 0)] - m[(1, 1)]).hypot(m[(1, 0)] + m[(0, 1)]))
    }

    /// The root of the constraint over the multipliers with a convex Lagrangian: the move, the curvature there and the
    /// iterations spent. A curvature of zero where the constraint has one sign on all of them.
    fn secular(&self) -> (Vector2<f64>, Vector2<f64>, f64, usize) {
        let nothing = (Vector2::zeros(), Vector2::zeros(), 0.0, 0);
        let Some(split) = self.split() else {
            return nothing;
        };
        // |lambda| |M| = 1 - gap: the gap is what must not be lost to rounding; it is searched on a log scale.
        let (mut low, mut high) = (0.1 * MIN_CURVATURE.ln() + MIN_CURVATURE.ln(), 0.0_f64);
        let bracketed = split.constraint(low.exp()).0 < 0.0;
        if !bracketed {
            return nothing;
        }
        let mut at = -1.0_f64;
        for iteration in 1..=NEWTON_ITERATIONS {
            let gap = at.exp();
            let (constraint, slope_by_gap) = split.constraint(gap);
            if constraint > 0.0 {
                high = at;
            } else {
                low = at;
            }
            let newton = at - constraint / (slope_by_gap * gap);
            let next = if newton > low && newton < high {
                newton
            } else {
                0.5 * (low + high)
            };
            let settled = (next - at).abs() <= 4.0 * f64::EPSILON * (1.0 + at.abs());
            at = next;
            if settled || iteration == NEWTON_ITERATIONS {
                let (a, b) = split.moves(at.exp());
                return (a, b, at.exp(), iteration);
            }
        }
        nothing
    }

    /// The problem in the singular axes of M, with the sign of c made positive; `None` if M is zero.
    fn split(&self) -> Option<Split> {
        let sign = self.constant.signum();
        // M = R(left) diag(s) R(right): rotations leave the sign of the determinant in the second value.
        let m = self.matrix * sign;
        let (even, odd) = (
            Vector2::new(m[(0, 0)] + m[(1, 1)], m[(1, 0)] - m[(0, 1)]) * 0.5,
            Vector2::new(m[(0, 0)] - m[(1, 1)], m[(1, 0)] + m[(0, 1)]) * 0.5,
        );
        let (turn, mirror) = (even.y.atan2(even.x), odd.y.atan2(odd.x));
        let u = *Rotation2::new(0.5 * (turn + mirror)).matrix();
        let v = Rotation2::new(0.5 * (turn - mirror)).matrix().transpose();
        let s = Vector2::new(even.norm() + odd.norm(), even.norm() - odd.norm());
        let curved = s.x > 0.0;
        if !curved {
            return None;
        }
        let (a, b) = (
            v.transpose() * self.g1 * sign,
            u.transpose() * self.g2 * sign,
        );
        let root = std::f64::consts::FRAC_1_SQRT_2;
        Some(Split {
            u,
            v,
            s,
            sum: (a + b) * root,
            difference: (a - b) * root,
            constant: self.constant.abs(),
        })
    }
}

/// q = c + sum_i s_i (p_i^2 - m_i^2) / 2 + sum_i p_i + difference_i m_i, p = (a + b) / sqrt 2, m = (a - b) / sqrt 2.
struct Split {
    u: Matrix2<f64>,
    v: Matrix2<f64>,
    s: Vector2<f64>,
    sum: Vector2<f64>,
    difference: Vector2<f64>,
    constant: f64,
}

impl Split {
    /// lambda, and (1 + lambda s_i, 1 - lambda s_i) at lambda = (1 - gap) / s_1.
    fn denominators(&self, gap: f64) -> (f64, Vector2<f64>, Vector2<f64>) {
        let lambda = (1.0 - gap) / self.s.x;
        let ratio = self.s.y / self.s.x;
        let plus = Vector2::new(2.0 - gap, 1.0 + (1.0 - gap) * ratio);
        let minus = Vector2::new(gap, (1.0 - ratio) + gap * ratio);
        (lambda, plus, minus)
    }

    /// The constraint and its derivative by the gap (which is positive).
    fn constraint(&self, gap: f64) -> (f64, f64) {
        let (lambda, plus, minus) = self.denominators(gap);
        let (mut value, mut slope) = (self.constant, 0.0);
        for i in 0..2 {
            let (p, m) = (lambda / plus[i], lambda / minus[i]);
            let (sum, difference) = (self.sum[i].powi(2), self.difference[i].powi(2));
            if sum > 0.0 {
                value += sum * p * (0.5 * self.s[i] * p - 1.0);
                slope += sum / plus[i].powi(3);
            }
            if difference > 0.0 {
                value -= difference * m * (0.5 * self.s[i] * m + 1.0);
                slope += difference / minus[i].powi(3);
            }
        }
        (value, slope / self.s.x)
    }

    fn moves(&self, gap: f64) -> Move {
        let (lambda, plus, minus) = self.denominators(gap);
        let p = self.sum.component_div(&plus) * -lambda;
        let m = -(self
            .difference
            .zip_map(&minus, |d, by| if d == 0.0 { 0.0 } else { d / by }))
            * lambda;
        let root = std::f64::consts::FRAC_1_SQRT_2;
        (self.v * (p + m) * root, self.u * (p - m) * root)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in (-1, 1) from a fixed sequence.
    fn numbers(seed: usize) -> [f64; 9] {
        std::array::from_fn(|k| ((seed * 9 + k + 1) as f64 * 78.233).sin())
    }

    #[test]
    fn the_secular_equation_and_lindstroms_iteration_find_the_same_move() {
        let mut compared = 0;
        for seed in 0..2_000 {
            let n = numbers(seed);
            let problem = Problem {
                matrix: Matrix2::new(n[0], n[1], n[2], n[3]),
                g1: Vector2::new(n[4], n[5]),
                g2: Vector2::new(n[6], n[7]),
                constant: 0.5 * n[8],
            };
            let (a, b, curvature, _) = problem.secular();
            let left = b.dot(&(problem.matrix * a))
                + problem.g1.dot(&a)
                + problem.g2.dot(&b)
                + problem.constant;
            assert!(
                left.abs() < 1e-9 && curvature > 0.0,
                "{seed}: {left} {curvature}"
            );
            if let (Some((p, q)), _) = problem.lindstrom() {
                compared += 1;
                assert!((p - a).norm() + (q - b).norm() < 1e-7, "{seed}");
            }
        }
        // Large moves on strongly curved constraints: Lindstrom settles on about half of them.
        assert!(compared > 500, "{compared}");
    }
}
