//! The path of the robot.
//!
//! The truth is piecewise constant control: in each odometry interval the point that does not move sideways in a turn
//! goes on an exact circular arc, so that noiseless odometry integrated by [`advance`] gives its true poses. A nominal
//! heading along the path (straight, or the rounded rectangle of the room) plus a small steering wiggle fixes the turn of
//! each interval. A slip adds a constant sideways speed to the interval, a slope shortens its way in the plane, and the
//! poses told are those of the body origin, which a [`Carrier`] may have ahead of the turning centre. Images at times
//! between two rows are part of the way along the same arc: the frame rate cannot change the path. At a stop the course,
//! its steering and the sway wait; a kidnapped robot goes on along its course from the place where it is set down.

use crate::camera::{Attitude, FX};
use crate::carrier::Carrier;
use crate::course::Course;
use crate::error::SceneError;
use crate::mishaps::Kidnap;
use crate::odometry::OdometryRow;
use crate::stops::{Doing, Stops};
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
    /// Poses and attitudes while the shutter of each image is open; empty lists where it is open for no time.
    pub(crate) exposures: Vec<Vec<(Se2, Attitude)>>,
}

/// The plan of a drive.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Drive {
    pub(crate) course: Course,
    /// Frames of the specification.
    pub(crate) frames: usize,
    pub(crate) rate: FrameRate,
    pub(crate) carrier: Carrier,
    pub(crate) stops: Stops,
    pub(crate) kidnap: Option<Kidnap>,
    /// Seconds that the shutter is open.
    pub(crate) shutter_s: f64,
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
    /// Seconds at stops until now.
    stopped_s: f64,
    /// Whether it is part of a stop.
    stops: bool,
    control: OdometryRow,
    /// Speed to the left, metres per second.
    sideways_mps: f64,
    slope_rad: f64,
}

/// Most poses of one exposure.
const MOST_POSES: usize = 16;
/// The scene moves by less than this between two poses of an exposure, pixels.
const EXPOSURE_STEP_PX: f64 = 1.0;

impl TruePath {
    /// Drives a course.
    ///
    /// # Errors
    /// A kidnapping over a distance that the course does not offer.
    pub(crate) fn drive(plan: &Drive, streams: &mut DriveStreams) -> Result<Self, SceneError> {
        let carrier = &plan.carrier;
        let legs = legs(plan, &mut streams.steering, &mut streams.slip)?;
        let dt = FRAME_PERIOD_S / ROWS_PER_FRAME as f64;
        let roll = Sway::new(carrier.roll_rad, &mut streams.sway);
        let pitch = Sway::new(carrier.pitch_rad, &mut streams.sway);
        let images = plan.rate.images(plan.frames);
        let times_s: Vec<f64> = (0..images).map(|image| plan.rate.time_s(image)).collect();
        let at = |row: usize, rest_s: f64, time_s: f64| {
            let leg = legs[row].after(rest_s);
            let (sin, cos) = leg.start.phi.sin_cos();
            let pose = Se2 {
                x: leg.start.x + carrier.origin_ahead_m * cos,
                y: leg.start.y + carrier.origin_ahead_m * sin,
                phi: leg.start.phi,
            };
            let swayed_s = time_s - leg.stopped_s;
            let attitude = Attitude {
                height_m: leg.height_m,
                roll_rad: roll.at(swayed_s),
                pitch_rad: pitch.at(swayed_s) - plan.course.slope(carrier.slope_rad, leg.driven_m),
            };
            (pose, attitude)
        };
        let last_s = (legs.len() - 1) as f64 * dt;
        // Nobody sees the robot being carried: an exposure ends or begins there.
        let carried_s = plan
            .kidnap
            .map(|kidnap| kidnap.frame as f64 * FRAME_PERIOD_S);
        let exposure = |time_s: f64| -> Vec<(Se2, Attitude)> {
            let (mut from_s, mut to_s) = (
                (time_s - plan.shutter_s / 2.0).max(0.0),
                (time_s + plan.shutter_s / 2.0).min(last_s),
            );
            if let Some(carried_s) = carried_s {
                if time_s >= carried_s {
                    from_s = from_s.max(carried_s);
                } else {
                    to_s = to_s.min(carried_s - 1e-6);
                }
            }
            let pose_at = |time_s: f64| {
                let row = ((time_s / dt + 1e-9).floor() as usize).min(legs.len() - 1);
                at(row, (time_s - row as f64 * dt).max(0.0), time_s)
            };
            let ends = [from_s, to_s].map(&pose_at);
            let moved_px = smear_px(&ends[0], &ends[1]);
            let count = ((moved_px / EXPOSURE_STEP_PX).ceil().max(1.0) as usize).min(MOST_POSES);
            (0..count)
                .map(|k| pose_at(from_s + (to_s - from_s) * (k as f64 + 0.5) / count as f64))
                .collect()
        };
        let (mut poses, mut attitudes, mut exposures) = (Vec::new(), Vec::new(), Vec::new());
        for (image, &time_s) in times_s.iter().enumerate() {
            let (row, share) = plan.rate.row(image);
            let (pose, attitude) = at(row, share * dt, time_s);
            poses.push(pose);
            attitudes.push(attitude);
            exposures.push(if plan.shutter_s > 0.0 {
                exposure(time_s)
            } else {
                Vec::new()
            });
        }
        let controls = legs.iter().map(|leg| leg.control).collect();
        Ok(Self {
            times_s,
            poses,
            controls,
            attitudes,
            exposures,
        })
    }
}

