//! Runs without odometry: the robot is expected to go on as it went.
//!
//! The motion predicted for a frame is the one estimated over the last frames, scaled by the time between them, with wide
//! noise, so that the images decide. Nothing measures a length: the first step is declared to be [`UNIT_STEP`] long, and
//! path and map are right up to that one factor, as far as it is kept along the way. It is handed on from step to step by
//! the landmarks that two steps share, so it drifts as a random walk, and where the images lose sight of everything it
//! starts anew. The robot is expected to start forwards: a start backwards, or one at rest, is found only if the noise
//! reaches there.

use mono_geometry::Se2;
use slam_io::OdometryRow;
use slam_pipeline::OdometryInterval;
use slam_pipeline::config::Config;

/// Length of the first step, in the unit of the run. The nearest landmarks of the default configuration are four such
/// steps away.
pub const UNIT_STEP: f64 = 0.1;

/// Standard deviations of the prediction for a usual interval between frames: a share of the first step, and radians.
const FORWARD_SHARE: f64 = 0.3;
const TURN_RAD: f64 = 0.05;
/// Sideways, per square root of a unit.
const SIDEWAYS_PER_SQRT_M: f64 = 0.02;
/// Turn, per square root of a radian.
const TURN_PER_SQRT_RAD: f64 = 0.1;
/// Steps over which the last motion is measured: one is noisy, many lag behind.
const STEPS: usize = 2;

/// `config` for images at these times without odometry.
///
/// The noise of the prediction goes into `[odometry]` unless the user has stated one there; the constants that only
/// odometry can tell (scale, bias of the turn rate, turning centre) are fixed.
#[must_use]
pub fn settings(mut config: Config, times_s: &[f64]) -> Config {
    let preset = Config::for_robot(config.robot.preset);
    if config.odometry == preset.odometry {
        let usual_s = usual_step_s(times_s);
        config.odometry.forward_per_sqrt_m = 0.0;
        config.odometry.forward_per_sqrt_s = FORWARD_SHARE * UNIT_STEP / usual_s.sqrt();
        config.odometry.sideways_per_sqrt_m = SIDEWAYS_PER_SQRT_M;
        config.odometry.turn_per_sqrt_rad = TURN_PER_SQRT_RAD;
        config.odometry.turn_per_sqrt_m = 0.0;
        config.odometry.turn_per_sqrt_s = TURN_RAD / usual_s.sqrt();
    }
    config.odometry.scale_bias = 0.0;
    config.carrier.scale_sigma = 0.0;
    config.carrier.scale_drift = 0.0;
    config.carrier.turn_bias_sigma = 0.0;
    config.carrier.turning_centre_sigma_m = 0.0;
    config
}

/// Median step between ascending times, at least a millisecond, seconds.
fn usual_step_s(times_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(1.0).max(1e-3)
}

/// The motion expected up to the next frame after `path`, whose poses are those of the first frames at `times_s`.
///
/// `None` before the first frame. O(1).
pub(crate) fn expected(path: &[Se2], times_s: &[f64]) -> Option<OdometryInterval> {
    let next = path.len();
    let last = next.checked_sub(1)?;
    let duration_s = times_s.get(next)? - times_s[last];
    let from = last.saturating_sub(STEPS);
    let (v_mps, omega_radps) = if from == last {
        (UNIT_STEP / duration_s, 0.0)
    } else {
        let step = path[from].between(&path[last]).log();
        let while_s = times_s[last] - times_s[from];
        (step.x / while_s, step.z / while_s)
    };
    Some(OdometryInterval {
        duration_s,
        v_mps,
        omega_radps,
    })
}

/// The rows of these intervals, which end at `times_s` from the second one on.
pub(crate) fn rows(intervals: &[OdometryInterval], times_s: &[f64]) -> Vec<OdometryRow> {
    times_s
        .iter()
        .zip(intervals)
        .map(|(&t_s, interval)| OdometryRow {
            t_s,
            v_mps: interval.v_mps,
            omega_radps: interval.omega_radps,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use mono_geometry::motion::exact_arc;

    #[test]
    fn the_first_step_is_the_unit_and_the_next_ones_go_on() {
        let times = [0.0, 0.5, 1.0, 1.6, 1.8];
        assert!(expected(&[], &times).is_none());
        let mut path = vec![Se2::identity()];
        let first = expected(&path, &times).expect("a step");
        assert!((first.v_mps * first.duration_s - UNIT_STEP).abs() < 1e-15);
        assert_eq!(first.omega_radps, 0.0);
        // A constant motion is continued exactly, whatever the steps of time.
        for pair in times.windows(2) {
            let last = path[path.len() - 1];
            path.push(last.compose(&exact_arc(0.7, -0.3, pair[1] - pair[0])));
        }
        for known in 2..times.len() {
            let next = expected(&path[..known], &times).expect("a step");
            assert!((next.v_mps - 0.7).abs() < 1e-12, "{next:?}");
            assert!((next.omega_radps + 0.3).abs() < 1e-12, "{next:?}");
            assert_eq!(next.duration_s, times[known] - times[known - 1]);
        }
        assert!(expected(&path, &times).is_none(), "there is no next frame");
    }

    #[test]
    fn a_stated_noise_is_kept_and_what_nobody_measures_is_fixed() {
        let times: Vec<f64> = (0..9).map(|i| 0.25 * f64::from(i)).collect();
        let wide = settings(Config::default(), &times);
        assert!((wide.odometry.forward_per_sqrt_s * 0.5 - 0.03).abs() < 1e-15);
        assert!((wide.odometry.turn_per_sqrt_s * 0.5 - 0.05).abs() < 1e-15);
        assert_eq!(
            (wide.carrier.scale_sigma, wide.carrier.scale_drift),
            (0.0, 0.0)
        );
        assert!(wide.check().is_ok());
        let mut stated = Config::default();
        stated.odometry.turn_per_sqrt_s = 0.3;
        let kept = settings(stated.clone(), &times);
        assert_eq!(kept.odometry.turn_per_sqrt_s, 0.3);
        assert_eq!(
            kept.odometry.forward_per_sqrt_s,
            stated.odometry.forward_per_sqrt_s
        );
        // A single image has no step.
        assert!(settings(Config::default(), &[3.0]).check().is_ok());
    }
}
