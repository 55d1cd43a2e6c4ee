//! SE(2), SO(3), SE(3) and the planar mount: round trips, closed forms, Jacobians against central differences.

use std::f64::consts::{FRAC_PI_2, PI};

use estimation_base::wrap;
use mono_geometry::{Mount, Se2, Se3, so3, world_from_tilted_body};
use nalgebra::{Matrix3, Rotation3, SMatrix, SVector, Vector2, Vector3, Vector6};
use proptest::prelude::*;

use crate::common::{config, nasty_angle, rotation_vector};

fn se2() -> impl Strategy<Value = Se2> {
    (-10.0..10.0_f64, -10.0..10.0_f64, nasty_angle()).prop_map(|(x, y, phi)| Se2::new(x, y, phi))
}

/// Central differences of a vector function with a step balanced between truncation and rounding.
fn numeric_jacobian<const M: usize, const N: usize>(
    at: &SVector<f64, N>,
    function: impl Fn(&SVector<f64, N>) -> SVector<f64, M>,
) -> SMatrix<f64, M, N> {
    let step = 1e-5;
    let mut jacobian = SMatrix::<f64, M, N>::zeros();
    for j in 0..N {
        let mut plus = *at;
        let mut minus = *at;
        plus[j] += step;
        minus[j] -= step;
        jacobian.set_column(j, &((function(&plus) - function(&minus)) / (2.0 * step)));
    }
    jacobian
}

fn close2(a: &Se2, b: &Se2, tolerance: f64) -> bool {
    (a.x - b.x).abs() <= tolerance
        && (a.y - b.y).abs() <= tolerance
        && wrap(a.phi - b.phi).abs() <= tolerance
}

proptest! {
    #![proptest_config(config(400))]

    #[test]
    fn se2_group_laws(a in se2(), b in se2(), px in -5.0..5.0_f64, py in -5.0..5.0_f64) {
        let point = Vector2::new(px, py);
        prop_assert!(close2(&a.compose(&a.inverse()), &Se2::identity(), 1e-13));
        prop_assert!(close2(&a.compose(&a.between(&b)), &b, 1e-13));
        let twice = a.act(&b.act(&point));
        prop_assert!((a.compose(&b).act(&point) - twice).norm() < 1e-13);
        prop_assert!(a.compose(&b).phi > -PI && a.compose(&b).phi <= PI);
    }

    #[test]
    fn se2_exp_log_round_trip(a in se2()) {
        prop_assert!(close2(&Se2::exp(&a.log()), &a, 1e-13));
    }

    #[test]
    fn se2_adjoint_moves_twists(a in se2(), vx in -1.0..1.0_f64, vy in -1.0..1.0_f64, w in -1.0..1.0_f64) {
        let twist = Vector3::new(vx, vy, w);
        let left = Se2::exp(&(a.adjoint() * twist)).compose(&a);
        let right = a.compose(&Se2::exp(&twist));
        prop_assert!(close2(&left, &right, 1e-12));
    }

    #[test]
    fn se2_jacobians_match_differences(vx in -3.0..3.0_f64, vy in -3.0..3.0_f64, w in nasty_angle()) {
        let twist = Vector3::new(vx, vy, w);
        let base = Se2::exp(&twist);
        let right = numeric_jacobian(&twist, |t| base.between(&Se2::exp(t)).log());
        prop_assert!((Se2::right_jacobian(&twist) - right).amax() < 1e-8);
        let left = numeric_jacobian(&twist, |t| Se2::exp(t).compose(&base.inverse()).log());
        prop_assert!((Se2::left_jacobian(&twist) - left).amax() < 1e-8);
    }

    #[test]
    fn so3_exp_log_round_trip(w in rotation_vector()) {
        let rotation = so3::exp(&w);
        let orthonormal = rotation.matrix().transpose() * rotation.matrix();
        prop_assert!((orthonormal - Matrix3::identity()).amax() < 2e-15);
        prop_assert!((rotation.matrix() - Rotation3::new(w).matrix()).amax() < 2e-15);
        let back = so3::log(&rotation);
        // Half a turn has two logarithms.
        let error = (back - w).norm().min(if w.norm() > PI - 1e-6 { (back + w).norm() } else { f64::INFINITY });
        prop_assert!(error < 1e-14 * 10.0, "{w} {back}");
        // A tiny rotation keeps its relative precision, as acos((trace - 1) / 2) would not.
        if w.norm() < 1e-3 {
            prop_assert!((back - w).norm() <= 1e-12 * w.norm());
        }
    }

    #[test]
    fn so3_jacobians_match_differences(w in rotation_vector()) {
        let base = so3::exp(&w);
        let left = numeric_jacobian(&w, |t| so3::log(&(so3::exp(t) * base.inverse())));
        prop_assert!((so3::left_jacobian(&w) - left).amax() < 1e-8);
        let right = numeric_jacobian(&w, |t| so3::log(&(base.inverse() * so3::exp(t))));
        prop_assert!((so3::right_jacobian(&w) - right).amax() < 1e-8);
        let product = so3::left_jacobian(&w) * so3::left_jacobian_inverse(&w);
        prop_assert!((product - Matrix3::identity()).amax() < 1e-14);
    }

    #[test]
    fn se3_group_laws_and_jacobians(
        w in rotation_vector(), v in rotation_vector(),
        t in (-5.0..5.0_f64, -5.0..5.0_f64, -5.0..5.0_f64),
        p in (-5.0..5.0_f64, -5.0..5.0_f64, -5.0..5.0_f64),
    ) {
        let a = Se3::new(so3::exp(&w), Vector3::new(t.0, t.1, t.2));
        let b = Se3::new(so3::exp(&v), Vector3::new(p.2, p.0, t.1));
        let point = Vector3::new(p.0, p.1, p.2);
        let twice = a.transform_point(&b.transform_point(&point));
        prop_assert!((a.compose(&b).transform_point(&point) - twice).norm() < 1e-13);
        prop_assert!((a.inverse().transform_point(&a.transform_point(&point)) - point).norm() < 1e-13);
        let again = Se3::exp(&a.log());
        prop_assert!((again.rotation.matrix() - a.rotation.matrix()).amax() < 1e-13);
        prop_assert!((again.translation - a.translation).norm() < 1e-12);

        let zero = Vector6::zeros();
        let forward = numeric_jacobian(&zero, |d| a.compose(&Se3::exp(d)).transform_point(&point));
        prop_assert!((a.point_jacobian(&point) - forward).amax() < 1e-8);
        let backward = numeric_jacobian(&zero, |d| a.compose(&Se3::exp(d)).inverse().transform_point(&point));
        prop_assert!((a.inverse_point_jacobian(&point) - backward).amax() < 1e-8);

        let twist = Vector6::new(0.1, -0.2, 0.3, 0.2, 0.1, -0.3);
        let left = Se3::exp(&(a.adjoint() * twist)).compose(&a);
        let right = a.compose(&Se3::exp(&twist));
        prop_assert!((left.rotation.matrix() - right.rotation.matrix()).amax() < 1e-13);
        prop_assert!((left.translation - right.translation).norm() < 1e-12);
    }

    #[test]
    fn tilted_body_is_the_product_of_three_turns(roll in nasty_angle(), pitch in nasty_angle(), pose in se2()) {
        let product = Rotation3::from_axis_angle(&Vector3::z_axis(), pose.phi)
            * Rotation3::from_axis_angle(&Vector3::y_axis(), pitch)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), roll);
        let body = world_from_tilted_body(&pose, roll, pitch, 0.4);
        prop_assert!((body.rotation.matrix() - product.matrix()).amax() < 1e-15 * 4.0);
        prop_assert_eq!(body.translation, Vector3::new(pose.x, pose.y, 0.4));
    }
}

