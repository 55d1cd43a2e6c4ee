//! Two planar vehicles (x, y in metres, heading in radians) that drive exact arcs, with noise at each
//! command.

use crate::models::{Gaussian, MotionModel};
use estimation_base::{symmetric, wrap};
use nalgebra::{Matrix2, Matrix3, Matrix3x2, SMatrix, SVector, Vector2, Vector3};

/// A standard deviation sqrt(fixed^2 + (share |value|)^2) of a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// The constant part, in the unit of the value.
    pub fixed: f64,
    /// The part in proportion to the value's magnitude.
    pub share: f64,
}

impl Deviation {
    fn variance(&self, value: f64) -> f64 {
        self.fixed.powi(2) + (self.share * value).powi(2)
    }
}

/// The way in which noise is pushed through the motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Propagation {
    /// By Jacobians, to first order.
    #[default]
    Jacobians,
    /// By 11 sigma points of pose and control noise.
    SigmaPoints,
}

/// A command that stays constant for a while: speed in m/s, and the turn rate in rad/s ([`Unicycle`]) or the
/// steering angle in radians ([`Bicycle`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Duration, seconds.
    pub seconds: f64,
    /// Speed, m/s.
    pub speed: f64,
    /// Turn rate in rad/s, or steering angle in radians.
    pub turn: f64,
}

/// A vehicle that drives exact arcs at commanded speed and turn rate. Each command of the control has
/// its own noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unicycle {
    /// Standard deviation of the speed, m/s.
    pub speed: Deviation,
    /// Standard deviation of the turn rate, rad/s.
    pub turn_rate: Deviation,
    /// Standard deviations added once a frame (metres, metres, radians), positive, so that a robot at
    /// rest has a definite covariance.
    pub floor: [f64; 3],
    /// The way in which noise is pushed through the motion.
    pub propagation: Propagation,
}

/// A vehicle that drives exact arcs at commanded speed v of the rear axle and steering angle a, with
/// turn rate v tan(a) / wheelbase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bicycle {
    /// Distance between the axles, metres.
    pub wheelbase: f64,
    /// Standard deviation of the speed, m/s.
    pub speed: Deviation,
    /// Standard deviation of the steering angle, radians.
    pub steering: Deviation,
    /// Standard deviations added once a frame, as in [`Unicycle::floor`].
    pub floor: [f64; 3],
    /// The way in which noise is pushed through the motion.
    pub propagation: Propagation,
}

/// A turn rate with its derivatives by speed and turn command.
type TurnRate = (f64, f64, f64);

impl MotionModel<3> for Unicycle {
    type Control = Vec<Command>;

    fn predict(&self, pose: &Vector3<f64>, control: &Vec<Command>) -> Gaussian<3> {
        propagate(pose, control, &self.floor, self.propagation, |command| {
            (
                [
                    self.speed.variance(command.speed),
                    self.turn_rate.variance(command.turn),
                ],
                |_, turn| (turn, 0.0, 1.0),
            )
        })
    }

    fn retract(&self, pose: &Vector3<f64>, tangent: &Vector3<f64>) -> Vector3<f64> {
        moved(pose, tangent)
    }

    fn local(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
        between(from, to)
    }
}

impl MotionModel<3> for Bicycle {
    type Control = Vec<Command>;

    fn predict(&self, pose: &Vector3<f64>, control: &Vec<Command>) -> Gaussian<3> {
        let wheelbase = self.wheelbase;
        propagate(pose, control, &self.floor, self.propagation, |command| {
            (
                [
                    self.speed.variance(command.speed),
                    self.steering.variance(command.turn),
                ],
                move |speed: f64, steering: f64| {
                    let per_speed = steering.tan() / wheelbase;
                    let per_angle = speed / (wheelbase * steering.cos().powi(2));
                    (speed * per_speed, per_speed, per_angle)
                },
            )
        })
    }

    fn retract(&self, pose: &Vector3<f64>, tangent: &Vector3<f64>) -> Vector3<f64> {
        moved(pose, tangent)
    }

    fn local(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
        between(from, to)
    }
}

/// The tangent from one pose to another, heading wrapped.
fn between(from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
    let difference = to - from;
    Vector3::new(difference.x, difference.y, wrap(difference.z))
}

/// The pose along a tangent, heading wrapped.
fn moved(pose: &Vector3<f64>, tangent: &Vector3<f64>) -> Vector3<f64> {
    let sum = pose + tangent;
    Vector3::new(sum.x, sum.y, wrap(sum.z))
}

