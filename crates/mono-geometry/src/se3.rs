//! Rigid motions of space SE(3): camera poses.
//!
//! `a_from_b` maps points of frame b to frame a, p -> R p + t. A twist is (rho, omega), translation first as in
//! [`crate::Se2`]: exp(rho, omega) = (exp(omega), J_l(omega) rho). Perturbations are taken at the right,
//! pose = mean * exp(delta), so delta lives in the axes of the source frame (the camera's own axes for
//! `world_from_camera`). Formulas: Solà, Deray and Atchuthan (2018).

use estimation_base::Manifold;
use estimation_base::series::x_minus_sin_over_x3;
use nalgebra::{
    Isometry3, IsometryMatrix3, Matrix3, Matrix3x6, Matrix6, Rotation3, UnitQuaternion, Vector3,
    Vector6,
};

use crate::series::{fifth_order_quotient, fourth_order_quotient};
use crate::so3;

/// A rigid motion; metres. The rotation type keeps the matrix orthonormal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Se3 {
    /// Rotation from the source to the destination axes.
    pub rotation: Rotation3<f64>,
    /// Origin of the source frame in destination axes, metres.
    pub translation: Vector3<f64>,
}

impl Default for Se3 {
    fn default() -> Self {
        Self::identity()
    }
}

impl Se3 {
    /// The motion that does nothing.
    #[must_use]
    pub fn identity() -> Self {
        Self {
            rotation: Rotation3::identity(),
            translation: Vector3::zeros(),
        }
    }

    /// A motion from its rotation and translation.
    #[must_use]
    pub fn new(rotation: Rotation3<f64>, translation: Vector3<f64>) -> Self {
        Self {
            rotation,
            translation,
        }
    }

    /// Motion of a twist (rho, omega) held for unit time. O(1).
    #[must_use]
    pub fn exp(twist: &Vector6<f64>) -> Self {
        let (rho, omega) = split(twist);
        Self {
            rotation: so3::exp(&omega),
            translation: so3::left_jacobian(&omega) * rho,
        }
    }

    /// The twist with rotation angle at most pi whose [`Self::exp`] is this motion. O(1).
    #[must_use]
    pub fn log(&self) -> Vector6<f64> {
        let omega = so3::log(&self.rotation);
        let rho = so3::left_jacobian_inverse(&omega) * self.translation;
        Vector6::new(rho.x, rho.y, rho.z, omega.x, omega.y, omega.z)
    }

    /// `a_from_b.compose(&b_from_c)` is `a_from_c`.
    #[must_use]
    pub fn compose(&self, other: &Self) -> Self {
        Self {
            rotation: self.rotation * other.rotation,
            translation: self.transform_point(&other.translation),
        }
    }

    /// `b_from_a` of `a_from_b`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.inverse();
        Self {
            rotation,
            translation: -(rotation * self.translation),
        }
    }

    /// Maps a point of the source frame to the destination frame.
    #[must_use]
    pub fn transform_point(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation * point + self.translation
    }

    /// Derivative of `self * exp(delta) * point` with respect to delta = (rho, omega) at zero (3x6).
    #[must_use]
    pub fn point_jacobian(&self, point: &Vector3<f64>) -> Matrix3x6<f64> {
        let rotation = self.rotation.matrix();
        let mut jacobian = Matrix3x6::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation);
        jacobian
            .fixed_view_mut::<3, 3>(0, 3)
            .copy_from(&(-rotation * so3::hat(point)));
        jacobian
    }

    /// Derivative of `(self * exp(delta))^-1 * point` with respect to delta = (rho, omega) at zero (3x6): how a point
    /// moves in the camera when `world_from_camera` is perturbed in the camera's axes.
    #[must_use]
    pub fn inverse_point_jacobian(&self, point: &Vector3<f64>) -> Matrix3x6<f64> {
        let local = self.rotation.inverse() * (point - self.translation);
        let mut jacobian = Matrix3x6::zeros();
        jacobian
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&-Matrix3::identity());
        jacobian
            .fixed_view_mut::<3, 3>(0, 3)
            .copy_from(&so3::hat(&local));
        jacobian
    }

    /// Adjoint: exp(Ad twist) = self * exp(twist) * self^-1 (6x6).
    #[must_use]
    pub fn adjoint(&self) -> Matrix6<f64> {
        let rotation = self.rotation.matrix();
        let mut adjoint = Matrix6::zeros();
        adjoint.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation);
        adjoint.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation);
        adjoint
            .fixed_view_mut::<3, 3>(0, 3)
            .copy_from(&(so3::hat(&self.translation) * rotation));
        adjoint
    }

    /// Left Jacobian: exp(twist + d) = exp(J_l d) exp(twist) to first order in d (6x6); Barfoot (2017), equation 7.85.
    #[must_use]
    pub fn left_jacobian(twist: &Vector6<f64>) -> Matrix6<f64> {
        let (rho, omega) = split(twist);
        blocks(&so3::left_jacobian(&omega), &coupling(&rho, &omega))
    }

    /// Right Jacobian: exp(twist + d) = exp(twist) exp(J_r d) to first order in d (6x6).
    #[must_use]
    pub fn right_jacobian(twist: &Vector6<f64>) -> Matrix6<f64> {
        Self::left_jacobian(&-twist)
    }

    /// Inverse of [`Self::left_jacobian`]; exists for |omega| < 2 pi, which covers every value of [`Self::log`].
    #[must_use]
    pub fn left_jacobian_inverse(twist: &Vector6<f64>) -> Matrix6<f64> {
        let (rho, omega) = split(twist);
        let inverse = so3::left_jacobian_inverse(&omega);
        blocks(&inverse, &-(inverse * coupling(&rho, &omega) * inverse))
    }

    /// Inverse of [`Self::right_jacobian`]; exists for |omega| < 2 pi.
    #[must_use]
    pub fn right_jacobian_inverse(twist: &Vector6<f64>) -> Matrix6<f64> {
        Self::left_jacobian_inverse(&-twist)
    }
}

