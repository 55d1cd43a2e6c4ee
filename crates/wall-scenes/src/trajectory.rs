//! The path of the robot, and the report of its wheels.
//!
//! The truth is piecewise constant control: in each odometry interval the robot
//! turns on an exact circular arc, so that noiseless odometry integrated by
//! [`advance`] gives the true poses. A nominal heading along the path
//! (straight, or the rounded rectangle of the room) plus a small steering wiggle fixes the
//! turn of each interval.
//!
//! Noise is stated per frame, as a filter meets it: a step has
//! `speed_ratio` of white error in its length and `heading_rad` in its turn;
//! with n rows a frame the rows carry `sqrt(n)` times the relative error in
//! speed and `1/sqrt(n)` times the turn. Two constants are drawn once per seed: a speed
//! scale error and a turn-rate offset.

use estimation_base::{Se2, wrap};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Seconds between two frames.
pub const FRAME_PERIOD_S: f64 = 0.5;
/// Odometry rows per frame.
pub const ROWS_PER_FRAME: usize = 5;
/// Radius of the room loop's corners, metres.
const CORNER_RADIUS_M: f64 = 0.45;

/// Standard deviations of the wheel odometry.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct OdometryNoise {
    /// White error of a frame's step length, as a share of it.
    pub speed_ratio: f64,
    /// White error of a frame's turn, radians.
    pub heading_rad: f64,
    /// Constant speed scale error.
    pub speed_bias_ratio: f64,
    /// Constant turn-rate offset, radians per second.
    pub turn_bias_radps: f64,
}

impl OdometryNoise {
    /// The paper-shaped run: 5 % in v, 0.012 rad a step, small biases.
    pub const PAPER: Self = Self {
        speed_ratio: 0.05,
        heading_rad: 0.012,
        speed_bias_ratio: 0.01,
        turn_bias_radps: 0.001,
    };
    /// Perfect wheels.
    pub const NONE: Self = Self {
        speed_ratio: 0.0,
        heading_rad: 0.0,
        speed_bias_ratio: 0.0,
        turn_bias_radps: 0.0,
    };
}

/// One row of `odometry.csv`; holds until the next row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryRow {
    /// Seconds.
    pub t_s: f64,
    /// Forward speed, metres per second.
    pub v_mps: f64,
    /// Turn rate, radians per second, positive to the left.
    pub omega_radps: f64,
}

/// The true path: frame times, exact body poses, true control.
#[derive(Debug, Clone, PartialEq)]
pub struct TruePath {
    /// Time of each frame, seconds.
    pub times_s: Vec<f64>,
    /// Body pose at each frame; the first is the origin.
    pub poses: Vec<Se2>,
    /// True control, [`ROWS_PER_FRAME`] rows a frame and a row of rest at the end.
    pub controls: Vec<OdometryRow>,
}

/// Plan of a path before steering is added.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Course {
    /// Straight along x, this many metres a frame.
    Straight { step_m: f64 },
    /// Clockwise around a rectangle with rounded corners, starting in the middle of
    /// the first long side; `overlap` frames drive the start again.
    Loop {
        long_m: f64,
        short_m: f64,
        overlap: usize,
    },
}

impl TruePath {
    /// Drives a course. `rng` draws the steering and the changes of speed.
    pub(crate) fn drive(course: Course, frames: usize, rng: &mut ChaCha8Rng) -> Self {
        let dt = FRAME_PERIOD_S / ROWS_PER_FRAME as f64;
        let step_m = match course {
            Course::Straight { step_m } => step_m,
            Course::Loop { overlap, .. } => {
                let steps = frames.saturating_sub(1 + overlap).max(1);
                course.length_m() / steps as f64
            }
        };
        let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let side = if between(-1.0, 1.0) < 0.0 { -1.0 } else { 1.0 };
        let slow = [side * between(0.022, 0.035), TAU / between(6.0, 9.0)];
        let fast = [between(0.006, 0.012), TAU / between(2.4, 3.4)];
        let pulse = [
            between(0.03, 0.06),
            TAU / between(4.0, 6.0),
            between(0.0, TAU),
        ];
        let wiggle = |t: f64| slow[0] * (slow[1] * t).sin() + fast[0] * (fast[1] * t).sin();

        let rows = (frames - 1) * ROWS_PER_FRAME;
        let mut controls = Vec::with_capacity(rows + 1);
        let mut poses = vec![Se2 {
            x: 0.0,
            y: 0.0,
            phi: 0.0,
        }];
        let (mut pose, mut driven_m) = (poses[0], 0.0);
        for row in 0..rows {
            let t_s = row as f64 * dt;
            let v_mps =
                step_m / FRAME_PERIOD_S * (1.0 + pulse[0] * (pulse[1] * t_s + pulse[2]).sin());
            let turn = course.heading(driven_m + v_mps * dt) + wiggle(t_s + dt)
                - course.heading(driven_m)
                - wiggle(t_s);
            let control = OdometryRow {
                t_s,
                v_mps,
                omega_radps: turn / dt,
            };
            pose = advance(&pose, &control, dt);
            driven_m += v_mps * dt;
            controls.push(control);
            if (row + 1) % ROWS_PER_FRAME == 0 {
                poses.push(pose);
            }
        }
        controls.push(OdometryRow {
            t_s: rows as f64 * dt,
            v_mps: 0.0,
            omega_radps: 0.0,
        });
        let times_s = (0..frames).map(|k| k as f64 * FRAME_PERIOD_S).collect();
        Self {
            times_s,
            poses,
            controls,
        }
    }