/// Drives the commands one after the other. `model` gives the variances of speed and turn, and the turn
/// rate.
fn propagate<R: Fn(f64, f64) -> TurnRate>(
    pose: &Vector3<f64>,
    control: &[Command],
    floor: &[f64; 3],
    propagation: Propagation,
    model: impl Fn(&Command) -> ([f64; 2], R),
) -> Gaussian<3> {
    let mut mean = *pose;
    let mut covariance = Matrix3::zeros();
    for command in control {
        let (variances, turn_rate) = model(command);
        let noise = Matrix2::from_diagonal(&Vector2::from(variances));
        let drive = |from: &Vector3<f64>, speed: f64, turn: f64| {
            from + arc(from.z, speed, turn_rate(speed, turn).0, command.seconds)
        };
        let nominal = drive(&mean, command.speed, command.turn);
        let sampled = match propagation {
            Propagation::Jacobians => None,
            Propagation::SigmaPoints => {
                let mut joint = SMatrix::<f64, 5, 5>::zeros();
                joint.fixed_view_mut::<3, 3>(0, 0).copy_from(&covariance);
                joint.fixed_view_mut::<2, 2>(3, 3).copy_from(&noise);
                let points = ukf::SigmaPoints::default();
                // NaN comes out by the Jacobians below, and is refused where the pose is drawn
                ukf::unscented_transform(&SVector::zeros(), &joint, &points, |x| {
                    let from = mean + x.fixed_rows::<3>(0);
                    drive(&from, command.speed + x[3], command.turn + x[4]) - nominal
                })
                .ok()
                .map(|image| (image.mean, image.covariance))
            }
        };
        if let Some((shift, spread)) = sampled {
            (mean, covariance) = (nominal + shift, spread);
        } else {
            let (rate, by_speed, by_turn) = turn_rate(command.speed, command.turn);
            let (f, g) = arc_jacobians(mean.z, command.speed, rate, command.seconds);
            let of_command = Matrix2::new(1.0, 0.0, by_speed, by_turn);
            let g = g * of_command;
            covariance = f * covariance * f.transpose() + g * noise * g.transpose();
            mean = nominal;
        }
    }
    mean.z = wrap(mean.z);
    let floor = Matrix3::from_diagonal(&Vector3::from(*floor).map(|deviation| deviation.powi(2)));
    Gaussian {
        mean,
        covariance: symmetric(&(covariance + floor)),
    }
}

/// sin(h) / h and its derivative; below 1e-3 series whose next terms are under 1e-14.
fn chord(h: f64) -> (f64, f64) {
    if h.abs() < 1e-3 {
        let squared = h * h;
        (
            1.0 - squared / 6.0 + squared * squared / 120.0,
            h * (squared / 30.0 - 1.0 / 3.0),
        )
    } else {
        let chord = h.sin() / h;
        (chord, (h.cos() - chord) / h)
    }
}

/// Displacement after an arc; the heading is not wrapped.
fn arc(heading: f64, speed: f64, turn_rate: f64, seconds: f64) -> Vector3<f64> {
    let half = 0.5 * turn_rate * seconds;
    let distance = speed * seconds * chord(half).0;
    let (sin, cos) = (heading + half).sin_cos();
    Vector3::new(distance * cos, distance * sin, turn_rate * seconds)
}

