//! Kannala-Brandt fisheye lens (equidistant polynomial), for wide lenses.
//!
//! With theta = atan r the angle off the axis: theta' = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8),
//! (x', y') = (theta' / r) (x, y). The fold is the first zero of d theta' / d theta below 90 degrees.
//!
//! Degenerate: on the axis theta / r is 0/0 with limit 1; near it the quotients are taken from their series. At
//! 90 degrees the normalised plane ends: rays from there backwards (z <= 0) are refused, though the image of the model
//! goes on. A lens of up to 180 degrees field is covered short of its very rim; beyond that the plane is the wrong
//! domain.
//!
//! Source: J. Kannala and S. Brandt, A generic camera model and calibration method for conventional, wide-angle, and
//! fish-eye lenses, 2006 (equation 6); parameter order of OpenCV's `fisheye` and Kalibr's `equidistant`.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix2, Vector2};

use super::jacobian::LensJacobian;
use super::roots::first_root;

/// theta' / theta.
pub(super) fn gain(k: [f64; 4], theta: f64) -> f64 {
    let t = theta * theta;
    1.0 + t * (k[0] + t * (k[1] + t * (k[2] + t * k[3])))
}

/// d theta' / d theta.
pub(super) fn derivative(k: [f64; 4], theta: f64) -> f64 {
    let t = theta * theta;
    1.0 + t * (3.0 * k[0] + t * (5.0 * k[1] + t * (7.0 * k[2] + t * 9.0 * k[3])))
}

/// Tangent of the angle of the fold; infinite if it is not below 90 degrees. O(1).
pub(super) fn field_radius(k: [f64; 4]) -> f64 {
    let polynomial = [1.0, 3.0 * k[0], 5.0 * k[1], 7.0 * k[2], 9.0 * k[3]];
    first_root(&polynomial, FRAC_PI_2 * FRAC_PI_2)
        .map_or(f64::INFINITY, |theta2| theta2.sqrt().tan())
}

/// The distorted point and its derivative by the point.
pub(super) fn distort_with_jacobian(
    k: [f64; 4],
    point: &Vector2<f64>,
) -> (Vector2<f64>, Matrix2<f64>) {
    let r2 = point.norm_squared();
    let r = r2.sqrt();
    let theta = r.atan();
    // (x', y') = h (x, y), h = theta' / r; the derivative is h I + (dh/dr / r) (x, y)(x, y)^T.
    let h = gain(k, theta) * atan_over_x(r);
    // dh/dr / r = (d theta'/dr - h) / r^2. Both terms tend to 1, which costs epsilon / r^2 in the quotient and hence
    // epsilon in its product with (x, y)(x, y)^T; the limit below 1e-4 is off by O(r^2), r^4 = 1e-16 in the product.
    let quotient = if r2 < 1e-8 {
        2.0 * (k[0] - 1.0 / 3.0)
    } else {
        (derivative(k, theta) / (1.0 + r2) - h) / r2
    };
    let jacobian = Matrix2::identity() * h + point * point.transpose() * quotient;
    (point * h, jacobian)
}

/// Derivative of the distorted point by k1 k2 k3 k4; the other columns are zero.
pub(super) fn parameter_jacobian(point: &Vector2<f64>) -> LensJacobian {
    let r = point.norm();
    let theta2 = r.atan().powi(2);
    let mut jacobian = LensJacobian::zeros();
    let mut power = atan_over_x(r);
    for column in 0..4 {
        power *= theta2;
        jacobian.set_column(column, &(point * power));
    }
    jacobian
}

/// atan(x) / x for x >= 0.
fn atan_over_x(x: f64) -> f64 {
    // The term left out, x^4 / 5, is below 1e-16.
    if x < 1e-4 {
        1.0 - x * x / 3.0
    } else {
        x.atan() / x
    }
}
