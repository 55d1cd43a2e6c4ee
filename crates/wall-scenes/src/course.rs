//! The plan of a path before steering is added: its heading after so many metres.

use std::f64::consts::{FRAC_PI_2, TAU};

/// Radius of the room loop's corners, metres.
const CORNER_RADIUS_M: f64 = 0.45;

/// Plan of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Course {
    /// Straight along x, this many metres a frame; the slope of the floor, if any, comes again after `wave_m`.
    Straight { step_m: f64, wave_m: f64 },
    /// Clockwise around a rectangle with rounded corners, starting in the middle of
    /// the first long side, `laps` times; `overlap` frames drive the start again.
    Loop {
        long_m: f64,
        short_m: f64,
        laps: usize,
        overlap: usize,
    },
}

impl Course {
    /// Metres of a frame in a drive of `frames` frames without stops.
    pub(crate) fn step_m(self, frames: usize) -> f64 {
        match self {
            Self::Straight { step_m, .. } => step_m,
            Self::Loop { laps, overlap, .. } => {
                let steps = frames.saturating_sub(1 + overlap).max(1);
                laps as f64 * self.round_m() / steps as f64
            }
        }
    }

    /// Length of one round, after which floor and heading are the same again, metres.
    pub(crate) fn round_m(self) -> f64 {
        match self {
            Self::Straight { wave_m, .. } => wave_m,
            Self::Loop {
                long_m, short_m, ..
            } => {
                let straights = 2.0 * (long_m + short_m - 4.0 * CORNER_RADIUS_M);
                straights + TAU * CORNER_RADIUS_M
            }
        }
    }

    /// Slope of the floor after `driven_m` metres, radians: up, then down to the height of the start.
    pub(crate) fn slope(self, steepest_rad: f64, driven_m: f64) -> f64 {
        steepest_rad * (TAU * driven_m / self.round_m()).sin()
    }

    /// Heading after `driven_m` metres of the nominal course, not wrapped.
    pub(crate) fn heading(self, driven_m: f64) -> f64 {
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
        let rounds = (driven_m / self.round_m()).floor();
        let mut rest = driven_m - rounds * self.round_m();
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

    const ROOM: Course = Course::Loop {
        long_m: 2.2,
        short_m: 1.2,
        laps: 3,
        overlap: 14,
    };

    #[test]
    fn a_round_turns_once_and_laps_are_that_many_rounds() {
        assert!((ROOM.heading(ROOM.round_m() * 0.999) + TAU).abs() < 1e-12);
        let frames = 15 + 3 * 171;
        let driven = ROOM.step_m(frames) * (frames - 1 - 14) as f64;
        assert!((driven / ROOM.round_m() - 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_slope_comes_back_to_its_height_after_a_round() {
        let steps = 10_000;
        let height: f64 = (0..steps)
            .map(|k| (f64::from(k) + 0.5) / f64::from(steps) * ROOM.round_m())
            .map(|driven| ROOM.slope(0.05, driven).sin())
            .sum();
        assert!(height.abs() < 1e-9, "{height}");
        let steepest = ROOM.slope(0.05, ROOM.round_m() / 4.0);
        assert!((steepest - 0.05).abs() < 1e-12);
    }
}