    /// The rows the wheels report: the true control with noise; the last row stays at rest.
    pub(crate) fn odometry(&self, noise: &OdometryNoise, rng: &mut ChaCha8Rng) -> Vec<OdometryRow> {
        let dt = FRAME_PERIOD_S / ROWS_PER_FRAME as f64;
        let share = (ROWS_PER_FRAME as f64).sqrt();
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let scale = 1.0 + noise.speed_bias_ratio * normal();
        let offset = noise.turn_bias_radps * normal();
        let moving = self.controls.len() - 1;
        let mut rows = self.controls.clone();
        for row in &mut rows[..moving] {
            row.v_mps *= scale + noise.speed_ratio * share * normal();
            row.omega_radps += offset + noise.heading_rad / share / dt * normal();
        }
        rows
    }
}

/// Exact arc for constant speed and turn rate over `dt` seconds.
///
/// Chord length v dt sinc(omega dt / 2) in the direction of the mean heading; the sinc is
/// its series below 1e-4 rad, where the rest is under 1e-18.
fn advance(pose: &Se2, control: &OdometryRow, dt: f64) -> Se2 {
    let half_turn = control.omega_radps * dt / 2.0;
    let sinc = if half_turn.abs() < 1e-4 {
        1.0 - half_turn * half_turn / 6.0
    } else {
        half_turn.sin() / half_turn
    };
    let chord = control.v_mps * dt * sinc;
    let (sin, cos) = (pose.phi + half_turn).sin_cos();
    Se2 {
        x: pose.x + chord * cos,
        y: pose.y + chord * sin,
        phi: wrap(pose.phi + 2.0 * half_turn),
    }
}

impl Course {
    /// Length of one round, metres; infinite when the course is straight.
    fn length_m(self) -> f64 {
        match self {
            Self::Straight { .. } => f64::INFINITY,
            Self::Loop {
                long_m, short_m, ..
            } => {
                let straights = 2.0 * (long_m + short_m - 4.0 * CORNER_RADIUS_M);
                straights + TAU * CORNER_RADIUS_M
            }
        }
    }

