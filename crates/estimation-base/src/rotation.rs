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

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::manifold::Manifold;
use crate::real::Real;

impl<T: Real> Manifold<3, T> for UnitQuaternion<T> {
    fn retract(&self, tangent: &Vector3<T>) -> Self {
        let mut turned = self * exp(tangent);
        // a million steps would drift from unit length otherwise
        turned.renormalize();
        turned
    }

    fn local(&self, other: &Self) -> Vector3<T> {
        log(&(self.inverse() * other))
    }
}

fn exp<T: Real>(tangent: &Vector3<T>) -> UnitQuaternion<T> {
    let square = tangent.norm_squared();
    let angle = square.sqrt();
    let (sin, cos) = (T::of(0.5) * angle).sin_cos();
    // sin(a/2)/a; the next term of the series, a^4/3840, is under the rounding below 1e-3
    let factor = if angle < T::of(1e-3) {
        T::of(0.5) - square / T::of(48.0)
    } else {
        sin / angle
    };
    UnitQuaternion::new_unchecked(Quaternion::from_parts(cos, tangent * factor))
}

fn log<T: Real>(rotation: &UnitQuaternion<T>) -> Vector3<T> {
    let sign = if rotation.w < T::zero() {
        -T::one()
    } else {
        T::one()
    };
    let (cos, vector) = (sign * rotation.w, rotation.imag() * sign);
    let sin = vector.norm();
    // a/sin(a/2); 2 (1 + s^2/6) with the next term, 3 s^4/20, under the rounding below 1e-4
    let factor = if sin < T::of(1e-4) {
        T::of(2.0) + sin * sin / T::of(3.0)
    } else {
        T::of(2.0) * sin.atan2(cos) / sin
    };
    vector * factor
}
