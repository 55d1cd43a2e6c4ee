//! SE(2), SO(3), SE(3): the naive formula is the power series of the matrix exponential.
//!
//! With M = exp(hat(xi)) and dM its derivative along one coordinate of xi, the right Jacobian's column is
//! vee(M^-1 dM), the left one's vee(dM M^-1): the definition, without a logarithm.

use std::f64::consts::PI;

use estimation_base::Manifold;
use mono_geometry::{Se2, Se3, so3};
use nalgebra::{Matrix3, Matrix4, Matrix6, SMatrix, SVector, Vector3, Vector6};
use proptest::prelude::*;

use super::dual::{Dual, DualMatrix, exponential};
use crate::common::{config, nasty_angle, rotation_vector};

fn translation() -> impl Strategy<Value = Vector3<f64>> {
    prop_oneof![
        Just(Vector3::zeros()),
        Just(Vector3::new(1e-12, 0.0, -1e-9)),
        (-5.0..5.0_f64, -5.0..5.0_f64, -5.0..5.0_f64).prop_map(|(x, y, z)| Vector3::new(x, y, z)),
    ]
}

const O: Dual = Dual {
    value: 0.0,
    slope: 0.0,
};

fn hat2(t: &[Dual]) -> DualMatrix<3> {
    [[O, -t[2], t[0]], [t[2], O, t[1]], [O, O, O]]
}

pub(crate) fn hat3(w: &[Dual]) -> DualMatrix<3> {
    [[O, -w[2], w[1]], [w[2], O, -w[0]], [-w[1], w[0], O]]
}

pub(crate) fn hat6(t: &[Dual]) -> DualMatrix<4> {
    [
        [O, -t[5], t[4], t[0]],
        [t[5], O, -t[3], t[1]],
        [-t[4], t[3], O, t[2]],
        [O, O, O, O],
    ]
}

fn parts<const N: usize>(matrix: &DualMatrix<N>) -> (SMatrix<f64, N, N>, SMatrix<f64, N, N>) {
    (
        SMatrix::from_fn(|i, j| matrix[i][j].value),
        SMatrix::from_fn(|i, j| matrix[i][j].slope),
    )
}

fn vee2(m: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(m[(0, 2)], m[(1, 2)], m[(1, 0)])
}

fn vee3(m: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(m[(2, 1)], m[(0, 2)], m[(1, 0)])
}

fn vee6(m: &Matrix4<f64>) -> Vector6<f64> {
    Vector6::new(
        m[(0, 3)],
        m[(1, 3)],
        m[(2, 3)],
        m[(2, 1)],
        m[(0, 2)],
        m[(1, 0)],
    )
}

/// Left and right Jacobian by dual numbers.
fn by_dual<const N: usize, const D: usize>(
    at: &SVector<f64, D>,
    hat: impl Fn(&[Dual]) -> DualMatrix<N>,
    vee: impl Fn(&SMatrix<f64, N, N>) -> SVector<f64, D>,
) -> (SMatrix<f64, D, D>, SMatrix<f64, D, D>) {
    // exp(-xi) is the inverse, without a matrix inversion.
    let (inverse, _) = parts(&exponential(&hat(&Dual::seeded((-at).as_slice(), D))));
    let mut left = SMatrix::<f64, D, D>::zeros();
    let mut right = SMatrix::<f64, D, D>::zeros();
    for j in 0..D {
        let (_, slope) = parts(&exponential(&hat(&Dual::seeded(at.as_slice(), j))));
        left.set_column(j, &vee(&(slope * inverse)));
        right.set_column(j, &vee(&(inverse * slope)));
    }
    (left, right)
}

fn by_differences<const M: usize, const D: usize>(
    at: &SVector<f64, D>,
    function: impl Fn(&SVector<f64, D>) -> SVector<f64, M>,
) -> SMatrix<f64, M, D> {
    let step = 1e-5;
    let mut jacobian = SMatrix::<f64, M, D>::zeros();
    for j in 0..D {
        let mut delta = SVector::<f64, D>::zeros();
        delta[j] = step;
        jacobian.set_column(
            j,
            &((function(&(at + delta)) - function(&(at - delta))) / (2.0 * step)),
        );
    }
    jacobian
}

fn twist6(rho: &Vector3<f64>, omega: &Vector3<f64>) -> Vector6<f64> {
    Vector6::new(rho.x, rho.y, rho.z, omega.x, omega.y, omega.z)
}

