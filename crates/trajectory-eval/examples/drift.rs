//! Absolute and relative error of a path whose heading drifts, under every alignment.

#![expect(clippy::print_stdout, reason = "an example for a terminal")]

use trajectory_eval::{Alignment, EvaluationError, StampedPose, absolute_error, relative_error};

/// A left turn of 5 m radius at 0.5 m/s, ten poses a second, whose turn rate is off by `bias` rad/s.
fn path(bias: f64) -> Vec<StampedPose> {
    let (speed_mps, turn_radps, step_s) = (0.5, 0.1 + bias, 0.1);
    (0..300)
        .map(|k| {
            let phi = turn_radps * step_s * f64::from(k);
            let radius = speed_mps / turn_radps;
            StampedPose::planar(
                step_s * f64::from(k),
                radius * phi.sin(),
                radius * (1.0 - phi.cos()),
                phi,
            )
        })
        .collect()
}

fn main() -> Result<(), EvaluationError> {
    let (estimate, reference) = (path(0.002), path(0.0));
    for alignment in [Alignment::None, Alignment::Se2, Alignment::Sim3] {
        let absolute = absolute_error(&estimate, &reference, alignment)?;
        let relative = relative_error(&estimate, &reference, 10, alignment)?;
        println!(
            "{alignment}: absolute {:.3} m RMSE, at the end {:.3} m; relative {:.2} mm per second",
            absolute.translation_m.rmse,
            absolute.last().translation_m,
            1e3 * relative.translation_m.rmse
        );
    }
    Ok(())
}
