//! The path of the robot.
//!
//! The truth is piecewise constant control: in each odometry interval the point that does not move sideways in a turn
//! goes on an exact circular arc, so that noiseless odometry integrated by [`advance`] gives its true poses. A nominal
//! heading along the path (straight, or the rounded rectangle of the room) plus a small steering wiggle fixes the turn of
//! each interval. A slip adds a constant sideways speed to the interval, a slope shortens its way in the plane, and the
//! poses told are those of the body origin, which a [`Carrier`] may have ahead of the turning centre. Images at times
//! between two rows are part of the way along the same arc: the frame rate cannot change the path.

use crate::camera::Attitude;
use crate::carrier::Carrier;
use crate::course::Course;
use crate::odometry::OdometryRow;
use crate::timing::{FRAME_PERIOD_S, FrameRate, ROWS_PER_FRAME};
use estimation_base::{Se2, wrap};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use std::f64::consts::TAU;

/// The true path: frame times, exact body poses, true control.
#[derive(Debug, Clone, PartialEq)]
pub struct TruePath {
    /// Time of each image, seconds.
    pub times_s: Vec<f64>,
    /// Pose of the body origin at each image; the first is the origin.
    pub poses: Vec<Se2>,
    /// True control of the turning centre, [`ROWS_PER_FRAME`] rows a frame and a row of rest at the end.
    pub controls: Vec<OdometryRow>,
    /// Height and tilt of the body at each image.
    pub(crate) attitudes: Vec<Attitude>,
}

/// The plan of a drive.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drive {
    pub(crate) course: Course,
    /// Frames of the specification.
    pub(crate) frames: usize,
    pub(crate) rate: FrameRate,
    pub(crate) carrier: Carrier,
}

/// The random streams of a drive, apart from one another so that no effect changes another.
pub(crate) struct DriveStreams {
    /// Steering and changes of speed.
    pub(crate) steering: ChaCha8Rng,
    /// Random slip.
    pub(crate) slip: ChaCha8Rng,
    /// Phases and periods of the sway.
    pub(crate) sway: ChaCha8Rng,
}

/// The turning centre at the start of an odometry row, and how it moves on during the row.
#[derive(Debug, Clone, Copy)]
struct Leg {
    start: Se2,
    height_m: f64,
    driven_m: f64,
    control: OdometryRow,
    /// Speed to the left, metres per second.
    sideways_mps: f64,
    slope_rad: f64,
}

impl TruePath {
    /// Drives a course.
    pub(crate) fn drive(plan: &Drive, streams: &mut DriveStreams) -> Self {
        let carrier = &plan.carrier;
        let legs = legs(plan, &mut streams.steering, &mut streams.slip);
        let dt = FRAME_PERIOD_S / ROWS_PER_FRAME as f64;
        let roll = Sway::new(carrier.roll_rad, &mut streams.sway);
        let pitch = Sway::new(carrier.pitch_rad, &mut streams.sway);
        let images = plan.rate.images(plan.frames);
        let times_s: Vec<f64> = (0..images).map(|image| plan.rate.time_s(image)).collect();
        let (mut poses, mut attitudes) = (Vec::new(), Vec::new());
        for (image, &time_s) in times_s.iter().enumerate() {
            let (row, share) = plan.rate.row(image);
            let leg = legs[row].after(share * dt);
            let (sin, cos) = leg.start.phi.sin_cos();
            poses.push(Se2 {
                x: leg.start.x + carrier.origin_ahead_m * cos,
                y: leg.start.y + carrier.origin_ahead_m * sin,
                phi: leg.start.phi,
            });
            attitudes.push(Attitude {
                height_m: leg.height_m,
                roll_rad: roll.at(time_s),
                pitch_rad: pitch.at(time_s) - plan.course.slope(carrier.slope_rad, leg.driven_m),
            });
        }
        let controls = legs.iter().map(|leg| leg.control).collect();
        Self {
            times_s,
            poses,
            controls,
            attitudes,
        }
    }
}

