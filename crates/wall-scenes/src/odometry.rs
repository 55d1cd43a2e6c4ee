//! The report of the wheels.
//!
//! Noise is stated per frame, as a filter meets it: a step has
//! `speed_ratio` of white error in its length and `heading_rad` in its turn;
//! with n rows a frame the rows carry `sqrt(n)` times the relative error in
//! speed and `1/sqrt(n)` times the turn. The wheels of a robot that stands say so without noise. Two constants are drawn once per seed: a speed
//! scale error and a turn-rate offset; those of the carrier come on top.

use crate::carrier::Carrier;
use crate::timing::{FRAME_PERIOD_S, ROWS_PER_FRAME};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

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

/// The rows the wheels report for true `controls`: with noise and constant errors; rows at rest stay at rest.
pub(crate) fn report(
    controls: &[OdometryRow],
    noise: &OdometryNoise,
    carrier: &Carrier,
    rng: &mut ChaCha8Rng,
) -> Vec<OdometryRow> {
    let dt = FRAME_PERIOD_S / ROWS_PER_FRAME as f64;
    let share = (ROWS_PER_FRAME as f64).sqrt();
    let mut normal = || rng.sample::<f64, _>(StandardNormal);
    let scale = 1.0 + noise.speed_bias_ratio * normal();
    let offset = noise.turn_bias_radps * normal();
    let moving = controls.len() - 1;
    let mut rows = controls.to_vec();
    for row in &mut rows[..moving] {
        let errors = [
            noise.speed_ratio * share * normal(),
            offset + noise.heading_rad / share / dt * normal(),
        ];
        if row.v_mps == 0.0 && row.omega_radps == 0.0 {
            continue;
        }
        row.v_mps *= scale + errors[0];
        row.omega_radps += errors[1];
        row.v_mps *= 1.0 + carrier.wheel_radius_ratio;
        row.omega_radps += carrier.turn_bias_radps;
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    fn straight(frames: usize) -> Vec<OdometryRow> {
        let dt = FRAME_PERIOD_S / ROWS_PER_FRAME as f64;
        (0..=frames * ROWS_PER_FRAME)
            .map(|row| OdometryRow {
                t_s: row as f64 * dt,
                v_mps: 0.2 + 0.01 * (row % 7) as f64,
                omega_radps: 0.01 * (row % 3) as f64,
            })
            .collect()
    }

    #[test]
    fn odometry_noise_has_the_stated_size_per_frame() {
        let noise = OdometryNoise {
            speed_bias_ratio: 0.0,
            turn_bias_radps: 0.0,
            ..OdometryNoise::PAPER
        };
        let controls = straight(2000);
        let rows = report(
            &controls,
            &noise,
            &Carrier::IDEAL,
            &mut ChaCha8Rng::seed_from_u64(2),
        );
        let (mut length2, mut turn2) = (0.0, 0.0);
        let groups = rows
            .chunks_exact(ROWS_PER_FRAME)
            .zip(controls.chunks_exact(ROWS_PER_FRAME));
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

    #[test]
    fn constant_errors_of_the_carrier_are_in_every_moving_row() {
        let carrier = Carrier {
            turn_bias_radps: -0.02,
            wheel_radius_ratio: 0.03,
            ..Carrier::IDEAL
        };
        let controls = straight(4);
        let rows = report(
            &controls,
            &OdometryNoise::NONE,
            &carrier,
            &mut ChaCha8Rng::seed_from_u64(2),
        );
        for (row, control) in rows.iter().zip(&controls).take(20) {
            assert!((row.v_mps / control.v_mps - 1.03).abs() < 1e-12);
            assert!((row.omega_radps - control.omega_radps + 0.02).abs() < 1e-12);
        }
        assert_eq!(rows[20], controls[20]);
    }
}
