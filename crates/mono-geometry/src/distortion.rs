//! Lens distortion on the normalised image plane (x = X/Z, y = Y/Z).
//!
//! Two models, in the parameter order of the common calibration tools:
//!
//! - *radial-tangential* (Brown 1966): with r^2 = x^2 + y^2 and g = 1 + k1 r^2 + k2 r^4 + k3 r^6,
//!   x' = g x + 2 p1 x y + p2 (r^2 + 2 x^2), y' = g y + p1 (r^2 + 2 y^2) + 2 p2 x y;
//! - *Kannala-Brandt* (2006), for wide lenses: with theta = atan r,
//!   theta' = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8), (x', y') = (theta' / r) (x, y).
//!
//! Both are polynomials fitted inside the image. Outside it they may fold over: a point far off the axis is then
//! mapped back *into* the image. The radius at which that begins, the first zero of the radial derivative, is the edge
//! of the invertible field; nothing beyond it is projected or undistorted. The inverse is Newton's method from the
//! solution of the radial part alone, which is found by a bracketed Newton search on its monotone branch.
//!
//! Not for mirrors or lenses that see behind the camera: the normalised plane ends at 90 degrees.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix2, Vector2};

use crate::error::{GeometryError, checked};

/// Residual accepted by the inverse, relative to 1 + |distorted point|; about 1e-9 px for usual focal lengths.
const UNDISTORT_TOLERANCE: f64 = 1e-12;
/// Newton from the radial solution converges in 3 to 5 steps; more means there is no solution.
const UNDISTORT_MAX_ITERATIONS: usize = 30;

/// A lens distortion model; every finite coefficient is legal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Distortion {
    /// An ideal pinhole.
    None,
    /// Radial-tangential polynomial (Brown), without unit.
    Radtan {
        /// Coefficient of r^2.
        k1: f64,
        /// Coefficient of r^4.
        k2: f64,
        /// First tangential coefficient.
        p1: f64,
        /// Second tangential coefficient.
        p2: f64,
        /// Coefficient of r^6.
        k3: f64,
    },
    /// Equidistant fisheye polynomial (Kannala and Brandt), without unit.
    KannalaBrandt {
        /// Coefficient of theta^2.
        k1: f64,
        /// Coefficient of theta^4.
        k2: f64,
        /// Coefficient of theta^6.
        k3: f64,
        /// Coefficient of theta^8.
        k4: f64,
    },
}

impl Distortion {
    /// Maps an undistorted normalised point to the distorted one. O(1).
    #[must_use]
    pub fn distort(&self, point: &Vector2<f64>) -> Vector2<f64> {
        self.distort_with_jacobian(point).0
    }

    /// The distorted point and its derivative with respect to the undistorted one (2x2). O(1).
    #[must_use]
    pub fn distort_with_jacobian(&self, point: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let (x, y) = (point.x, point.y);
        let r2 = x * x + y * y;
        match *self {
            Self::None => (*point, Matrix2::identity()),
            Self::Radtan { k1, k2, p1, p2, k3 } => {
                let gain = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                // d gain / d (r^2)
                let slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
                let distorted = Vector2::new(
                    gain * x + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    gain * y + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
                );
                let mixed = 2.0 * slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y;
                let jacobian = Matrix2::new(
                    gain + 2.0 * slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
                    mixed,
                    mixed,
                    gain + 2.0 * slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
                );
                (distorted, jacobian)
            }
            Self::KannalaBrandt { .. } => {
                let r = r2.sqrt();
                let theta = r.atan();
                // (x', y') = h (x, y), h = theta' / r; the derivative is h I + (dh/dr / r) (x, y)(x, y)^T.
                let gain = self.radial_gain(theta);
                let h = gain * atan_over_x(r);
                let derivative = self.radial_derivative(theta) / (1.0 + r2);
                // dh/dr / r = (derivative - h) / r^2; near the axis both terms agree to O(r^2) and the product with
                // (x, y)(x, y)^T is below 1e-12, so the limit -1/3 + k1 of the quotient is enough there.
                let quotient = if r2 < 1e-6 {
                    2.0 * (self.leading_cubic() - 1.0 / 3.0)
                } else {
                    (derivative - h) / r2
                };
                let jacobian = Matrix2::identity() * h + point * point.transpose() * quotient;
                (point * h, jacobian)
            }
        }
    }