/// About how far the scene moves in the image between two poses, pixels: turns, and way against the nearest things.
fn smear_px(a: &(Se2, Attitude), b: &(Se2, Attitude)) -> f64 {
    let nearest_m = 1.0;
    let way = (a.0.x - b.0.x).hypot(a.0.y - b.0.y) / nearest_m;
    let turn = wrap(a.0.phi - b.0.phi).abs();
    let tilt = (a.1.roll_rad - b.1.roll_rad).abs() + (a.1.pitch_rad - b.1.pitch_rad).abs();
    FX * (way + turn + tilt)
}

/// One leg a row, and a leg of rest at the end.
fn legs(
    plan: &Drive,
    steering: &mut ChaCha8Rng,
    slip: &mut ChaCha8Rng,
) -> Result<Vec<Leg>, SceneError> {
    let dt = FRAME_PERIOD_S / ROWS_PER_FRAME as f64;
    let doings = plan.stops.plan(plan.frames - 1);
    let driving = doings.iter().filter(|doing| **doing == Doing::Drive);
    let step_m = plan.course.step_m(driving.count() + 1);
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
    let (mut driven_m, mut height_m, mut stopped_s) = (0.0, 0.0, 0.0);
    let mut driven_rows = 0_usize;
    // Speed and turn rate of a row of driving, the `row`-th of them, `driven_m` metres after the start.
    let course_control = |row: usize, driven_m: f64| {
        let t_s = row as f64 * dt;
        let v_mps = step_m / FRAME_PERIOD_S * (1.0 + pulse[0] * (pulse[1] * t_s + pulse[2]).sin());
        let turn = plan.course.heading(driven_m + v_mps * dt) + wiggle(t_s + dt)
            - plan.course.heading(driven_m)
            - wiggle(t_s);
        (v_mps, turn / dt)
    };
    let carried_row = plan.kidnap.map(|k| (k.frame * ROWS_PER_FRAME, k.metres));
    for row in 0..rows {
        if let Some((_, metres)) = carried_row.filter(|carried| carried.0 == row) {
            // It is set down where it would have come to by itself.
            let (lifted, lifted_m, mut farthest) = (start, driven_m, 0.0_f64);
            while farthest < metres {
                if driven_m > lifted_m + plan.course.round_m().max(2.0 * metres) {
                    return Err(SceneError::OutOfRange {
                        name: "distance of the kidnapping",
                        given: metres,
                        low: 0.0,
                        high: farthest,
                    });
                }
                let (v_mps, omega_radps) = course_control(driven_rows, driven_m);
                start = advance(&start, [v_mps, 0.0], omega_radps, dt);
                driven_m += v_mps * dt;
                driven_rows += 1;
                farthest = farthest.max((start.x - lifted.x).hypot(start.y - lifted.y));
            }
        }
        let doing = doings[row / ROWS_PER_FRAME];
        let (v_mps, omega_radps) = match doing {
            Doing::Drive => course_control(driven_rows, driven_m),
            Doing::Stand => (0.0, 0.0),
            Doing::Spin(frames) => (0.0, TAU / (frames as f64 * FRAME_PERIOD_S)),
        };
        driven_rows += usize::from(doing == Doing::Drive);
        let white: f64 = slip.sample(StandardNormal);
        let leg = Leg {
            start,
            height_m,
            driven_m,
            stopped_s,
            stops: doing != Doing::Drive,
            control: OdometryRow {
                t_s: row as f64 * dt,
                v_mps,
                omega_radps,
            },
            sideways_mps: v_mps * (slip_ratio * white - plan.carrier.curve_slip_s * omega_radps),
            slope_rad: plan
                .course
                .slope(plan.carrier.slope_rad, driven_m + v_mps * dt / 2.0),
        };
        let end = leg.after(dt);
        (start, height_m) = (end.start, end.height_m);
        (driven_m, stopped_s) = (end.driven_m, end.stopped_s);
        legs.push(leg);
    }
    legs.push(Leg {
        start,
        height_m,
        driven_m,
        stopped_s,
        stops: true,
        control: OdometryRow {
            t_s: rows as f64 * dt,
            v_mps: 0.0,
            omega_radps: 0.0,
        },
        sideways_mps: 0.0,
        slope_rad: 0.0,
    });
    Ok(legs)
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
            stopped_s: self.stopped_s + if self.stops { time_s } else { 0.0 },
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
