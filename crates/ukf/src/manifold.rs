//! States and measurements that are not vectors.
//!
//! A filter needs two things from a state space: to move a state by a small tangent vector, and to
//! name the tangent vector between two states. Covariances live in the tangent. A product of
//! spaces (a range and a bearing, say) is a type of its own with both methods written out.
//!
//! The laws: `x.retract(&x.local(&y))` is y, and `x.local(&x.retract(&t))` is t for
//! tangents shorter than half a turn.

use crate::math::{atan2, floor, sin_cos};
use core::f64::consts::{PI, TAU};
use nalgebra::{SVector, Vector3};

/// A space with a D-dimensional tangent at each point.
pub trait Manifold<const D: usize>: Clone {
    /// The point reached from `self` along `tangent`.
    #[must_use]
    fn retract(&self, tangent: &SVector<f64, D>) -> Self;

    /// The tangent at `self` that leads to `other`.
    #[must_use]
    fn local(&self, other: &Self) -> SVector<f64, D>;
}

impl<const D: usize> Manifold<D> for SVector<f64, D> {
    fn retract(&self, tangent: &SVector<f64, D>) -> Self {
        self + tangent
    }

    fn local(&self, other: &Self) -> SVector<f64, D> {
        other - self
    }
}

/// An angle in radians, in (-pi, pi].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Angle {
    radians: f64,
}

impl Angle {
    /// The angle of any number of radians, wrapped. NaN and infinities become NaN.
    #[must_use]
    pub fn new(radians: f64) -> Self {
        Self {
            radians: wrap(radians),
        }
    }

    /// In (-pi, pi].
    #[must_use]
    pub const fn radians(self) -> f64 {
        self.radians
    }
}

impl Manifold<1> for Angle {
    fn retract(&self, tangent: &SVector<f64, 1>) -> Self {
        Self::new(self.radians + tangent[0])
    }

    fn local(&self, other: &Self) -> SVector<f64, 1> {
        SVector::<f64, 1>::new(wrap(other.radians - self.radians))
    }
}

/// A planar pose, `world_from_body`: position in metres, heading in radians.
///
/// The tangent is the body's own motion (forward, left, turn): `retract` drives along the arc of
/// constant velocity and turn rate that it names, the group's exponential; `local` finds the arc.
/// Covariances are therefore in the body frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Se2 {
    /// Metres.
    pub x: f64,
    /// Metres.
    pub y: f64,
    /// The heading.
    pub phi: Angle,
}

impl Se2 {
    /// A pose from metres, metres, radians.
    #[must_use]
    pub fn new(x: f64, y: f64, phi: f64) -> Self {
        Self {
            x,
            y,
            phi: Angle::new(phi),
        }
    }
}

impl Manifold<3> for Se2 {
    fn retract(&self, tangent: &Vector3<f64>) -> Self {
        let turn = tangent[2];
        let (sinc, cosc) = arc(turn);
        let forward = sinc * tangent[0] - cosc * tangent[1];
        let left = cosc * tangent[0] + sinc * tangent[1];
        let (sin, cos) = sin_cos(self.phi.radians);
        Self {
            x: self.x + cos * forward - sin * left,
            y: self.y + sin * forward + cos * left,
            phi: Angle::new(self.phi.radians + turn),
        }
    }

    fn local(&self, other: &Self) -> Vector3<f64> {
        let (sin, cos) = sin_cos(self.phi.radians);
        let (dx, dy) = (other.x - self.x, other.y - self.y);
        let (forward, left) = (cos * dx + sin * dy, cos * dy - sin * dx);
        let turn = wrap(other.phi.radians - self.phi.radians);
        let (sinc, cosc) = arc(turn);
        let square = sinc * sinc + cosc * cosc;
        Vector3::new(
            (sinc * forward + cosc * left) / square,
            (sinc * left - cosc * forward) / square,
            turn,
        )
    }
}

/// sin(t)/t and (1 - cos t)/t, without cancellation.
fn arc(turn: f64) -> (f64, f64) {
    // below this the next terms of the series, t^4/120 and t^3/24, are under the rounding
    if turn.abs() < 1e-4 {
        return (1.0 - turn * turn / 6.0, 0.5 * turn);
    }
    let (sin_half, cos_half) = sin_cos(0.5 * turn);
    (
        2.0 * sin_half * cos_half / turn,
        2.0 * sin_half * sin_half / turn,
    )
}

/// The angle of a bearing (x, y), kept here so that users of `Angle` need no trigonometry.
impl From<nalgebra::Vector2<f64>> for Angle {
    fn from(direction: nalgebra::Vector2<f64>) -> Self {
        Self::new(atan2(direction.y, direction.x))
    }
}

fn wrap(angle: f64) -> f64 {
    if angle > -PI && angle <= PI {
        return angle;
    }
    let wrapped = angle - TAU * floor((angle + PI) / TAU);
    // the floor may be off by one turn after rounding
    if wrapped > PI {
        wrapped - TAU
    } else if wrapped <= -PI {
        wrapped + TAU
    } else {
        wrapped
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn wrapping_ends() {
        assert_eq!(Angle::new(-PI).radians(), PI);
        assert_eq!(Angle::new(PI).radians(), PI);
        assert!((Angle::new(-7.0).radians() - (TAU - 7.0)).abs() < 1e-15);
        assert!(Angle::new(f64::INFINITY).radians().is_nan());
        assert_eq!(
            Angle::from(nalgebra::Vector2::new(0.0, 2.0)).radians(),
            PI / 2.0
        );
    }

    #[test]
    fn a_quarter_turn_is_a_quarter_circle() {
        // forward pi/2 while turning pi/2: radius 1
        let pose = Se2::new(1.0, 0.0, PI / 2.0).retract(&Vector3::new(PI / 2.0, 0.0, PI / 2.0));
        assert!((pose.x - 0.0).abs() < 1e-15 && (pose.y - 1.0).abs() < 1e-15);
        assert!((pose.phi.radians() - PI).abs() < 1e-15);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn retract_and_local_undo_each_other(
            x in -5.0..5.0_f64, y in -5.0..5.0_f64, phi in -9.0..9.0_f64,
            a in -3.0..3.0_f64, b in -3.0..3.0_f64,
            turn in prop_oneof![-3.0..3.0_f64, -2e-4..2e-4_f64, Just(0.0)],
        ) {
            let pose = Se2::new(x, y, phi);
            let tangent = Vector3::new(a, b, turn);
            let reached = pose.retract(&tangent);
            // 1/|arc| reaches pi^2/... < 12 near half a turn
            prop_assert!((pose.local(&reached) - tangent).amax() < 1e-13 * 20.0);
            let again = pose.retract(&pose.local(&reached));
            prop_assert!((again.x - reached.x).abs() < 1e-13 * 20.0);
            prop_assert!((again.y - reached.y).abs() < 1e-13 * 20.0);
        }

        #[test]
        fn the_arc_is_smooth_at_the_series(turn in 0.5e-4..2e-4_f64) {
            let (sinc, cosc) = arc(turn);
            let exact = (1.0 - turn * turn / 6.0 + turn.powi(4) / 120.0, turn / 2.0 - turn.powi(3) / 24.0);
            prop_assert!((sinc - exact.0).abs() < 4.0 * f64::EPSILON);
            prop_assert!((cosc - exact.1).abs() < 1e-13);
        }
    }
}