    /// Normalised radius up to which the radial part is monotone; infinite if it is everywhere.
    ///
    /// For the fisheye model this is the tangent of the limiting angle. Found from the roots of the derivative
    /// polynomial, O(1).
    #[must_use]
    pub fn field_radius(&self) -> f64 {
        match *self {
            Self::None => f64::INFINITY,
            Self::Radtan { k1, k2, k3, .. } => {
                let polynomial = [1.0, 3.0 * k1, 5.0 * k2, 7.0 * k3];
                // Cauchy: every root is below 1 + max |c_i / c_lead|; and 89.99994 degrees off the axis is enough.
                let leading = polynomial.iter().rev().find(|c| **c != 0.0).copied();
                let bound = leading.map_or(1.0, |leading| {
                    1.0 + polynomial
                        .iter()
                        .fold(0.0, |m: f64, c| m.max((c / leading).abs()))
                });
                let bound = bound.min(1e12);
                first_root(&polynomial, bound).map_or(f64::INFINITY, f64::sqrt)
            }
            Self::KannalaBrandt { k1, k2, k3, k4 } => {
                let polynomial = [1.0, 3.0 * k1, 5.0 * k2, 7.0 * k3, 9.0 * k4];
                first_root(&polynomial, FRAC_PI_2 * FRAC_PI_2)
                    .map_or(f64::INFINITY, |theta2| theta2.sqrt().tan())
            }
        }
    }

    /// Maps a distorted normalised point back, to a residual of 1e-12 (1 + |point|).
    ///
    /// O(1): a bracketed search on the radius, then 2 to 5 Newton steps for the tangential part.
    ///
    /// # Errors
    /// [`GeometryError::OutsideInvertibleField`] if no point inside [`Self::field_radius`] maps to `distorted`
    /// (also for NaN).
    pub fn undistort(&self, distorted: &Vector2<f64>) -> Result<Vector2<f64>, GeometryError> {
        self.undistort_within(distorted, self.field_radius())
    }

    /// [`Self::undistort`] with the field radius already known.
    pub(crate) fn undistort_within(
        &self,
        distorted: &Vector2<f64>,
        field_radius: f64,
    ) -> Result<Vector2<f64>, GeometryError> {
        let radius = distorted.norm();
        let tolerance = UNDISTORT_TOLERANCE * (1.0 + radius);
        let fail = |point: Vector2<f64>, residual: f64| {
            Err(GeometryError::OutsideInvertibleField {
                x: distorted.x,
                y: distorted.y,
                radius: point.norm(),
                field_radius,
                residual,
                tolerance,
            })
        };
        if !radius.is_finite() {
            return fail(*distorted, f64::NAN);
        }
        if *self == Self::None || radius == 0.0 && !self.has_tangential() {
            return Ok(*distorted);
        }
        let mut point = distorted * self.radial_start(radius, field_radius);
        let mut residual = self.distort(&point) - distorted;
        for _ in 0..UNDISTORT_MAX_ITERATIONS {
            let (_, jacobian) = self.distort_with_jacobian(&point);
            if residual.norm() <= tolerance {
                return if point.norm() < field_radius && jacobian.determinant() > 0.0 {
                    Ok(point)
                } else {
                    fail(point, residual.norm())
                };
            }
            let Some(step) = jacobian.lu().solve(&residual) else {
                return fail(point, residual.norm());
            };
            // Halve the step until the residual falls: a full step near the fold jumps to the other branch.
            let mut scale = 1.0;
            let accepted = (0..20).find_map(|_| {
                let candidate = point - step * scale;
                scale *= 0.5;
                let remaining = self.distort(&candidate) - distorted;
                (remaining.norm() < residual.norm()).then_some((candidate, remaining))
            });
            let Some((candidate, remaining)) = accepted else {
                return fail(point, residual.norm());
            };
            point = candidate;
            residual = remaining;
        }
        fail(point, residual.norm())
    }