#[test]
fn quarter_circle() {
    let pose = Se2::exp(&Vector3::new(FRAC_PI_2, 0.0, FRAC_PI_2));
    assert!(close2(&pose, &Se2::new(1.0, 1.0, FRAC_PI_2), 1e-15));
}

#[test]
fn forward_mount_looks_along_body_x() {
    let camera = Mount::forward().world_from_camera(&Se2::identity(), 0.0, 0.0, 0.0);
    // Two metres ahead, one to the left, half a metre up.
    let point = camera
        .inverse()
        .transform_point(&Vector3::new(2.0, 1.0, 0.5));
    assert_eq!(point, Vector3::new(-1.0, -0.5, 2.0));
    // Nose down: a point ahead rises in the camera (smaller y).
    let down = Mount::forward().world_from_camera(&Se2::identity(), 0.0, 0.1, 0.0);
    assert!(down.inverse().transform_point(&Vector3::x()).y < -0.05);
}

#[test]
fn lever_arm_turns_with_the_body() {
    let mount = Mount::new(
        Mount::forward().body_from_camera.rotation.matrix(),
        &Vector3::new(0.1, 0.0, 0.3),
    )
    .unwrap();
    let camera = mount.world_from_camera(&Se2::new(1.0, 2.0, FRAC_PI_2), 0.0, 0.0, 0.0);
    assert!((camera.translation - Vector3::new(1.0, 2.1, 0.3)).norm() < 1e-15);
}

#[test]
fn mount_refuses_what_is_not_a_rotation() {
    let good = *Mount::forward().body_from_camera.rotation.matrix();
    let zero = Vector3::zeros();
    let rounded = so3::exp(&Vector3::new(0.3, -1.2, 0.8))
        .matrix()
        .map(|v| (v * 1e6).round() / 1e6);
    let mount = Mount::new(&rounded, &zero).unwrap();
    let exact = mount.body_from_camera.rotation;
    assert!((exact.matrix().transpose() * exact.matrix() - Matrix3::identity()).amax() < 4e-15);
    assert!((exact.matrix() - rounded).amax() < 2e-6);

    let mut reflected = good;
    reflected.column_mut(0).neg_mut();
    assert!(Mount::new(&reflected, &zero).is_err());
    assert!(Mount::new(&(good * 1.001), &zero).is_err());
    assert!(Mount::new(&Matrix3::zeros(), &zero).is_err());
    assert!(Mount::new(&good.map(|v| if v == 1.0 { f64::NAN } else { v }), &zero).is_err());
    assert!(Mount::new(&good, &Vector3::new(0.0, f64::INFINITY, 0.0)).is_err());
}
