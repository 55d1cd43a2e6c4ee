//! Motion of the body from what its wheels and its steering say.
//!
//! Body axes are x forward and y to the left, the origin between the two driven wheels (on the rear axle of a steered
//! robot); turns to the left are positive. A wheel that rolls without slipping moves along the body's x axis with
//!
//! > ds_left = ds - b / 2 dphi,   ds_right = ds + b / 2 dphi,
//!
//! where b is the base, the distance between the two points of contact. Both equations hold for the whole interval as well,
//! however speed and turn rate change within it, so the mean speed and the mean turn rate lose nothing of distance and
//! turn. Only the shape of the path inside the interval is lost: the filter takes an arc.
//!
//! A robot steered by its front wheels follows the bicycle of its centre line: the rear axle turns with
//!
//! > omega = v tan(delta) / L,
//!
//! delta the angle of the (middle) front wheel against the body's x axis and L the wheelbase.
//!
//! Degenerate: a base or a wheelbase of zero gives no finite turn; callers check it. At |delta| = pi / 2 the bicycle has no
//! forward speed.

/// Way of the body's origin along its path and the turn meanwhile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Travel {
    /// Length of the path, negative backwards, metres.
    pub distance_m: f64,
    /// Change of heading, positive to the left, radians; not wrapped.
    pub turn_rad: f64,
}

/// Travel of the point between two wheels that rolled these distances (metres) with the base `base_m` between them. O(1).
#[must_use]
pub fn differential_drive(left_m: f64, right_m: f64, base_m: f64) -> Travel {
    Travel {
        distance_m: 0.5 * (left_m + right_m),
        turn_rad: (right_m - left_m) / base_m,
    }
}

/// Turn rate (rad/s) at the rear axle for a speed of that axle (m/s), the angle of the front wheel (rad, left positive) and
/// the wheelbase (m). O(1).
#[must_use]
pub fn steered_turn_rate(v_mps: f64, steering_rad: f64, wheelbase_m: f64) -> f64 {
    v_mps * steering_rad.tan() / wheelbase_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::{FRAC_PI_4, PI};

    #[test]
    fn equal_wheels_go_straight_and_opposite_wheels_spin() {
        let straight = differential_drive(0.7, 0.7, 0.3);
        assert_eq!((straight.distance_m, straight.turn_rad), (0.7, 0.0));
        let back = differential_drive(-0.7, -0.7, 0.3);
        assert_eq!((back.distance_m, back.turn_rad), (-0.7, 0.0));
        // A whole turn on the spot: each wheel runs round a circle of half the base.
        let spin = differential_drive(-0.15 * PI, 0.15 * PI, 0.15);
        assert_eq!(spin.distance_m, 0.0);
        assert!((spin.turn_rad - 2.0 * PI).abs() < 1e-14);
    }

    /// Round a circle of radius r to the left the wheels run on the radii r - b/2 and r + b/2.
    #[test]
    fn wheels_on_a_circle_give_its_length_and_its_angle() {
        let (radius, base, angle): (f64, f64, f64) = (2.0, 0.4, 1.3);
        for turn in [angle, -angle] {
            let left = turn.abs() * (radius - 0.5 * base * turn.signum());
            let right = turn.abs() * (radius + 0.5 * base * turn.signum());
            let travel = differential_drive(left, right, base);
            assert!((travel.distance_m - radius * angle).abs() < 1e-14);
            assert!((travel.turn_rad - turn).abs() < 1e-14, "{travel:?}");
        }
    }

    /// The axles meet in the turning centre: at 45 degrees the rear axle circles at the wheelbase's distance.
    #[test]
    fn steering_turns_about_the_point_where_the_axles_meet() {
        assert!((steered_turn_rate(3.0, FRAC_PI_4, 2.5) - 3.0 / 2.5).abs() < 1e-14);
        assert!(steered_turn_rate(3.0, -0.1, 2.5) < 0.0);
        assert!(steered_turn_rate(-3.0, 0.1, 2.5) < 0.0);
        assert_eq!(steered_turn_rate(3.0, 0.0, 2.5), 0.0);
    }
}
