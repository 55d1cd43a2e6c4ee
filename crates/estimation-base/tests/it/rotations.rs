//! Unit quaternions as a manifold: round trips at all angles, the short way round.

use std::f64::consts::PI;

use estimation_base::Manifold;
use nalgebra::{Unit, UnitQuaternion, Vector3};
use proptest::prelude::*;

use super::config;

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
    #![proptest_config(config(256))]
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
    let tangent = Vector3::new(3e-9_f64, -1e-9, 2e-9);
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
