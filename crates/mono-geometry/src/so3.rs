//! Rotations of space SO(3): exponential map, logarithm and their Jacobians.
//!
//! A rotation vector w (radians, axis times angle) and the rotation `exp([w]x)` by Rodrigues' formula. The logarithm goes
//! through the unit quaternion, 2 atan2(|q_v|, q_w) q_v / |q_v|, which keeps full precision near zero and near half a
//! turn, where the textbook acos((tr R - 1) / 2) loses half the digits. At exactly half a turn the axis has two signs;
//! either is right. Formulas: Solà, Deray and Atchuthan (2018); Barfoot (2017).

use estimation_base::series::{sinc, versine_over_x2, x_minus_sin_over_x3};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::error::GeometryError;
use crate::linalg::nearest_rotation;
use crate::series::inverse_jacobian_coefficient;

/// Largest entry of |R^T R - I| accepted from outside.
///
/// A matrix written with six decimals has errors up to 5e-7 an entry, hence up to 2 sqrt(3) 5e-7 = 1.8e-6 here.
pub const ROTATION_TOLERANCE: f64 = 2e-6;

/// Skew-symmetric matrix of a vector: `hat(a) * b` is the cross product a x b.
#[must_use]
pub fn hat(vector: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(
        0.0, -vector.z, vector.y, //
        vector.z, 0.0, -vector.x, //
        -vector.y, vector.x, 0.0,
    )
}

/// Rotation by a rotation vector, radians; any angle. O(1).
#[must_use]
pub fn exp(rotation_vector: &Vector3<f64>) -> Rotation3<f64> {
    // The half-angle quaternion is of unit norm to rounding, so the matrix is orthonormal to rounding.
    let half = 0.5 * rotation_vector.norm();
    let vector = rotation_vector * (0.5 * sinc(half));
    UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(
        half.cos(),
        vector.x,
        vector.y,
        vector.z,
    ))
    .to_rotation_matrix()
}

/// The rotation vector of length at most pi whose [`exp`] is the rotation. O(1).
#[must_use]
pub fn log(rotation: &Rotation3<f64>) -> Vector3<f64> {
    let quaternion = UnitQuaternion::from_rotation_matrix(rotation).into_inner();
    let sign = if quaternion.w < 0.0 { -1.0 } else { 1.0 };
    let vector = quaternion.imag() * sign;
    let sine = vector.norm();
    let angle = 2.0 * sine.atan2(quaternion.w * sign);
    if sine == 0.0 {
        return Vector3::zeros();
    }
    vector * (angle / sine)
}

/// Left Jacobian: exp(w + d) = exp(J_l d) exp(w) to first order in d.
#[must_use]
pub fn left_jacobian(rotation_vector: &Vector3<f64>) -> Matrix3<f64> {
    let angle = rotation_vector.norm();
    let skew = hat(rotation_vector);
    Matrix3::identity() + skew * versine_over_x2(angle) + skew * skew * x_minus_sin_over_x3(angle)
}

/// Right Jacobian: exp(w + d) = exp(w) exp(J_r d) to first order in d; the transpose of the left one.
#[must_use]
pub fn right_jacobian(rotation_vector: &Vector3<f64>) -> Matrix3<f64> {
    left_jacobian(rotation_vector).transpose()
}

/// Inverse of [`left_jacobian`]; exists for angles below 2 pi, which covers every value of [`log`].
#[must_use]
pub fn left_jacobian_inverse(rotation_vector: &Vector3<f64>) -> Matrix3<f64> {
    let skew = hat(rotation_vector);
    Matrix3::identity() - skew * 0.5
        + skew * skew * inverse_jacobian_coefficient(rotation_vector.norm())
}

/// Inverse of [`right_jacobian`]; exists for angles below 2 pi.
#[must_use]
pub fn right_jacobian_inverse(rotation_vector: &Vector3<f64>) -> Matrix3<f64> {
    left_jacobian_inverse(rotation_vector).transpose()
}

/// Checks that a matrix read from outside is a proper rotation, and returns the nearest exact one.
///
/// # Errors
/// [`GeometryError::NotARotation`] if an entry of `R^T R - I` exceeds [`ROTATION_TOLERANCE`], or the determinant is
/// negative (a reflection, or axes in the wrong order), or an entry is not finite.
pub fn rotation_from_matrix(matrix: &Matrix3<f64>) -> Result<Rotation3<f64>, GeometryError> {
    let excess = matrix.transpose() * matrix - Matrix3::identity();
    // NaN must not pass: a fold with max() would drop it.
    let deviation = if excess.iter().any(|v| v.is_nan()) {
        f64::NAN
    } else {
        excess.amax()
    };
    let determinant = matrix.determinant();
    if deviation <= ROTATION_TOLERANCE && determinant > 0.0 {
        nearest_rotation(matrix)
    } else {
        Err(GeometryError::NotARotation {
            deviation,
            tolerance: ROTATION_TOLERANCE,
            determinant,
        })
    }
}