    /// Heading after `driven_m` metres of the nominal course, not wrapped.
    fn heading(self, driven_m: f64) -> f64 {
        let Self::Loop {
            long_m, short_m, ..
        } = self
        else {
            return 0.0;
        };
        let arc = FRAC_PI_2 * CORNER_RADIUS_M;
        let (long, short) = (
            long_m - 2.0 * CORNER_RADIUS_M,
            short_m - 2.0 * CORNER_RADIUS_M,
        );
        let rounds = (driven_m / self.length_m()).floor();
        let mut rest = driven_m - rounds * self.length_m();
        let mut turned = -TAU * rounds;
        for straight in [long / 2.0, short, long, short] {
            rest -= straight;
            if rest <= 0.0 {
                return turned;
            }
            turned -= (rest / CORNER_RADIUS_M).min(FRAC_PI_2);
            rest -= arc;
            if rest <= 0.0 {
                return turned;
            }
        }
        turned
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    /// Integrates odometry rows and returns the pose at each of `times_s`, starting at the origin.
    /// Times and rows must be sorted.
    fn dead_reckoning(rows: &[OdometryRow], times_s: &[f64]) -> Vec<Se2> {
        let mut pose = Se2 {
            x: 0.0,
            y: 0.0,
            phi: 0.0,
        };
        let mut now = rows.first().map_or(0.0, |row| row.t_s);
        let mut next = 0;
        let mut poses = Vec::with_capacity(times_s.len());
        for &time in times_s {
            while now < time && next < rows.len() {
                let row_end = rows.get(next + 1).map_or(f64::INFINITY, |row| row.t_s);
                let until = row_end.min(time);
                pose = advance(&pose, &rows[next], until - now);
                now = until;
                if now >= row_end {
                    next += 1;
                }
            }
            poses.push(pose);
        }
        poses
    }

    const ROOM: Course = Course::Loop {
        long_m: 2.2,
        short_m: 1.2,
        overlap: 14,
    };

    #[test]
    fn noiseless_odometry_integrates_to_the_truth() {
        for course in [Course::Straight { step_m: 0.1 }, ROOM] {
            let path = TruePath::drive(course, 60, &mut ChaCha8Rng::seed_from_u64(3));
            let rows = path.odometry(&OdometryNoise::NONE, &mut ChaCha8Rng::seed_from_u64(4));
            let reckoned = dead_reckoning(&rows, &path.times_s);
            for (a, b) in reckoned.iter().zip(&path.poses) {
                assert!((a.x - b.x).hypot(a.y - b.y) < 1e-12);
                assert!(wrap(a.phi - b.phi).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn arc_series_meets_the_closed_form() {
        let start = Se2 {
            x: 1.0,
            y: -2.0,
            phi: 0.3,
        };
        for omega in [1.9e-4, 2.1e-4, 0.5, -3.0] {
            let control = OdometryRow {
                t_s: 0.0,
                v_mps: 0.7,
                omega_radps: omega,
            };
            let got = advance(&start, &control, 1.0);
            let radius = 0.7 / omega;
            let x = 1.0 + radius * ((0.3 + omega).sin() - 0.3_f64.sin());
            let y = -2.0 - radius * ((0.3 + omega).cos() - 0.3_f64.cos());
            // The closed form loses digits to cancellation at small omega.
            let tolerance = 8.0 * f64::EPSILON * radius.abs().max(1.0);
            assert!((got.x - x).abs() < tolerance && (got.y - y).abs() < tolerance);
        }
    }

    #[test]
    fn wall_run_is_a_decimetre_a_frame_with_varying_heading() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let path = TruePath::drive(Course::Straight { step_m: 0.1 }, 38, &mut rng);
        let end = path.poses[37];
        assert!((end.x - 3.7).abs() < 0.1, "{end:?}");
        assert!(end.y.abs() < 0.15, "{end:?}");
        let widest = path.poses.iter().map(|p| p.phi.abs()).fold(0.0, f64::max);
        assert!((0.01..0.06).contains(&widest), "{widest}");
    }

    #[test]
    fn room_loop_comes_back_to_its_start() {
        let path = TruePath::drive(ROOM, 186, &mut ChaCha8Rng::seed_from_u64(5));
        let nearest_start = path.poses[150..]
            .iter()
            .map(|p| p.x.hypot(p.y))
            .fold(f64::INFINITY, f64::min);
        assert!(nearest_start < 0.25, "{nearest_start}");
        assert!((ROOM.heading(ROOM.length_m() * 0.999) + TAU).abs() < 1e-12);
    }

    #[test]
    fn odometry_noise_has_the_stated_size_per_frame() {
        let path = TruePath::drive(
            Course::Straight { step_m: 0.1 },
            2001,
            &mut ChaCha8Rng::seed_from_u64(1),
        );
        let noise = OdometryNoise {
            speed_bias_ratio: 0.0,
            turn_bias_radps: 0.0,
            ..OdometryNoise::PAPER
        };
        let rows = path.odometry(&noise, &mut ChaCha8Rng::seed_from_u64(2));
        let (mut length2, mut turn2) = (0.0, 0.0);
        let groups = rows
            .chunks_exact(ROWS_PER_FRAME)
            .zip(path.controls.chunks_exact(ROWS_PER_FRAME));
        for (noisy, exact) in groups {
            let sum = |rows: &[OdometryRow], of: fn(&OdometryRow) -> f64| {
                rows.iter().map(of).sum::<f64>() * 0.1
            };
            let (long, short) = (sum(noisy, |r| r.v_mps), sum(exact, |r| r.v_mps));
            length2 += (long / short - 1.0).powi(2) / 2000.0;
            turn2 +=
                (sum(noisy, |r| r.omega_radps) - sum(exact, |r| r.omega_radps)).powi(2) / 2000.0;
        }
        // A sample deviation of 2000 draws is within 6 % at four sigma.
        assert!(
            (length2.sqrt() / 0.05 - 1.0).abs() < 0.07,
            "{}",
            length2.sqrt()
        );
        assert!(
            (turn2.sqrt() / 0.012 - 1.0).abs() < 0.07,
            "{}",
            turn2.sqrt()
        );
    }
}