/// Derivatives of the pose after an arc by the pose before it, and by speed and turn rate.
fn arc_jacobians(
    heading: f64,
    speed: f64,
    turn_rate: f64,
    seconds: f64,
) -> (Matrix3<f64>, Matrix3x2<f64>) {
    let half = 0.5 * turn_rate * seconds;
    let (chord, slope) = chord(half);
    let distance = speed * seconds * chord;
    let stretch = 0.5 * seconds * speed * seconds * slope;
    let across = 0.5 * seconds * distance;
    let (sin, cos) = (heading + half).sin_cos();
    let mut f = Matrix3::identity();
    f[(0, 2)] = -distance * sin;
    f[(1, 2)] = distance * cos;
    let g = Matrix3x2::new(
        seconds * chord * cos,
        stretch * cos - across * sin,
        seconds * chord * sin,
        stretch * sin + across * cos,
        0.0,
        seconds,
    );
    (f, g)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Central differences of step e are off by e^2 and eps / e: 1e-9 at e = 1e-5, values of order ten.
    #[test]
    fn jacobians_are_the_differences() {
        let e = 1e-5;
        for turn_rate in [0.0, 1e-4, 0.7, -2.0] {
            let (f, g) = arc_jacobians(0.4, 1.5, turn_rate, 0.8);
            let by_speed =
                (arc(0.4, 1.5 + e, turn_rate, 0.8) - arc(0.4, 1.5 - e, turn_rate, 0.8)) / (2.0 * e);
            let by_rate =
                (arc(0.4, 1.5, turn_rate + e, 0.8) - arc(0.4, 1.5, turn_rate - e, 0.8)) / (2.0 * e);
            let by_heading =
                (arc(0.4 + e, 1.5, turn_rate, 0.8) - arc(0.4 - e, 1.5, turn_rate, 0.8)) / (2.0 * e);
            assert!((g.column(0) - by_speed).amax() < 1e-9);
            assert!((g.column(1) - by_rate).amax() < 1e-9);
            assert!((f.column(2) - by_heading - Vector3::z()).amax() < 1e-9);
        }
        // straight, beside the border of the series, whole turns, backwards, no time, standing
        let border = 2e-3_f64;
        let rates = [
            0.0,
            1e-300,
            border.next_down(),
            border,
            -border,
            2.0 * PI,
            -4.0 * PI,
            1e2,
        ];
        for (heading, speed, seconds) in [
            (PI, 1.5, 1.0),
            (-PI, -2.0, 1.0),
            (3.0, 5.0, 0.0),
            (-1.0, 0.0, 1.0),
            (PI / 2.0, 1e-9, 1.0),
        ] {
            for rate in rates {
                let (f, g) = arc_jacobians(heading, speed, rate, seconds);
                let of = |steps: [f64; 3]| {
                    let [a, b] = [-1.0, 1.0].map(|sign| {
                        let at = steps.map(|step| sign * step);
                        arc(heading + at[0], speed + at[1], rate + at[2], seconds)
                    });
                    (b - a) / (2.0 * e)
                };
                assert!((f.column(2) - of([e, 0.0, 0.0]) - Vector3::z()).amax() < 1e-9);
                assert!((g.column(0) - of([0.0, e, 0.0])).amax() < 1e-9);
                assert!((g.column(1) - of([0.0, 0.0, e])).amax() < 1e-9, "{rate}");
            }
        }
    }

    /// A quarter of a circle of radius 2; the bicycle at atan(0.5) with a wheelbase of 1 drives the same one.
    #[test]
    fn arcs_end_where_circles_do() {
        let still = Deviation {
            fixed: 0.0,
            share: 0.0,
        };
        let seconds = PI / 2.0;
        let start = Vector3::new(0.0, 0.0, PI);
        for propagation in [Propagation::Jacobians, Propagation::SigmaPoints] {
            let floor = [1e-6; 3];
            let unicycle = Unicycle {
                speed: still,
                turn_rate: still,
                floor,
                propagation,
            };
            let bicycle = Bicycle {
                wheelbase: 1.0,
                speed: still,
                steering: still,
                floor,
                propagation,
            };
            let turn = Command {
                seconds,
                speed: 2.0,
                turn: 1.0,
            };
            let steer = Command {
                turn: 0.5_f64.atan(),
                ..turn
            };
            let expected = Vector3::new(-2.0, -2.0, -PI / 2.0);
            for end in [
                unicycle.predict(&start, &vec![turn]),
                bicycle.predict(&start, &vec![steer]),
            ] {
                assert!((end.mean - expected).amax() < 1e-14, "{}", end.mean);
                assert_eq!(end.covariance, Matrix3::identity() * 1e-12);
            }
        }
    }

    /// For small noise both propagations agree up to terms of second order in the angles, (0.1)^2 here.
    #[test]
    fn sigma_points_and_jacobians_agree_to_first_order() {
        let noise = |fixed| Deviation { fixed, share: 0.01 };
        let model = |propagation| Unicycle {
            speed: noise(0.02),
            turn_rate: noise(0.01),
            floor: [1e-6; 3],
            propagation,
        };
        let commands = vec![
            Command {
                seconds: 0.5,
                speed: 1.0,
                turn: 0.6
            };
            8
        ];
        let start = Vector3::new(3.0, 1.0, -2.0);
        let first = model(Propagation::Jacobians).predict(&start, &commands);
        let sampled = model(Propagation::SigmaPoints).predict(&start, &commands);
        assert!((first.mean - sampled.mean).amax() < 1e-2);
        assert!((first.covariance - sampled.covariance).amax() < 1e-2 * first.covariance.amax());
        assert!(first.covariance.amax() > 1e-4);
    }
}