    /// All coefficients finite, or the error naming the one that is not.
    pub(crate) fn check(&self) -> Result<(), GeometryError> {
        let named: &[(&'static str, f64)] = match self {
            Self::None => &[],
            Self::Radtan { k1, k2, p1, p2, k3 } => &[
                ("k1", *k1),
                ("k2", *k2),
                ("p1", *p1),
                ("p2", *p2),
                ("k3", *k3),
            ],
            Self::KannalaBrandt { k1, k2, k3, k4 } => {
                &[("k1", *k1), ("k2", *k2), ("k3", *k3), ("k4", *k4)]
            }
        };
        for (name, value) in named {
            checked(name, *value, "a finite number", |_| true)?;
        }
        Ok(())
    }

    fn has_tangential(&self) -> bool {
        matches!(self, Self::Radtan { p1, p2, .. } if *p1 != 0.0 || *p2 != 0.0)
    }

    /// k1 of the fisheye model: theta' = theta + k1 theta^3 + ...
    fn leading_cubic(&self) -> f64 {
        match *self {
            Self::KannalaBrandt { k1, .. } | Self::Radtan { k1, .. } => k1,
            Self::None => 0.0,
        }
    }

    /// Ratio of distorted to undistorted radial coordinate (r for radtan, theta for the fisheye).
    fn radial_gain(&self, t: f64) -> f64 {
        let t2 = t * t;
        match *self {
            Self::None => 1.0,
            Self::Radtan { k1, k2, k3, .. } => 1.0 + t2 * (k1 + t2 * (k2 + t2 * k3)),
            Self::KannalaBrandt { k1, k2, k3, k4 } => {
                1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4)))
            }
        }
    }

    /// Derivative of t * radial_gain(t).
    fn radial_derivative(&self, t: f64) -> f64 {
        let t2 = t * t;
        match *self {
            Self::None => 1.0,
            Self::Radtan { k1, k2, k3, .. } => {
                1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * 7.0 * k3))
            }
            Self::KannalaBrandt { k1, k2, k3, k4 } => {
                1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)))
            }
        }
    }

    /// Factor that undoes the radial part alone for a distorted radius; the nearest point of the field if there is none.
    fn radial_start(&self, distorted_radius: f64, field_radius: f64) -> f64 {
        if distorted_radius == 0.0 {
            return 1.0;
        }
        let fisheye = matches!(self, Self::KannalaBrandt { .. });
        let forward = |t: f64| t * self.radial_gain(t);
        let mut high = if fisheye {
            // Just short of 90 degrees, where the normalised plane ends.
            field_radius.atan().min(FRAC_PI_2 * (1.0 - 1e-9))
        } else if field_radius.is_finite() {
            field_radius
        } else {
            let mut high = 1.0_f64.max(distorted_radius);
            while forward(high) < distorted_radius && high < 1e150 {
                high *= 2.0;
            }
            high
        };
        let mut low = 0.0;
        let mut t = distorted_radius.min(0.5 * (low + high));
        // Newton with bisection as the fallback: the branch is monotone between low and high.
        for _ in 0..100 {
            let value = forward(t) - distorted_radius;
            if value > 0.0 {
                high = t;
            } else {
                low = t;
            }
            let newton = t - value / self.radial_derivative(t);
            let next = if newton > low && newton < high {
                newton
            } else {
                0.5 * (low + high)
            };
            if (next - t).abs() <= 2.0 * f64::EPSILON * t {
                break;
            }
            t = next;
        }
        if fisheye {
            t.tan() / distorted_radius
        } else {
            t / distorted_radius
        }
    }
}

/// atan(x) / x.
fn atan_over_x(x: f64) -> f64 {
    if x < 1e-4 {
        1.0 - x * x / 3.0
    } else {
        x.atan() / x
    }
}

/// Smallest root in (0, bound] of a polynomial (lowest coefficient first) that is positive at zero.
fn first_root(coefficients: &[f64], bound: f64) -> Option<f64> {
    sign_changes(coefficients, bound).first().copied()
}

/// Points of (0, bound] where the polynomial changes sign, ascending: between the sign changes of the derivative it is
/// monotone, so each such piece is searched by bisection.
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
        if (value(start) > 0.0) != (value(end) > 0.0) {
            let positive_first = value(start) > 0.0;
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
    }

    /// One negative cubic term: r (1 + k r^2) folds at r = 1 / sqrt(-3 k).
    #[test]
    fn field_radius_of_a_barrel() {
        let barrel = Distortion::Radtan {
            k1: -0.3,
            k2: 0.0,
            p1: 0.0,
            p2: 0.0,
            k3: 0.0,
        };
        let expected = 1.0 / 0.9_f64.sqrt();
        assert!((barrel.field_radius() - expected).abs() < 1e-12);
        // The image of the fold itself is 2/3 of it; a point past that has no source.
        let edge = expected * 2.0 / 3.0;
        assert!(
            barrel
                .undistort(&Vector2::new(edge * 0.999_999, 0.0))
                .is_ok()
        );
        assert!(matches!(
            barrel.undistort(&Vector2::new(edge * 1.001, 0.0)),
            Err(GeometryError::OutsideInvertibleField { .. })
        ));
    }

    #[test]
    fn fisheye_ends_at_ninety_degrees() {
        let fisheye = Distortion::KannalaBrandt {
            k1: 0.0,
            k2: 0.0,
            k3: 0.0,
            k4: 0.0,
        };
        let angle = 1.5_f64;
        let point = fisheye.undistort(&Vector2::new(angle, 0.0)).unwrap();
        assert!((point.x - angle.tan()).abs() < 1e-9 * angle.tan());
        assert!(fisheye.undistort(&Vector2::new(1.6, 0.0)).is_err());
    }
}
