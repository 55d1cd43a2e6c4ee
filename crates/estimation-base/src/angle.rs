//! Angles on the circle.
//!
//! Headings are compared, averaged and stored in (-pi, pi]. The difference of two headings is `wrap(a - b)`; the mean of
//! several is `wrap(reference + sum w wrap(x - reference))` about a reference close to all of them.

use core::f64::consts::{PI, TAU};

use nalgebra::SVector;

use crate::manifold::Manifold;

/// The representative of an angle in (-pi, pi], radians.
///
/// An angle already in the interval comes back bit for bit. NaN and infinities give NaN. The remainder by 2 pi is exact
/// in the float sense, so the error is that of the input times the number of turns taken out (2.4e-16 rad per turn, the
/// error of 2 pi itself). O(1).
#[must_use]
pub fn wrap(angle: f64) -> f64 {
    if angle > -PI && angle <= PI {
        return angle;
    }
    let remainder = angle % TAU;
    if remainder > PI {
        remainder - TAU
    } else if remainder <= -PI {
        remainder + TAU
    } else {
        remainder
    }
}

/// An angle in radians that is always in (-pi, pi]: a heading or a bearing as a state of its own.
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

    /// The angle in radians, in (-pi, pi].
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
