//! The inverse of a lens: the undistorted point whose image is a given distorted point.
//!
//! Problem: solve distort(p) = q for p inside the field. No model has a closed form.
//!
//! Steps:
//! 1. the radial part alone, a monotone function of one variable up to the fold, by Newton's method kept inside a
//!    bracket (bisection where Newton leaves it);
//! 2. Newton's method in the plane from there, p <- p - J^-1 (distort(p) - q), the step halved until the residual
//!    falls, for the tangential part; run until the residual falls no further, that is to rounding;
//! 3. the solution counts only inside the field, with det J > 0, and with a residual at rounding level.
//!
//! Accuracy: the residual ends near epsilon (1 + |q|), about 1e-13 px at a focal length of 500 px, and is never
//! accepted above [`TOLERANCE`] (1 + |q|), which is 1e-10 px at 1000 px and |q| = 1. That is the error seen in the
//! *image*. The error of p is this divided by the smallest singular value of J, which is zero at the fold: at the
//! relative distance d before it, p is known to about epsilon / d only, whatever the method.
//!
//! Degenerate: q beyond the image of the fold has no solution, or one on the wrong branch: an error. O(1), at most 5
//! plane steps for real lenses.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Matrix2, Vector2};

use crate::error::GeometryError;

/// Largest residual accepted, relative to 1 + |distorted point|: 1e-10 px at a focal length of 1000 px and 45 degrees.
pub(super) const TOLERANCE: f64 = 5e-14;
/// A Newton step this small, relative to the point, is rounding: the residual cannot be made smaller.
const SMALLEST_STEP: f64 = 4.0 * f64::EPSILON;
/// Newton from the radial solution converges in 3 to 5 steps; more means there is no solution.
const MAX_ITERATIONS: usize = 30;

/// The lens as its inversion sees it.
pub(super) trait Lens {
    /// Whether it distorts nothing.
    fn is_pinhole(&self) -> bool;

    /// Whether its radial part is a function of the angle rather than of the radius.
    fn is_fisheye(&self) -> bool;

    /// The distorted point and its derivative with respect to the undistorted one.
    fn image(&self, point: &Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>);

    /// The radial part and its derivative: of the radius, for the fisheye of the angle.
    fn radial(&self, t: f64) -> (f64, f64);
}

/// The point inside `field_radius` whose image is `distorted`.
pub(super) fn undistort(
    lens: &impl Lens,
    distorted: &Vector2<f64>,
    field_radius: f64,
) -> Result<Vector2<f64>, GeometryError> {
    let radius = distorted.norm();
    let tolerance = TOLERANCE * (1.0 + radius);
    let fail = |point: Vector2<f64>, residual: f64| GeometryError::OutsideInvertibleField {
        x: distorted.x,
        y: distorted.y,
        radius: point.norm(),
        field_radius,
        residual,
        tolerance,
    };
    if !radius.is_finite() {
        return Err(fail(*distorted, f64::NAN));
    }
    if lens.is_pinhole() {
        return Ok(*distorted);
    }
    let mut point = distorted * radial_start(lens, radius, field_radius);
    let (image, mut jacobian) = lens.image(&point);
    let mut residual = image - distorted;
    let mut at_rounding = false;
    for _ in 0..MAX_ITERATIONS {
        if residual.norm() == 0.0 {
            break;
        }
        let Some(step) = jacobian.lu().solve(&residual) else {
            break;
        };
        at_rounding = step.norm() <= SMALLEST_STEP * point.norm();
        // Halve the step until the residual falls: a full step near the fold jumps to the other branch.
        let mut scale = 1.0;
        let better = (0..20).find_map(|_| {
            let candidate = point - step * scale;
            scale *= 0.5;
            let remaining = lens.image(&candidate).0 - distorted;
            (remaining.norm() < residual.norm()).then_some((candidate, remaining))
        });
        let Some((candidate, remaining)) = better else {
            break;
        };
        // At rounding level the last digit may wander without end; a step that does not halve the residual is the last.
        let settled = remaining.norm() <= tolerance && remaining.norm() > 0.5 * residual.norm();
        point = candidate;
        residual = remaining;
        jacobian = lens.image(&point).1;
        if settled {
            break;
        }
    }
    let inside = point.norm() < field_radius && jacobian.determinant() > 0.0;
    if inside && (residual.norm() <= tolerance || at_rounding) {
        Ok(point)
    } else {
        Err(fail(point, residual.norm()))
    }
}

/// Factor that undoes the radial part alone for a distorted radius; the nearest point of the field if there is none.
fn radial_start(lens: &impl Lens, distorted_radius: f64, field_radius: f64) -> f64 {
    if distorted_radius == 0.0 {
        return 1.0;
    }
    let fisheye = lens.is_fisheye();
    let mut high = if fisheye {
        // Just short of 90 degrees, where the normalised plane ends.
        field_radius.atan().min(FRAC_PI_2 * (1.0 - 1e-9))
    } else if field_radius.is_finite() {
        field_radius
    } else {
        let mut high = 1.0_f64.max(distorted_radius);
        while lens.radial(high).0 < distorted_radius && high < 1e150 {
            high *= 2.0;
        }
        high
    };
    let mut low = 0.0;
    let mut t = distorted_radius.min(0.5 * (low + high));
    // Newton with bisection as the fallback: the branch is monotone between low and high.
    for _ in 0..100 {
        let (image, derivative) = lens.radial(t);
        let value = image - distorted_radius;
        if value > 0.0 {
            high = t;
        } else {
            low = t;
        }
        let newton = t - value / derivative;
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