/// One leg a row, and a leg of rest at the end.
fn legs(plan: &Drive, steering: &mut ChaCha8Rng, slip: &mut ChaCha8Rng) -> Vec<Leg> {
    let dt = FRAME_PERIOD_S / ROWS_PER_FRAME as f64;
    let step_m = plan.course.step_m(plan.frames);
    let mut between = |low: f64, high: f64| low + (high - low) * steering.random::<f64>();
    let side = if between(-1.0, 1.0) < 0.0 { -1.0 } else { 1.0 };
    let slow = [side * between(0.022, 0.035), TAU / between(6.0, 9.0)];
    let fast = [between(0.006, 0.012), TAU / between(2.4, 3.4)];
    let pulse = [
        between(0.03, 0.06),
        TAU / between(4.0, 6.0),
        between(0.0, TAU),
    ];
    let wiggle = |t: f64| slow[0] * (slow[1] * t).sin() + fast[0] * (fast[1] * t).sin();
    let slip_ratio = plan.carrier.slip_ratio * (ROWS_PER_FRAME as f64).sqrt();

    let rows = (plan.frames - 1) * ROWS_PER_FRAME;
    let mut legs: Vec<Leg> = Vec::with_capacity(rows + 1);
    let mut start = Se2 {
        x: 0.0 - plan.carrier.origin_ahead_m,
        y: 0.0,
        phi: 0.0,
    };
    let (mut driven_m, mut height_m) = (0.0, 0.0);
    for row in 0..rows {
        let t_s = row as f64 * dt;
        let v_mps = step_m / FRAME_PERIOD_S * (1.0 + pulse[0] * (pulse[1] * t_s + pulse[2]).sin());
        let turn = plan.course.heading(driven_m + v_mps * dt) + wiggle(t_s + dt)
            - plan.course.heading(driven_m)
            - wiggle(t_s);
        let omega_radps = turn / dt;
        let white: f64 = slip.sample(StandardNormal);
        let leg = Leg {
            start,
            height_m,
            driven_m,
            control: OdometryRow {
                t_s,
                v_mps,
                omega_radps,
            },
            sideways_mps: v_mps * (slip_ratio * white - plan.carrier.curve_slip_s * omega_radps),
            slope_rad: plan
                .course
                .slope(plan.carrier.slope_rad, driven_m + v_mps * dt / 2.0),
        };
        let end = leg.after(dt);
        (start, height_m, driven_m) = (end.start, end.height_m, end.driven_m);
        legs.push(leg);
    }
    legs.push(Leg {
        start,
        height_m,
        driven_m,
        control: OdometryRow {
            t_s: rows as f64 * dt,
            v_mps: 0.0,
            omega_radps: 0.0,
        },
        sideways_mps: 0.0,
        slope_rad: 0.0,
    });
    legs
}

impl Leg {
    /// The leg that is left after `time_s` seconds of it; nothing of it is recomputed at zero.
    fn after(&self, time_s: f64) -> Self {
        if time_s <= 0.0 {
            return *self;
        }
        let OdometryRow {
            v_mps, omega_radps, ..
        } = self.control;
        let speed = [v_mps * self.slope_rad.cos(), self.sideways_mps];
        Self {
            start: advance(&self.start, speed, omega_radps, time_s),
            height_m: self.height_m + v_mps * time_s * self.slope_rad.sin(),
            driven_m: self.driven_m + v_mps * time_s,
            ..*self
        }
    }
}

/// Exact arc for constant speed (forwards, to the left) and turn rate over `dt` seconds.
///
/// Chord length v dt sinc(omega dt / 2) in the direction of the mean heading; the sinc is
/// its series below 1e-4 rad, where the rest is under 1e-18.
fn advance(pose: &Se2, [forwards, left]: [f64; 2], omega_radps: f64, dt: f64) -> Se2 {
    let half_turn = omega_radps * dt / 2.0;
    let sinc = if half_turn.abs() < 1e-4 {
        1.0 - half_turn * half_turn / 6.0
    } else {
        half_turn.sin() / half_turn
    };
    let (chord, side) = (forwards * dt * sinc, left * dt * sinc);
    let (sin, cos) = (pose.phi + half_turn).sin_cos();
    Se2 {
        x: pose.x + chord * cos - side * sin,
        y: pose.y + chord * sin + side * cos,
        phi: wrap(pose.phi + 2.0 * half_turn),
    }
}

/// A sway of a stated root mean square: a slow and a fast sine, four fifths and one fifth of the variance.
struct Sway {
    waves: [[f64; 3]; 2],
}

impl Sway {
    fn new(rms: f64, rng: &mut ChaCha8Rng) -> Self {
        let mut wave = |share: f64, shortest_s: f64, longest_s: f64| {
            let period_s = shortest_s + (longest_s - shortest_s) * rng.random::<f64>();
            [
                rms * (2.0 * share).sqrt(),
                TAU / period_s,
                TAU * rng.random::<f64>(),
            ]
        };
        Self {
            waves: [wave(0.8, 1.7, 3.1), wave(0.2, 0.6, 1.1)],
        }
    }

    fn at(&self, time_s: f64) -> f64 {
        let [slow, fast] = self
            .waves
            .map(|[amplitude, rate, phase]| amplitude * (rate * time_s + phase).sin());
        slow + fast
    }
}

#[cfg(test)]
mod tests;
