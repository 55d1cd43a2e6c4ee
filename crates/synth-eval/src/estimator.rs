//! The estimators under comparison: dead reckoning and the filters, each with its number of particles.
//!
//! All filters run the defaults of `slam_pipeline`, so detection, matching, keyframes and map
//! management are the same; what differs is the method and the number of particles. The noise
//! of the odometry is not guessed: it is the white noise the scene generator put into its rows,
//! stated per row as the configuration asks for it. The generator's constant turn-rate offset
//! (0.001 rad/s) has no counterpart in the configuration and stays unmodelled, for everybody;
//! its wheels do not slip sideways, so the slip is zero.

use slam_pipeline::config::{Config, Method, OdometrySection};
use wall_scenes::{FRAME_PERIOD_S, OdometryNoise, ROWS_PER_FRAME};

/// One entry of the comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Estimator {
    /// Odometry alone.
    DeadReckoning,
    /// A particle filter.
    Filter {
        /// Which one.
        method: Method,
        /// How many particles.
        particles: u32,
    },
}

const fn filter(method: Method, particles: u32) -> Estimator {
    Estimator::Filter { method, particles }
}

/// The entries of `--quick`, in the order they are printed.
pub(crate) const QUICK: &[Estimator] = &[
    Estimator::DeadReckoning,
    filter(Method::Conventional, 100),
    filter(Method::Conventional, 500),
    filter(Method::Paper, 50),
    filter(Method::Exact, 50),
];

/// The entries of a full run, in the order they are printed.
pub(crate) const FULL: &[Estimator] = &[
    Estimator::DeadReckoning,
    filter(Method::Conventional, 100),
    filter(Method::Conventional, 500),
    filter(Method::Paper, 50),
    filter(Method::Paper, 100),
    filter(Method::Exact, 20),
    filter(Method::Exact, 50),
    filter(Method::Exact, 100),
];

impl Estimator {
    /// Number of particles; none for dead reckoning.
    pub(crate) fn particles(self) -> u32 {
        match self {
            Self::DeadReckoning => 0,
            Self::Filter { particles, .. } => particles,
        }
    }

    /// The family a curve over the number of particles belongs to.
    pub(crate) fn family(self) -> &'static str {
        match self {
            Self::DeadReckoning => "dead reckoning",
            Self::Filter { method, .. } => match method {
                Method::Conventional => "conventional",
                Method::Paper => "paper",
                Method::Exact => "exact",
            },
        }
    }

    /// Name as printed.
    pub(crate) fn label(self) -> String {
        match self {
            Self::DeadReckoning => self.family().to_owned(),
            Self::Filter { particles, .. } => format!("{} {particles}", self.family()),
        }
    }

    /// The configuration of one run: the defaults, this method, `seed`, one thread.
    pub(crate) fn config(self, seed: u64, noise: &OdometryNoise) -> Config {
        let mut config = Config::default();
        if let Self::Filter { method, particles } = self {
            config.filter.method = method;
            config.filter.particles = particles;
        }
        config.filter.seed = seed;
        config.filter.threads = 1;
        config.odometry = odometry_section(noise);
        config
    }
}

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

    #[test]
    fn every_configuration_is_valid_and_shares_the_front_end() {
        let reference = FULL[1].config(3, &OdometryNoise::PAPER);
        for estimator in FULL {
            let config = estimator.config(3, &OdometryNoise::PAPER);
            assert_eq!(config.features, reference.features);
            assert_eq!(config.association, reference.association);
            assert_eq!(config.keyframes, reference.keyframes);
            assert_eq!(config.odometry, reference.odometry);
            assert!(config.check().is_ok(), "{}", estimator.label());
        }
    }

    #[test]
    fn quick_is_a_part_of_full_in_the_same_order() {
        let mut full = FULL.iter();
        assert!(QUICK.iter().all(|entry| full.any(|other| other == entry)));
    }
}
