//! Wrapping at both ends of the interval, and the circle as a manifold.

use std::f64::consts::{PI, TAU};

use estimation_base::{Angle, Manifold, wrap};
use nalgebra::Vector1;
use proptest::prelude::*;

use super::config;

#[test]
fn the_interval_is_open_below_and_closed_above() {
    assert_eq!(wrap(PI), PI);
    assert_eq!(wrap(-PI), PI);
    assert_eq!(wrap(3.0 * PI), PI);
    let below = f64::from_bits(PI.to_bits() - 1);
    let above = f64::from_bits(PI.to_bits() + 1);
    assert_eq!(wrap(-below), -below);
    assert_eq!(wrap(above), above - TAU);
    assert_eq!(wrap(-above), TAU - above);
    assert_eq!(wrap(0.0), 0.0);
    assert!(wrap(f64::NAN).is_nan() && wrap(f64::INFINITY).is_nan());
    assert_eq!(Angle::new(-PI).radians(), PI);
    assert!((Angle::new(-7.0).radians() - (TAU - 7.0)).abs() < 1e-15);
}

#[test]
fn turns_do_not_matter() {
    for turns in -50_i32..=50 {
        for step in -31_i32..=31 {
            let angle = f64::from(step) * 0.1;
            let wrapped = wrap(angle + f64::from(turns) * TAU);
            assert!((wrapped - angle).abs() < 50.0 * 16.0 * f64::EPSILON);
            assert!(wrapped > -PI && wrapped <= PI);
        }
    }
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn retract_and_local_undo_each_other(
        from in prop_oneof![-PI..PI, Just(PI), Just(PI - 1e-15), Just(-PI + 1e-15)],
        turn in prop_oneof![-PI..PI, Just(PI - 1e-12), Just(-PI + 1e-12), Just(0.0)],
    ) {
        let from = Angle::new(from);
        let reached = from.retract(&Vector1::new(turn));
        prop_assert!(reached.radians() > -PI && reached.radians() <= PI);
        prop_assert!((from.local(&reached)[0] - turn).abs() < 4.0 * PI * f64::EPSILON);
        prop_assert!(wrap(from.retract(&from.local(&reached)).radians() - reached.radians()).abs() < 4.0 * PI * f64::EPSILON);
    }
}