proptest! {
    #![proptest_config(config(300))]

    // Differences and inverses of these Jacobians are tested where they stand, in estimation-base.
    #[test]
    fn se2(vx in -3.0..3.0_f64, vy in -3.0..3.0_f64, w in nasty_angle()) {
        let twist = Vector3::new(vx, vy, w);
        let (left, right) = by_dual(&twist, hat2, vee2);
        prop_assert!((Se2::left_jacobian(&twist) - left).amax() < 1e-13);
        prop_assert!((Se2::right_jacobian(&twist) - right).amax() < 1e-13);
    }

    #[test]
    fn so3_(w in rotation_vector()) {
        let (left, right) = by_dual(&w, hat3, vee3);
        prop_assert!((so3::left_jacobian(&w) - left).amax() < 1e-13);
        prop_assert!((so3::right_jacobian(&w) - right).amax() < 1e-13);
        let base = so3::exp(&w);
        let right = by_differences(&w, |t| so3::log(&(base.inverse() * so3::exp(t))));
        prop_assert!((so3::right_jacobian(&w) - right).amax() < 1e-8);
        let left = by_differences(&w, |t| so3::log(&(so3::exp(t) * base.inverse())));
        prop_assert!((so3::left_jacobian(&w) - left).amax() < 1e-8);

        let one = Matrix3::identity();
        prop_assert!((so3::left_jacobian(&w) * so3::left_jacobian_inverse(&w) - one).amax() < 1e-13);
        prop_assert!((so3::right_jacobian(&w) * so3::right_jacobian_inverse(&w) - one).amax() < 1e-13);
        prop_assert!((*base.matrix() * so3::right_jacobian(&w) - so3::left_jacobian(&w)).amax() < 1e-13);
        if w.norm() < 3.1 {
            let log = by_differences(&Vector3::zeros(), |d| so3::log(&(base * so3::exp(d))));
            prop_assert!((so3::right_jacobian_inverse(&w) - log).amax() < 1e-7);
        }
    }

    #[test]
    fn se3(rho in translation(), w in rotation_vector(), point in translation()) {
        let twist = twist6(&rho, &w);
        let (left, right) = by_dual(&twist, hat6, vee6);
        prop_assert!((Se3::left_jacobian(&twist) - left).amax() < 1e-13);
        prop_assert!((Se3::right_jacobian(&twist) - right).amax() < 1e-13);
        let base = Se3::exp(&twist);
        let right = by_differences(&twist, |t| base.local(&Se3::exp(t)));
        prop_assert!((Se3::right_jacobian(&twist) - right).amax() < 1e-7);
        let left = by_differences(&twist, |t| Se3::exp(t).compose(&base.inverse()).log());
        prop_assert!((Se3::left_jacobian(&twist) - left).amax() < 1e-7);

        let one = Matrix6::identity();
        prop_assert!((Se3::left_jacobian(&twist) * Se3::left_jacobian_inverse(&twist) - one).amax() < 1e-13);
        prop_assert!((Se3::right_jacobian(&twist) * Se3::right_jacobian_inverse(&twist) - one).amax() < 1e-13);
        prop_assert!((base.adjoint() * Se3::right_jacobian(&twist) - Se3::left_jacobian(&twist)).amax() < 1e-12);
        if w.norm() < 3.1 {
            let log = by_differences(&Vector6::zeros(), |d| base.retract(d).log());
            prop_assert!((Se3::right_jacobian_inverse(&twist) - log).amax() < 1e-6);
        }

        // A point under self * exp(delta), and under its inverse.
        let (matrix, _) = parts(&exponential(&hat6(&Dual::seeded(twist.as_slice(), 6))));
        let (inverse, _) = parts(&exponential(&hat6(&Dual::seeded((-twist).as_slice(), 6))));
        for j in 0..6 {
            let (_, forward) = parts(&exponential(&hat6(&Dual::seeded(&[0.0; 6], j))));
            let moved = (matrix * forward * point.push(1.0)).xyz();
            prop_assert!((base.point_jacobian(&point).column(j) - moved).amax() < 1e-13);
            let moved = (-forward * inverse * point.push(1.0)).xyz();
            prop_assert!((base.inverse_point_jacobian(&point).column(j) - moved).amax() < 1e-12);
        }
    }

    /// plus and minus undo each other, at half a turn too (where the delta may come back with the other sign).
    #[test]
    fn retractions(rho in translation(), w in rotation_vector(), v in rotation_vector(), x in translation()) {
        let base = Se3::exp(&twist6(&x, &v));
        let delta = twist6(&rho, &w);
        let there = base.retract(&delta);
        let again = base.retract(&base.local(&there));
        prop_assert!((again.rotation.matrix() - there.rotation.matrix()).amax() < 1e-13);
        prop_assert!((again.translation - there.translation).norm() < 1e-12);
        prop_assert!(base.local(&base).norm() < 1e-14);
        if w.norm() < PI - 1e-6 {
            prop_assert!((base.local(&there) - delta).norm() < 1e-11);
        }
        let rotation = base.rotation * so3::exp(&w);
        let back = base.rotation * so3::exp(&so3::log(&(base.rotation.inverse() * rotation)));
        prop_assert!((back.matrix() - rotation.matrix()).amax() < 1e-14);
        // exp(Ad w) R = R exp(w).
        let left = so3::exp(&(base.rotation * w)) * base.rotation;
        prop_assert!((left.matrix() - rotation.matrix()).amax() < 1e-14);

        let planar = Se2::new(x.x, x.y, v.z);
        let step = Vector3::new(rho.x, rho.y, w.z);
        let moved = planar.retract(&step);
        let again = planar.retract(&planar.local(&moved));
        prop_assert!((again.x - moved.x).abs().max((again.y - moved.y).abs()) < 1e-13);
        prop_assert!(estimation_base::wrap(again.phi - moved.phi).abs() < 1e-14);
    }
}

/// Without the coupling block the Jacobian is far off: the test above can fail.
#[test]
fn the_coupling_block_matters() {
    let twist = Vector6::new(1.0, -2.0, 0.5, 0.3, 0.8, -0.4);
    let (left, _) = by_dual(&twist, hat6, vee6);
    let block = left.fixed_view::<3, 3>(0, 3).into_owned();
    assert!(block.amax() > 0.5);
    // The sign of the third group of terms, which misprints get wrong.
    let (r, w) = (
        so3::hat(&twist.xyz()),
        so3::hat(&Vector3::new(0.3, 0.8, -0.4)),
    );
    assert!((w * w * r + r * w * w - w * r * w * 3.0).amax() > 1.0);
}
