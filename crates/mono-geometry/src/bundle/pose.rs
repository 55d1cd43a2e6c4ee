//! The two kinds of pose a bundle can hold: planar (SE(2), three degrees of freedom) and spatial (SE(3), six).
//!
//! A pose is `world_from_body`; the camera sits on the body at a known mount. Perturbations are at the right,
//! pose * exp(delta), in the body's axes. SE(2) lies in SE(3) as the motions with rho = (dx, dy, 0) and
//! omega = (0, 0, dphi), and the exponential maps agree there, so a planar derivative is columns 0, 1 and 5 of the
//! spatial one.
//!
//! A measured motion M between poses F and T leaves the error e = log(M^-1 F^-1 T), with
//!
//! > de / dT = J_r^-1(e),  de / dF = -J_r^-1(e) Ad((F^-1 T)^-1),
//!
//! because F exp(d) turns F^-1 T into exp(-d) F^-1 T = F^-1 T exp(-Ad((F^-1 T)^-1) d).
//!
//! Degenerate: log jumps where the rotation of the error is half a turn, so a start that is wrong by half a turn may
//! unwind the wrong way; J_r^-1 itself is regular there.
//!
//! Source: Solà, Deray and Atchuthan (2018), appendices on SE(2) and SE(3); Barfoot (2017), Eq. 7.86 and 7.95.

use estimation_base::{Manifold, Se2};
use nalgebra::{SMatrix, SVector, Vector3, Vector6};

use crate::se3::Se3;

/// A pose `world_from_body` with D degrees of freedom: [`Se2`] with D = 3, [`Se3`] with D = 6.
///
/// Its [`Manifold::retract`] is self * exp(delta).
pub trait BundlePose<const D: usize>: Manifold<D> + Copy + PartialEq + std::fmt::Debug {
    /// The motion from this pose to `other`: self^-1 * other.
    #[must_use]
    fn between(&self, other: &Self) -> Self;

    /// e = log(self) and the inverse right Jacobian there: log(self * exp(d)) = e + J_r^-1(e) d to first order.
    #[must_use]
    fn log_with_jacobian(&self) -> (SVector<f64, D>, SMatrix<f64, D, D>);

    /// Adjoint of the inverse: self^-1 * exp(d) * self = exp(Ad d).
    #[must_use]
    fn inverse_adjoint(&self) -> SMatrix<f64, D, D>;

    /// The pose in space.
    #[must_use]
    fn world_from_body(&self) -> Se3;

    /// row^T times the derivative of `(self * exp(delta))^-1 * point` by delta at zero, for a point in body axes.
    ///
    /// The derivative is (-I, hat(point)), so this is (-row, row x point) or the part of it that the plane allows.
    #[must_use]
    fn pull_back(row: &Vector3<f64>, point_in_body: &Vector3<f64>) -> SVector<f64, D>;

    /// Whether every number is finite.
    #[must_use]
    fn is_finite(&self) -> bool;
}

impl BundlePose<3> for Se2 {
    fn between(&self, other: &Self) -> Self {
        Self::between(self, other)
    }

    fn log_with_jacobian(&self) -> (SVector<f64, 3>, SMatrix<f64, 3, 3>) {
        let error = self.log();
        (error, Self::right_jacobian_inverse(&error))
    }

    fn inverse_adjoint(&self) -> SMatrix<f64, 3, 3> {
        self.inverse().adjoint()
    }

    fn world_from_body(&self) -> Se3 {
        crate::mount::world_from_tilted_body(self, 0.0, 0.0, 0.0)
    }

    #[inline]
    fn pull_back(row: &Vector3<f64>, point: &Vector3<f64>) -> SVector<f64, 3> {
        Vector3::new(-row.x, -row.y, row.x * point.y - row.y * point.x)
    }

    fn is_finite(&self) -> bool {
        [self.x, self.y, self.phi].iter().all(|v| v.is_finite())
    }
}

impl BundlePose<6> for Se3 {
    fn between(&self, other: &Self) -> Self {
        self.inverse().compose(other)
    }

    fn log_with_jacobian(&self) -> (SVector<f64, 6>, SMatrix<f64, 6, 6>) {
        let error = self.log();
        (error, Self::right_jacobian_inverse(&error))
    }

    fn inverse_adjoint(&self) -> SMatrix<f64, 6, 6> {
        self.inverse().adjoint()
    }

    fn world_from_body(&self) -> Se3 {
        *self
    }

    #[inline]
    fn pull_back(row: &Vector3<f64>, point: &Vector3<f64>) -> SVector<f64, 6> {
        let turn = row.cross(point);
        Vector6::new(-row.x, -row.y, -row.z, turn.x, turn.y, turn.z)
    }

    fn is_finite(&self) -> bool {
        self.translation.iter().all(|v| v.is_finite())
            && self.rotation.matrix().iter().all(|v| v.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::so3;

    /// log(E exp(d)) - log(E) by central differences, at random errors, tiny ones and near half a turn.
    fn check<P: BundlePose<D>, const D: usize>(error: &P) {
        let (_, jacobian) = error.log_with_jacobian();
        let h = 1e-6;
        for column in 0..D {
            let mut delta = SVector::<f64, D>::zeros();
            delta[column] = h;
            let plus = error.retract(&delta).log_with_jacobian().0;
            let minus = error.retract(&-delta).log_with_jacobian().0;
            let numeric = (plus - minus) / (2.0 * h);
            let difference = (numeric - jacobian.column(column)).amax();
            // Truncation h^2 / 6 times third derivatives, rounding eps / h times the size of the log.
            assert!(difference < 3e-9, "{error:?} {column}: {difference}");
        }
    }

    #[test]
    fn inverse_right_jacobians_match_central_differences() {
        for phi in [0.0, 1e-9, -1e-4, 0.3, -2.0, PI - 1e-3, -PI + 1e-3] {
            check(&Se2::new(0.4, -1.3, phi));
            check(&Se2::new(0.0, 0.0, phi));
            for axis in [Vector3::x(), Vector3::new(0.48, -0.6, 0.64)] {
                let w = axis * phi;
                check(&Se3::new(so3::exp(&w), Vector3::new(0.5, -1.0, 0.7)));
            }
        }
    }

    /// The planar derivative is columns 0, 1, 5 of the spatial one, for the log as for a point.
    #[test]
    fn the_plane_lies_in_space() {
        let planar = Se2::new(0.7, -0.2, 1.1);
        let spatial = BundlePose::world_from_body(&planar);
        let (e2, j2) = planar.log_with_jacobian();
        let (e3, j3) = spatial.log_with_jacobian();
        let kept = [0, 1, 5];
        for (i, &row) in kept.iter().enumerate() {
            assert!((e2[i] - e3[row]).abs() < 1e-15);
            for (j, &column) in kept.iter().enumerate() {
                assert!((j2[(i, j)] - j3[(row, column)]).abs() < 1e-15);
            }
        }
        let (row, point) = (Vector3::new(0.3, -2.0, 0.9), Vector3::new(1.0, 4.0, -0.5));
        let (p2, p3) = (
            <Se2 as BundlePose<3>>::pull_back(&row, &point),
            <Se3 as BundlePose<6>>::pull_back(&row, &point),
        );
        for (i, &column) in kept.iter().enumerate() {
            assert_eq!(p2[i], p3[column]);
        }
        let derivative = Se3::identity().inverse_point_jacobian(&point);
        assert!((derivative.transpose() * row - p3).amax() < 1e-15);
    }
}
