//! Planar rigid motions SE(2): robot poses and odometry increments.
//!
//! A pose (x, y, phi) named `world_from_body` maps body points to the world, p -> R(phi) p + (x, y). The exponential
//! map turns a body twist (vx, vy, w) held for unit time into the motion it makes, exactly: the arc of Thrun, Burgard
//! and Fox (2005, 5.3) with the sideways component included. Formulas after Solà, Deray and Atchuthan (2018), with the
//! quotients of small angles evaluated without cancellation.
//!
//! Uncertainty is kept in the tangent at the right: pose = mean * exp(delta), delta = (dx, dy, dphi) in the body axes
//! of the mean. This is the retraction of the [`Manifold`] implementation.

use nalgebra::{ComplexField, Matrix3, Vector2, Vector3};

use crate::angle::wrap;
use crate::manifold::Manifold;
use crate::real::Real;
use crate::series::{sinc, versine_over_x, versine_over_x2, x_minus_sin_over_x3};

/// A pose or motion in the plane; metres and radians.
///
/// As a [`Manifold`] its tangent is the body's own motion (forward, left, turn): `retract` drives along the arc that the
/// tangent names, `self * exp(tangent)`, and `local` finds the arc, `log(self^-1 * other)`.
///
/// ```
/// use estimation_base::nalgebra::Vector2;
/// use estimation_base::{Manifold, Se2};
/// use std::f64::consts::FRAC_PI_2;
///
/// let world_from_robot = Se2::new(1.0, 2.0, FRAC_PI_2);
/// let ahead = world_from_robot.act(&Vector2::new(3.0, 0.0));
/// assert!((ahead - Vector2::new(1.0, 5.0)).norm() < 1e-12);
/// let moved = world_from_robot.compose(&Se2::new(3.0, 0.0, 0.0));
/// assert!((world_from_robot.local(&moved).x - 3.0).abs() < 1e-12);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Se2<T> {
    /// Translation along x, metres.
    pub x: T,
    /// Translation along y, metres.
    pub y: T,
    /// Rotation, radians. Any finite value is legal; every operation here returns it in (-pi, pi].
    pub phi: T,
}

impl<T: Real> Se2<T> {
    /// The motion that does nothing.
    #[must_use]
    pub fn identity() -> Self {
        Self::default()
    }

    /// A motion from its translation and rotation; the rotation is wrapped.
    #[must_use]
    pub fn new(x: T, y: T, phi: T) -> Self {
        Self {
            x,
            y,
            phi: wrap(phi),
        }
    }

    /// Motion of a twist (vx, vy, w) held for unit time; metres, metres, radians. O(1).
    #[must_use]
    pub fn exp(twist: &Vector3<T>) -> Self {
        let sine = sinc(twist.z);
        let versine = versine_over_x(twist.z);
        Self::new(
            sine * twist.x - versine * twist.y,
            versine * twist.x + sine * twist.y,
            twist.z,
        )
    }

    /// The twist with |w| <= pi whose [`Self::exp`] is this motion. Defined everywhere, also at half a turn. O(1).
    #[must_use]
    pub fn log(&self) -> Vector3<T> {
        let phi = wrap(self.phi);
        let half = T::of(0.5) * phi;
        // (phi / 2) cot(phi / 2): |phi| <= pi keeps the sinc at or above 2 / pi.
        let cotangent = ComplexField::cos(half) / sinc(half);
        Vector3::new(
            cotangent * self.x + half * self.y,
            -half * self.x + cotangent * self.y,
            phi,
        )
    }

    /// `a_from_b.compose(&b_from_c)` is `a_from_c`.
    #[must_use]
    pub fn compose(&self, other: &Self) -> Self {
        let translation = self.act(&Vector2::new(other.x, other.y));
        Self::new(translation.x, translation.y, self.phi + other.phi)
    }

    /// `b_from_a` of `a_from_b`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let (sine, cosine) = ComplexField::sin_cos(self.phi);
        Self::new(
            -(cosine * self.x + sine * self.y),
            sine * self.x - cosine * self.y,
            -self.phi,
        )
    }

    /// The motion from this pose to `other`: `self.inverse().compose(other)`.
    #[must_use]
    pub fn between(&self, other: &Self) -> Self {
        self.inverse().compose(other)
    }

    /// Maps a point.
    #[must_use]
    pub fn act(&self, point: &Vector2<T>) -> Vector2<T> {
        let (sine, cosine) = ComplexField::sin_cos(self.phi);
        Vector2::new(
            cosine * point.x - sine * point.y + self.x,
            sine * point.x + cosine * point.y + self.y,
        )
    }

    /// Adjoint: exp(Ad twist) = self * exp(twist) * self^-1. For a covariance in the tangent: Ad P Ad^T.
    #[must_use]
    pub fn adjoint(&self) -> Matrix3<T> {
        let (sine, cosine) = ComplexField::sin_cos(self.phi);
        Matrix3::new(
            cosine,
            -sine,
            self.y, //
            sine,
            cosine,
            -self.x, //
            T::zero(),
            T::zero(),
            T::one(),
        )
    }

    /// Left Jacobian: exp(twist + d) = exp(J_l d) exp(twist) to first order in d.
    #[must_use]
    pub fn left_jacobian(twist: &Vector3<T>) -> Matrix3<T> {
        Self::right_jacobian(&-twist)
    }

    /// Right Jacobian: exp(twist + d) = exp(twist) exp(J_r d) to first order in d.
    #[must_use]
    pub fn right_jacobian(twist: &Vector3<T>) -> Matrix3<T> {
        let w = twist.z;
        let sine = sinc(w);
        let versine = versine_over_x(w);
        let versine2 = versine_over_x2(w);
        // (w - sin w) / w^2
        let remainder = w * x_minus_sin_over_x3(w);
        Matrix3::new(
            sine,
            versine,
            twist.x * remainder - twist.y * versine2,
            -versine,
            sine,
            twist.x * versine2 + twist.y * remainder,
            T::zero(),
            T::zero(),
            T::one(),
        )
    }

    /// Inverse of [`Self::right_jacobian`]; exists for |w| < 2 pi, which covers every value of [`Self::log`].
    #[must_use]
    pub fn right_jacobian_inverse(twist: &Vector3<T>) -> Matrix3<T> {
        let w = twist.z;
        // The upper left block is sinc(w / 2) times the rotation by -w / 2.
        let half = T::of(0.5) * w;
        let cotangent = ComplexField::cos(half) / sinc(half);
        let versine2 = versine_over_x2(w);
        let remainder = w * x_minus_sin_over_x3(w);
        let bx = twist.x * remainder - twist.y * versine2;
        let by = twist.x * versine2 + twist.y * remainder;
        Matrix3::new(
            cotangent,
            -half,
            half * by - cotangent * bx,
            half,
            cotangent,
            -half * bx - cotangent * by,
            T::zero(),
            T::zero(),
            T::one(),
        )
    }

    /// Inverse of [`Self::left_jacobian`]; exists for |w| < 2 pi.
    #[must_use]
    pub fn left_jacobian_inverse(twist: &Vector3<T>) -> Matrix3<T> {
        Self::right_jacobian_inverse(&-twist)
    }
}

impl<T: Real> Manifold<3, T> for Se2<T> {
    fn retract(&self, tangent: &Vector3<T>) -> Self {
        self.compose(&Self::exp(tangent))
    }

    fn local(&self, other: &Self) -> Vector3<T> {
        self.between(other).log()
    }
}
