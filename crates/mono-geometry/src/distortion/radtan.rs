//! Radial-tangential lens (Brown 1966), and the tangential part it shares with the rational lens.
//!
//! With s = x^2 + y^2 and gain g(s):
//! x' = g x + 2 p1 x y + p2 (s + 2 x^2), y' = g y + p1 (s + 2 y^2) + 2 p2 x y.
//! Here g = 1 + k1 s + k2 s^2 + k3 s^3. The radial part r g(r^2) has the derivative 1 + 3 k1 s + 5 k2 s^2 + 7 k3 s^3;
//! its first positive zero is the fold.
//!
//! Degenerate: none inside the fold. The decentring terms move the true fold by O(p r); the inverse therefore also
//! checks the sign of the determinant at its solution.
//!
//! Source: D. C. Brown, Decentering distortion of lenses, 1966; parameter order of OpenCV.

use nalgebra::{Matrix2, Vector2};

use super::jacobian::LensJacobian;
use super::roots::first_root;

/// g and dg/ds.
pub(super) fn gain(k: [f64; 3], s: f64) -> (f64, f64) {
    let [k1, k2, k3] = k;
    (
        1.0 + s * (k1 + s * (k2 + s * k3)),
        k1 + s * (2.0 * k2 + s * 3.0 * k3),
    )
}

/// Radius of the fold; infinite if there is none. O(1).
pub(super) fn field_radius(k: [f64; 3]) -> f64 {
    let polynomial = [1.0, 3.0 * k[0], 5.0 * k[1], 7.0 * k[2]];
    first_root(&polynomial, f64::INFINITY).map_or(f64::INFINITY, f64::sqrt)
}

/// The distorted point and its derivative by the point, for any gain (g, dg/ds) at s.
pub(super) fn distort_with_jacobian(
    point: &Vector2<f64>,
    (gain, slope): (f64, f64),
    [p1, p2]: [f64; 2],
) -> (Vector2<f64>, Matrix2<f64>) {
    let (x, y) = (point.x, point.y);
    let s = x * x + y * y;
    let distorted = Vector2::new(
        gain * x + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x),
        gain * y + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y,
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

/// Derivative of the distorted point by k1 k2 p1 p2 k3; the other columns are zero.
pub(super) fn parameter_jacobian(point: &Vector2<f64>) -> LensJacobian {
    let s = point.norm_squared();
    let mut jacobian = LensJacobian::zeros();
    for (column, power) in [(0, s), (1, s * s), (4, s * s * s)] {
        jacobian.set_column(column, &(point * power));
    }
    set_tangential(&mut jacobian, point);
    jacobian
}

/// Columns 2 and 3: the derivative by p1 and p2, which no gain touches.
pub(super) fn set_tangential(jacobian: &mut LensJacobian, point: &Vector2<f64>) {
    let (x, y) = (point.x, point.y);
    let s = x * x + y * y;
    jacobian.set_column(2, &Vector2::new(2.0 * x * y, s + 2.0 * y * y));
    jacobian.set_column(3, &Vector2::new(s + 2.0 * x * x, 2.0 * x * y));
}
