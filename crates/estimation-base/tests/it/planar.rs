//! SE(2): group laws, round trips near half a turn, Jacobians against central differences.

use std::f64::consts::{FRAC_PI_2, PI};

use estimation_base::{Manifold, Se2, series, wrap};
use nalgebra::{Matrix3, Vector2, Vector3};
use proptest::prelude::*;

use super::config;

/// Angles that break naive formulas, and ordinary ones.
fn nasty_angle() -> impl Strategy<Value = f64> {
    prop_oneof![
        Just(0.0),
        Just(1e-300),
        Just(1e-12),
        Just(-1e-8),
        Just(1e-4),
        Just(PI),
        Just(-PI),
        Just(PI - 1e-9),
        Just(-PI + 1e-9),
        Just(FRAC_PI_2),
        -2e-4..2e-4_f64,
        -PI..PI,
    ]
}

fn pose() -> impl Strategy<Value = Se2> {
    (-10.0..10.0_f64, -10.0..10.0_f64, nasty_angle()).prop_map(|(x, y, phi)| Se2::new(x, y, phi))
}

fn close(a: &Se2, b: &Se2, tolerance: f64) -> bool {
    (a.x - b.x).abs() <= tolerance
        && (a.y - b.y).abs() <= tolerance
        && wrap(a.phi - b.phi).abs() <= tolerance
}

/// Central differences with a step balanced between truncation and rounding.
fn by_differences(
    at: &Vector3<f64>,
    function: impl Fn(&Vector3<f64>) -> Vector3<f64>,
) -> Matrix3<f64> {
    let step = 1e-5;
    let mut jacobian = Matrix3::zeros();
    for j in 0..3 {
        let mut delta = Vector3::zeros();
        delta[j] = step;
        let slope = (function(&(at + delta)) - function(&(at - delta))) / (2.0 * step);
        jacobian.set_column(j, &slope);
    }
    jacobian
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn group_laws(a in pose(), b in pose(), px in -5.0..5.0_f64, py in -5.0..5.0_f64) {
        let point = Vector2::new(px, py);
        prop_assert!(close(&a.compose(&a.inverse()), &Se2::identity(), 1e-13));
        prop_assert!(close(&a.compose(&a.between(&b)), &b, 1e-13));
        let twice = a.act(&b.act(&point));
        prop_assert!((a.compose(&b).act(&point) - twice).norm() < 1e-13);
        prop_assert!(a.compose(&b).phi > -PI && a.compose(&b).phi <= PI);
    }

    #[test]
    fn retract_and_local_undo_each_other(a in pose(), b in pose(), vx in -3.0..3.0_f64, vy in -3.0..3.0_f64, w in nasty_angle()) {
        prop_assert!(close(&Se2::exp(&a.log()), &a, 1e-13));
        prop_assert!(close(&a.retract(&a.local(&b)), &b, 1e-13));
        prop_assert!(a.local(&b).z.abs() <= PI);
        let tangent = Vector3::new(vx, vy, w);
        let reached = a.retract(&tangent);
        prop_assert!(close(&a.retract(&a.local(&reached)), &reached, 1e-13));
        // half a turn has two tangents
        if w.abs() < PI - 1e-6 {
            prop_assert!((a.local(&reached) - tangent).amax() < 1e-13);
        }
    }

    #[test]
    fn the_adjoint_moves_twists(a in pose(), vx in -1.0..1.0_f64, vy in -1.0..1.0_f64, w in -1.0..1.0_f64) {
        let twist = Vector3::new(vx, vy, w);
        let left = Se2::exp(&(a.adjoint() * twist)).compose(&a);
        let right = a.compose(&Se2::exp(&twist));
        prop_assert!(close(&left, &right, 1e-12));
    }

    #[test]
    fn jacobians_match_differences(vx in -3.0..3.0_f64, vy in -3.0..3.0_f64, w in nasty_angle()) {
        let twist = Vector3::new(vx, vy, w);
        let base = Se2::exp(&twist);
        let right = by_differences(&twist, |t| base.local(&Se2::exp(t)));
        prop_assert!((Se2::right_jacobian(&twist) - right).amax() < 1e-8);
        let left = by_differences(&twist, |t| Se2::exp(t).compose(&base.inverse()).log());
        prop_assert!((Se2::left_jacobian(&twist) - left).amax() < 1e-8);
        let one = Matrix3::identity();
        prop_assert!((Se2::left_jacobian(&twist) * Se2::left_jacobian_inverse(&twist) - one).amax() < 1e-13);
        prop_assert!((Se2::right_jacobian(&twist) * Se2::right_jacobian_inverse(&twist) - one).amax() < 1e-13);
        prop_assert!((base.adjoint() * Se2::right_jacobian(&twist) - Se2::left_jacobian(&twist)).amax() < 1e-13);
        // the derivative of the logarithm, where it is one: not across the cut at half a turn
        if w.abs() < 3.1 {
            let log = by_differences(&Vector3::zeros(), |d| base.retract(d).log());
            prop_assert!((Se2::right_jacobian_inverse(&twist) - log).amax() < 1e-7);
        }
    }
}

#[test]
fn a_quarter_turn_is_a_quarter_circle() {
    // forward pi/2 while turning pi/2: radius 1
    let tangent = Vector3::new(FRAC_PI_2, 0.0, FRAC_PI_2);
    let pose = Se2::new(1.0, 0.0, FRAC_PI_2).retract(&tangent);
    assert!(pose.x.abs() < 1e-15 && (pose.y - 1.0).abs() < 1e-15);
    assert!((pose.phi - PI).abs() < 1e-15);
    // an Euler step leaves the circle by far
    assert!((Vector2::new(1.0, FRAC_PI_2) - Vector2::new(pose.x, pose.y)).norm() > 1.0);
}

#[test]
fn the_branches_of_the_series_meet() {
    for (function, at) in [
        (series::sinc as fn(f64) -> f64, 1e-4),
        (series::x_minus_sin_over_x3, 1.0),
    ] {
        let below = function(at * (1.0 - 1e-15));
        let above = function(at * (1.0 + 1e-15));
        assert!((below - above).abs() <= 1e-15, "{below} {above}");
        assert_eq!(function(-at), function(at));
    }
    assert_eq!(series::sinc(0.0), 1.0);
    assert_eq!(series::versine_over_x(0.0), 0.0);
    assert_eq!(series::versine_over_x2(0.0), 0.5);
    assert_eq!(series::x_minus_sin_over_x3(0.0), 1.0 / 6.0);
    let tiny = 1e-9_f64;
    assert!((series::versine_over_x(tiny) - 0.5 * tiny).abs() < 1e-25);
}
