//! The odometry noise of the generated scenes, stated as the configuration asks for it.
//!
//! It is not guessed: it is the white noise that the generator put into its rows. The generator's constant turn-rate
//! offset has no counterpart in the configuration and stays unmodelled, for everybody; so do the effects of a scene's
//! carrier, its random slip included.

use slam_pipeline::config::OdometrySection;
use wall_scenes::{FRAME_PERIOD_S, OdometryNoise};

/// The generator's noise per frame as noise per square root of metre and second, for a drive of `step_m` metres a frame:
/// a share r of a step d is r sqrt(d) per square root of a metre, and the heading error of a frame spreads over its time.
pub(crate) fn odometry_section(noise: &OdometryNoise, step_m: f64) -> OdometrySection {
    OdometrySection {
        forward_per_sqrt_m: noise.speed_ratio * step_m.sqrt(),
        forward_per_sqrt_s: 0.0,
        sideways_per_sqrt_m: 0.0,
        turn_per_sqrt_rad: 0.0,
        turn_per_sqrt_m: 0.0,
        turn_per_sqrt_s: noise.heading_rad / FRAME_PERIOD_S.sqrt(),
        scale_bias: noise.speed_bias_ratio,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use slam_pipeline::{Odometer, OdometryInterval};
    use wall_scenes::ROWS_PER_FRAME;

    #[test]
    fn a_frame_of_rows_has_the_noise_the_generator_states_per_frame() {
        let noise = OdometryNoise::PAPER;
        let mut odometer = Odometer::new(&odometry_section(&noise, 0.1));
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
