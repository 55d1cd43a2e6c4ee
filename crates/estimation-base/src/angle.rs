//! Angles on the circle.
//!
//! Headings are compared, averaged and stored in (-pi, pi]. The difference of two headings is `wrap(a - b)`; the mean of
//! several is `wrap(reference + sum w wrap(x - reference))` about a reference close to all of them.

use nalgebra::SVector;

use crate::manifold::Manifold;
use crate::real::Real;

/// The representative of an angle in (-pi, pi], radians.
///
/// An angle already in the interval comes back bit for bit. NaN and infinities give NaN. The remainder by 2 pi is exact
/// in the float sense, so the error is that of the input times the number of turns taken out (2.4e-16 rad per turn, the
/// error of 2 pi itself). O(1).
///
/// ```
/// use estimation_base::wrap;
/// use std::f64::consts::PI;
///
/// assert_eq!(wrap(0.5), 0.5);
/// assert!((wrap(3.0_f64 - -3.0) - (6.0 - 2.0 * PI)).abs() < 1e-15);
/// ```
#[must_use]
pub fn wrap<T: Real>(angle: T) -> T {
    let (half_turn, turn) = (T::pi(), T::two_pi());
    if angle > -half_turn && angle <= half_turn {
        return angle;
    }
    let remainder = angle % turn;
    if remainder > half_turn {
        remainder - turn
    } else if remainder <= -half_turn {
        remainder + turn
    } else {
        remainder
    }
}

/// An angle in radians that is always in (-pi, pi]: a heading or a bearing as a state of its own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Angle<T> {
    radians: T,
}

impl<T: Real> Angle<T> {
    /// The angle of any number of radians, wrapped. NaN and infinities become NaN.
    #[must_use]
    pub fn new(radians: T) -> Self {
        Self {
            radians: wrap(radians),
        }
    }

    /// The angle in radians, in (-pi, pi].
    #[must_use]
    pub fn radians(self) -> T {
        self.radians
    }
}

impl<T: Real> Manifold<1, T> for Angle<T> {
    fn retract(&self, tangent: &SVector<T, 1>) -> Self {
        Self::new(self.radians + tangent[0])
    }

    fn local(&self, other: &Self) -> SVector<T, 1> {
        SVector::<T, 1>::new(wrap(other.radians - self.radians))
    }
}
