//! `gyro.csv`: a turn rate that is better than that of the wheels.
//!
//! Every row of odometry that the gyroscope covers takes the mean of its rate over the row, the integral of the straight
//! lines between its samples. Its bias stays in: the filter estimates a constant error of the turn rate.

use std::path::Path;

use super::columns::{TIME, TURN_RATE, Table};
use super::rows::{OdometryRow, usual_interval_s};
use crate::error::SequenceError;
use crate::text::increasing;
use crate::warning::Warning;

/// File name.
pub(super) const GYRO: &str = "gyro.csv";
/// Its header.
const HEADER: &str = "t_s,omega_radps";
/// Steps longer than so many usual ones are no measurement of what lies between.
const HOLE_STEPS: f64 = 5.0;

/// Replaces the turn rate of the rows that the file covers.
pub(super) fn apply(
    path: &Path,
    rows: &mut [OdometryRow],
    warnings: &mut Vec<Warning>,
) -> Result<(), SequenceError> {
    let table = Table::open(path, &TURN_RATE, HEADER)?;
    let Some(selection) = table.select([&TIME, &TURN_RATE]) else {
        return Err(table.header_fault(HEADER));
    };
    let mut samples: Vec<(f64, f64)> = Vec::new();
    for (line, [t_s, omega]) in table.rows(&selection)? {
        increasing(path, line, samples.last().map(|s| s.0), t_s)?;
        samples.push((t_s, omega));
    }
    let covered = replace_turn_rates(rows, &samples);
    let intervals = rows.len().saturating_sub(1);
    let message = format!("the turn rate is that of {GYRO}");
    warnings.push(if covered == intervals {
        Warning::new("turn-rate-from-gyro", message)
    } else {
        let less = intervals - covered;
        Warning::new(
            "turn-rate-from-gyro",
            format!(
                "{message}; it does not cover {less} of {intervals} rows, which keep their own"
            ),
        )
    });
    Ok(())
}

/// Replaces the turn rate of every row that the samples cover; how many.
fn replace_turn_rates(rows: &mut [OdometryRow], samples: &[(f64, f64)]) -> usize {
    let times: Vec<f64> = samples.iter().map(|s| s.0).collect();
    let hole_s = usual_interval_s(&times).unwrap_or(0.0) * HOLE_STEPS;
    // Angle turned from the first sample to each.
    let mut angles = vec![0.0; samples.len()];
    for index in 1..samples.len() {
        let (from, to) = (samples[index - 1], samples[index]);
        angles[index] = angles[index - 1] + 0.5 * (from.1 + to.1) * (to.0 - from.0);
    }
    let angle_at = |t_s: f64| -> Option<f64> {
        let after = times.partition_point(|&t| t < t_s);
        if after == 0 {
            return (times.first() == Some(&t_s)).then_some(0.0);
        }
        let (from, to) = (samples[after - 1], *samples.get(after)?);
        if to.0 - from.0 > hole_s {
            return None;
        }
        let dt = t_s - from.0;
        let slope = (to.1 - from.1) / (to.0 - from.0);
        Some(angles[after - 1] + dt * (from.1 + 0.5 * slope * dt))
    };
    let mut covered = 0;
    let mut last = None;
    for index in 0..rows.len().saturating_sub(1) {
        let (from_s, to_s) = (rows[index].t_s, rows[index + 1].t_s);
        if let (Some(from), Some(to)) = (angle_at(from_s), angle_at(to_s)) {
            rows[index].omega_radps = (to - from) / (to_s - from_s);
            covered += 1;
            last = Some(index);
        }
    }
    // The last row goes on as the one before it.
    if let Some(end) = rows.len().checked_sub(1)
        && last.is_some_and(|index| index + 1 == end)
    {
        rows[end].omega_radps = rows[end - 1].omega_radps;
    }
    covered
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rate that grows linearly is integrated exactly, whatever the times of the rows.
    #[test]
    fn rows_take_the_mean_rate_and_keep_their_own_where_there_is_none() {
        let samples: Vec<(f64, f64)> = (0..=10)
            .map(|i| (0.1 * f64::from(i), 0.2 * f64::from(i)))
            .collect();
        let mut rows: Vec<OdometryRow> = [0.05, 0.33, 0.62, 1.4, 1.8]
            .map(|t_s| OdometryRow {
                t_s,
                v_mps: 1.0,
                omega_radps: -7.0,
            })
            .to_vec();
        assert_eq!(replace_turn_rates(&mut rows, &samples), 2);
        // The rate is 2 t, its mean over an interval the one in the middle.
        assert!((rows[0].omega_radps - 0.38).abs() < 1e-12);
        assert!((rows[1].omega_radps - 0.95).abs() < 1e-12);
        assert!(rows[2..].iter().all(|row| row.omega_radps == -7.0));
    }
}
