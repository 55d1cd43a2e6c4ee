//! The odometry noise of the generated scenes, stated as the configuration asks for it.
//!
//! It is not guessed: it is the white noise that the generator put into its rows. The generator's constant turn-rate
//! offset has no counterpart in the configuration and stays unmodelled, for everybody; so do the effects of a scene's
//! carrier, its random slip included.

use slam_pipeline::config::OdometrySection;
use wall_scenes::{FRAME_PERIOD_S, OdometryNoise, ROWS_PER_FRAME};

/// The generator's noise per frame as noise per row: with n white rows a frame,
/// `sqrt(n)` times the relative error in speed, and for the turn rate the frame's
/// heading error over `sqrt(n)` row durations.
pub(crate) fn odometry_section(noise: &OdometryNoise) -> OdometrySection {
    let rows = ROWS_PER_FRAME as f64;
    let row_s = FRAME_PERIOD_S / rows;
    OdometrySection {
        velocity_noise_ratio: noise.speed_ratio * rows.sqrt(),
        velocity_noise_mps: 0.0,
        turn_noise_ratio: 0.0,
        turn_noise_radps: noise.heading_rad / rows.sqrt() / row_s,
        slip_ratio: 0.0,
        scale_bias: noise.speed_bias_ratio,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slam_pipeline::{Odometer, OdometryInterval};

    #[test]
    fn a_frame_of_rows_has_the_noise_the_generator_states_per_frame() {
        let noise = OdometryNoise::PAPER;
        let mut odometer = Odometer::new(&odometry_section(&noise));
        let row = OdometryInterval {
            duration_s: FRAME_PERIOD_S / ROWS_PER_FRAME as f64,
            v_mps: 0.2,
            omega_radps: 0.0,
        };
        for _ in 0..ROWS_PER_FRAME {
            odometer.push(&row).unwrap();
        }
        let covariance = odometer.control().covariance;
        // 0.1 m driven straight: 5 % of it, 0.012 rad.
        assert!((covariance[(0, 0)].sqrt() - 0.005).abs() < 1e-6);
        assert!((covariance[(2, 2)].sqrt() - 0.012).abs() < 1e-6);
    }
}