/// The tangent is at the right: delta = (rho, omega) in the axes of the source frame.
/// The same motion; the rotation is copied, not computed.
impl From<IsometryMatrix3<f64>> for Se3 {
    fn from(isometry: IsometryMatrix3<f64>) -> Self {
        Self::new(isometry.rotation, isometry.translation.vector)
    }
}

/// The same motion; the rotation is copied, not computed.
impl From<Se3> for IsometryMatrix3<f64> {
    fn from(motion: Se3) -> Self {
        Self::from_parts(motion.translation.into(), motion.rotation)
    }
}

/// The same motion, up to the rounding of quaternion to matrix.
///
/// ```
/// use mono_geometry::Se3;
/// use mono_geometry::nalgebra::{Isometry3, Point3, Vector3};
///
/// let isometry = Isometry3::new(Vector3::new(1.0, 2.0, 3.0), Vector3::new(0.1, -0.2, 0.3));
/// let motion = Se3::from(isometry);
/// let point = Vector3::new(0.5, 0.0, -1.0);
/// let moved = isometry.transform_point(&Point3::from(point)).coords;
/// assert!((motion.transform_point(&point) - moved).norm() < 1e-14);
/// let back = Isometry3::from(motion);
/// assert!((back.inverse() * isometry).rotation.angle() < 1e-14);
/// ```
impl From<Isometry3<f64>> for Se3 {
    fn from(isometry: Isometry3<f64>) -> Self {
        Self::new(
            isometry.rotation.to_rotation_matrix(),
            isometry.translation.vector,
        )
    }
}

/// The same motion, up to the rounding of matrix to quaternion.
impl From<Se3> for Isometry3<f64> {
    fn from(motion: Se3) -> Self {
        let rotation = UnitQuaternion::from_rotation_matrix(&motion.rotation);
        Self::from_parts(motion.translation.into(), rotation)
    }
}

impl Manifold<6> for Se3 {
    fn retract(&self, delta: &Vector6<f64>) -> Self {
        let mut moved = self.compose(&Self::exp(delta));
        // Many products of rotations drift off the group by rounding; one Newton step on R^T R = I takes it out.
        moved.rotation.renormalize();
        moved
    }

    /// log(self^-1 * other), of a rotation of at most pi.
    fn local(&self, other: &Self) -> Vector6<f64> {
        self.inverse().compose(other).log()
    }
}

/// ((a, b), (0, a)) of 3x3 blocks.
fn blocks(a: &Matrix3<f64>, b: &Matrix3<f64>) -> Matrix6<f64> {
    let mut all = Matrix6::zeros();
    all.fixed_view_mut::<3, 3>(0, 0).copy_from(a);
    all.fixed_view_mut::<3, 3>(3, 3).copy_from(a);
    all.fixed_view_mut::<3, 3>(0, 3).copy_from(b);
    all
}

/// The matrix Q of Barfoot (2017), equation 7.86b: how a turn bends the translation beside it.
fn coupling(rho: &Vector3<f64>, omega: &Vector3<f64>) -> Matrix3<f64> {
    let angle = omega.norm();
    let (r, w) = (so3::hat(rho), so3::hat(omega));
    let (rw, wr) = (r * w, w * r);
    let wrw = wr * w;
    r * 0.5
        + (wr + rw + wrw) * x_minus_sin_over_x3(angle)
        + (w * wr + rw * w - wrw * 3.0) * fourth_order_quotient(angle)
        + (wrw * w + w * wrw) * fifth_order_quotient(angle)
}

fn split(twist: &Vector6<f64>) -> (Vector3<f64>, Vector3<f64>) {
    (
        Vector3::new(twist[0], twist[1], twist[2]),
        Vector3::new(twist[3], twist[4], twist[5]),
    )
}
