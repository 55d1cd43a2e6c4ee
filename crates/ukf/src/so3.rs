//! Rotations in space: `nalgebra::UnitQuaternion`, `world_from_body`, as a manifold.
//!
//! The tangent is a rotation vector in the body frame, angle times axis in radians:
//!
//! ```text
//! q.retract(t) = q exp(t / 2),   p.local(q) = 2 log(p^-1 q), the short way round
//! ```
//!
//! Both are accurate to rounding at any angle: the functions that divide by the angle go over to their
//! series where it is small, and the angle comes from an arc tangent of sine and cosine, which loses
//! nothing near half a turn (an arc cosine of the trace loses half the digits there and at zero).
//! q and -q are one rotation and give the same results up to the sign of the quaternion.

use crate::manifold::Manifold;
use crate::math::{atan2, sin_cos, sqrt};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

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
    let angle = sqrt(square);
    let (sin, cos) = sin_cos(0.5 * angle);
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
        2.0 * atan2(sin, cos) / sin
    };
    vector * factor
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use core::f64::consts::PI;
    use nalgebra::Unit;
    use proptest::prelude::*;

    /// Angles at which careless forms lose digits, on both sides of the series.
    fn angle() -> impl Strategy<Value = f64> {
        prop_oneof![
            0.0..3.1_f64,
            Just(0.0),
            1e-300..1e-150_f64,
            1e-12..1e-6_f64,
            0.9e-4..2.2e-4_f64,
            0.9e-3..1.1e-3_f64,
            (PI - 1e-6)..(PI - 1e-13),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn retract_and_local_undo_each_other(
            start in prop::array::uniform3(-2.0..2.0_f64), axis in prop::array::uniform3(-1.0..1.0_f64), angle in angle(),
        ) {
            let axis = Vector3::from(axis);
            prop_assume!(axis.norm() > 1e-3);
            let tangent = axis.normalize() * angle;
            let start = UnitQuaternion::identity().retract(&Vector3::from(start));
            let reached = start.retract(&tangent);
            prop_assert!((start.local(&reached) - tangent).norm() < 8.0 * f64::EPSILON);
            // -q is the same rotation
            let other = UnitQuaternion::new_unchecked(-reached.into_inner());
            prop_assert!((start.local(&other) - tangent).norm() < 8.0 * f64::EPSILON);
            // nalgebra's own rotation by that angle about that axis
            let theirs = start * UnitQuaternion::from_axis_angle(&Unit::new_normalize(axis), angle);
            prop_assert!((reached.coords - theirs.coords).norm() < 8.0 * f64::EPSILON);
            prop_assert!((reached.norm() - 1.0).abs() < 2.0 * f64::EPSILON);
        }
    }

    #[test]
    fn a_small_angle_keeps_its_digits_relative_to_itself() {
        let tangent = Vector3::new(3e-9, -1e-9, 2e-9);
        let back = UnitQuaternion::identity().local(&UnitQuaternion::identity().retract(&tangent));
        assert!((back - tangent).norm() < 4.0 * f64::EPSILON * tangent.norm());
        // the arc cosine of w = 1 - 1.75e-18 would be 0
        assert_eq!(2.0 * (1.0_f64 - 0.125 * tangent.norm_squared()).acos(), 0.0);
    }

    #[test]
    fn half_a_turn_and_more_go_the_short_way() {
        let reached = UnitQuaternion::identity().retract(&Vector3::new(0.0, 0.0, PI + 0.1));
        let back = UnitQuaternion::identity().local(&reached);
        assert!((back - Vector3::new(0.0, 0.0, 0.1 - PI)).norm() < 1e-14);
        let half = UnitQuaternion::identity().retract(&Vector3::new(PI, 0.0, 0.0));
        assert!((UnitQuaternion::identity().local(&half).norm() - PI).abs() < 1e-15);
    }
}
