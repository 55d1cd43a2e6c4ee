//! The error of the path that a wrong focal length makes.
//!
//! A focal length that is wrong by a share makes every angle that the camera sees between two keyframes wrong by that share,
//! and turns the chord between them by half of it. The wheels know nothing of it, and a landmark that is seen again brings
//! the error of its anchor with it, not that of all turns since. So the derivative of a keyframe's error by that share
//! follows the same landmarks as its drift ([`super::drift`]).

use estimation_base::wrap;
use mono_geometry::Se2;
use nalgebra::Vector3;

/// d (x, y, phi) / d (relative error of the angle between `from` and `to`), world axes, metres and radians.
pub(super) fn rate_between(from: &Se2, to: &Se2) -> Vector3<f64> {
    let turn = wrap(to.phi - from.phi);
    let (x, y) = (to.x - from.x, to.y - from.y);
    Vector3::new(-0.5 * turn * y, 0.5 * turn * x, turn)
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;

    use super::*;
    use crate::filter::drift::{Draw, Drift, Support};
    use std::collections::BTreeMap;

    /// The path of a robot that turns and drives, all its turns too large by the share `stretch - 1`.
    fn path(stretch: f64) -> Vec<Se2> {
        let mut bodies = vec![Se2::identity()];
        for k in 0..200 {
            let turn = 0.02 * (1.0 + (f64::from(k) * 0.05).sin());
            // The chord of an arc.
            let half = Se2::new(0.0, 0.0, 0.5 * turn * stretch);
            let step = half.compose(&Se2::new(0.05, 0.0, 0.0)).compose(&half);
            bodies.push(bodies[bodies.len() - 1].compose(&step));
        }
        bodies
    }

    fn leaning_on(anchor: u32, gain: f64) -> Support {
        Support {
            gains: BTreeMap::from([(anchor, Matrix3::identity() * gain)]),
            covariance: Matrix3::zeros(),
        }
    }

    /// Each keyframe measured against the one before: the derivative of the whole path.
    #[test]
    fn the_rate_of_a_path_is_its_derivative() {
        let e = 1e-6;
        let (straight, more, less) = (path(1.0), path(1.0 + e), path(1.0 - e));
        let mut drift = Drift::keeping(256);
        drift.push(&straight[0], None, &Matrix3::zeros(), &Draw::Final);
        for (k, body) in straight.iter().enumerate().skip(1) {
            let support = leaning_on(k as u32 - 1, 1.0);
            drift.push(body, Some(&support), &Matrix3::zeros(), &Draw::Final);
            let (a, b) = (&more[k], &less[k]);
            let difference = Vector3::new(a.x - b.x, a.y - b.y, wrap(a.phi - b.phi)) / (2.0 * e);
            let rate = drift.focal_rate(k as u32, body);
            assert!((difference - rate).norm() < 1e-6, "{difference} {rate}");
        }
        assert!(drift.focal_rate(200, &straight[200]).z > 3.0);
    }

    /// Turns on the spot added up without end although the landmarks of the first turn were seen again in every other.
    #[test]
    fn regress_old_landmarks_take_the_swing_of_many_turns_back() {
        let mut drift = Drift::keeping(256);
        let body = |k: u32| Se2::new(0.0, 0.0, wrap(0.1 * f64::from(k)));
        drift.push(&body(0), None, &Matrix3::zeros(), &Draw::Final);
        for k in 1..1000 {
            // One turn has 63 keyframes; later ones see the landmarks anchored in the first.
            let anchor = if k < 63 { k - 1 } else { (k - 1) % 63 };
            drift.push(
                &body(k),
                Some(&leaning_on(anchor, 0.9)),
                &Matrix3::zeros(),
                &Draw::Final,
            );
            let rate = drift.focal_rate(k, &body(k)).z;
            assert!(
                rate.abs() < 1.2 * 2.0 * core::f64::consts::PI,
                "{k}: {rate}"
            );
        }
        // What the wheels measure has no such error.
        let before = drift.focal_rate(999, &body(999));
        drift.push(&body(1000), None, &Matrix3::zeros(), &Draw::Final);
        assert_eq!(drift.focal_rate(1000, &body(1000)), before);
    }
}
