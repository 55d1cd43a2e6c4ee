//! Rotations in space: `nalgebra::UnitQuaternion`, `world_from_body`, as a manifold.
//!
//! The tangent is a rotation vector in the body frame, angle times axis in radians:
//!
//! ```text
//! q.retract(t) = q exp(t / 2),   p.local(q) = 2 log(p^-1 q), the short way round
//! ```
//!
//! Both are accurate to rounding at any angle: the functions that divide by the angle go over to their series where it is
//! small, and the angle comes from an arc tangent of sine and cosine, which loses nothing near half a turn (an arc cosine
//! of the trace loses half the digits there and at zero). q and -q are one rotation and give the same results up to the
//! sign of the quaternion.

use nalgebra::{ComplexField, Quaternion, RealField, UnitQuaternion, Vector3};

use crate::manifold::Manifold;

impl Manifold<3> for UnitQuaternion<f64> {
    fn retract(&self, tangent: &Vector3<f64>) -> Self {
        let mut turned = self * exp(tangent);
        // a million steps would drift from unit length otherwise
        turned.renormalize();
        turned
    }

    fn local(&self, other: &Self) -> Vector3<f64> {
        log(&(self.inverse() * other))
    }
}

fn exp(tangent: &Vector3<f64>) -> UnitQuaternion<f64> {
    let square = tangent.norm_squared();
    let angle = ComplexField::sqrt(square);
    let (sin, cos) = ComplexField::sin_cos(0.5 * angle);
    // sin(a/2)/a; the next term of the series, a^4/3840, is under the rounding below 1e-3
    let factor = if angle < 1e-3 {
        0.5 - square / 48.0
    } else {
        sin / angle
    };
    UnitQuaternion::new_unchecked(Quaternion::from_parts(cos, tangent * factor))
}

fn log(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let sign = if rotation.w < 0.0 { -1.0 } else { 1.0 };
    let (cos, vector) = (sign * rotation.w, rotation.imag() * sign);
    let sin = vector.norm();
    // a/sin(a/2); 2 (1 + s^2/6) with the next term, 3 s^4/20, under the rounding below 1e-4
    let factor = if sin < 1e-4 {
        2.0 + sin * sin / 3.0
    } else {
        2.0 * RealField::atan2(sin, cos) / sin
    };
    vector * factor
}
