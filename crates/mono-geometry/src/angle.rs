//! Angles on the circle.
//!
//! Headings are compared, averaged and stored in (-pi, pi]. The difference of two headings is
//! `wrap(a - b)`; the mean of several is `wrap(reference + sum w wrap(x - reference))` about a
//! reference close to all of them.

use std::f64::consts::{PI, TAU};

/// The representative of an angle in (-pi, pi], radians.
///
/// An angle already in the interval comes back bit for bit. NaN and infinities give NaN. The
/// remainder by 2 pi is exact in the float sense, so the error is that of the input times the
/// number of turns taken out (2.4e-16 rad per turn, the error of 2 pi itself). O(1).
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interval_is_open_below_and_closed_above() {
        assert_eq!(wrap(PI), PI);
        assert_eq!(wrap(-PI), PI);
        assert_eq!(wrap(3.0 * PI), PI);
        let below = f64::from_bits(PI.to_bits() - 1);
        assert_eq!(wrap(-below), -below);
        assert_eq!(wrap(0.0), 0.0);
        assert!(wrap(f64::NAN).is_nan() && wrap(f64::INFINITY).is_nan());
    }

    #[test]
    fn turns_do_not_matter() {
        for turns in -50_i32..=50 {
            for step in -31_i32..=31 {
                let angle = f64::from(step) * 0.1;
                let wrapped = wrap(angle + f64::from(turns) * TAU);
                assert!((wrapped - angle).abs() < 50.0 * 16.0 * f64::EPSILON);
                assert!(wrapped > -PI && wrapped <= PI);
            }
        }
    }
}
