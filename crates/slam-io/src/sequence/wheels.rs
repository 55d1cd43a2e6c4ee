//! `wheels.csv`: counts of the encoders of the left and the right wheel.
//!
//! The row of a reading holds the mean speed and the mean turn rate up to the next reading, so that the rows give back
//! exactly the distance and the turn of the counts, whatever the steps of time. The last reading repeats the speed before it.
//!
//! Quantisation: a count is off by less than a tick, but the tick that one difference lacks the next one has, so the errors
//! of the rows cancel but for the first and the last: over any stretch the way of a wheel is off by a variance of
//! (metres per tick)^2 / 6, not by that much for every row. It must therefore not be added per row; it does not depend on
//! the row rate, and the noise per square root of a metre exceeds it after a few ticks. Where a tick turns the robot
//! noticeably the reader says so.
//!
//! A counter of k bits wraps: differences are taken modulo the range. Without a range in `robot.toml` a count that drops
//! by almost its whole range against the driving direction is refused, and so is any jump that no wheel makes.

use std::path::Path;

use mono_geometry::motion::differential_drive;

use super::columns::{LEFT, RIGHT, TIME, Table};
use super::robot::{Counts, Wheels};
use super::rows::{OdometryRow, usual_interval_s};
use crate::error::SequenceError;
use crate::text::{increasing, line_fault};
use crate::warning::Warning;

/// File name.
pub(super) const WHEELS: &str = "wheels.csv";
/// Its header.
const HEADER: &str = "t_s,left_ticks,right_ticks";
/// Largest believable speed of a wheel's rim, m/s.
const MAX_WHEEL_SPEED_MPS: f64 = 100.0;
/// Largest believable change of a wheel's speed between two rows: so much at once, m/s, and so much a second, m/s^2.
const MAX_SPEED_STEP_MPS: f64 = 5.0;
const MAX_ACCELERATION_MPS2: f64 = 100.0;
/// Counts are whole numbers that a double holds exactly.
const MAX_COUNT: f64 = 9.0e15;
/// Turn by one tick of one wheel, radians, beyond which the filter's noise does not cover it from one frame to the next.
const COARSE_TURN_RAD: f64 = 0.03;

/// One line of the file.
#[derive(Debug, Clone, Copy)]
struct Reading {
    line: u64,
    t_s: f64,
    /// Left, right.
    counts: [i64; 2],
}

/// Reads the file. `turn_known`: a gyroscope tells the turn, so that the base may be missing.
pub(super) fn read_wheels(
    path: &Path,
    robot_path: &Path,
    wheels: &Wheels,
    turn_known: bool,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<OdometryRow>, SequenceError> {
    let lacks = |expected: &str| SequenceError::File {
        path: robot_path.to_path_buf(),
        expected: format!("{expected} in [wheels] to read {WHEELS}"),
        found: "none".into(),
    };
    let Some(metres) = wheels.metres_per_tick else {
        return Err(lacks(
            "metres_per_tick, or wheel_radius_m and ticks_per_turn,",
        ));
    };
    let base_m = match wheels.base_m {
        Some(base_m) => base_m,
        // Wheels that tell no turn.
        None if turn_known => f64::INFINITY,
        None => return Err(lacks("base_m, the distance between the two wheels,")),
    };
    let table = Table::open(path, &LEFT, HEADER)?;
    let columns = [&TIME, &LEFT, &RIGHT];
    let Some(selection) = table.select(columns) else {
        return Err(table.header_fault(HEADER));
    };
    if let Some(departure) = table.departure(&selection, columns) {
        warnings.push(Warning::new(
            "odometry-columns",
            format!("{WHEELS}: {departure}"),
        ));
    }
    let readings = readings(path, &table.rows(&selection)?, wheels.tick_range)?;
    let differences = differences(path, &readings, wheels)?;
    check_jumps(path, &readings, &differences, metres, wheels)?;
    let finest = metres[0].max(metres[1]) / base_m;
    if finest > COARSE_TURN_RAD {
        warnings.push(Warning::new(
            "coarse-encoders",
            format!(
                "One tick of a wheel is {:.1} mm and turns the robot by {finest:.3} rad: the noise of [odometry] does not \
                 cover that from one frame to the next; raise turn_per_sqrt_s to about {finest:.2}",
                1e3 * metres[0].max(metres[1]),
            ),
        ));
    }
    Ok(rows(&readings, &differences, metres, base_m))
}

fn readings(
    path: &Path,
    table: &[(u64, [f64; 3])],
    range: Option<[i64; 2]>,
) -> Result<Vec<Reading>, SequenceError> {
    let mut readings: Vec<Reading> = Vec::with_capacity(table.len());
    for &(line, [t_s, left, right]) in table {
        increasing(path, line, readings.last().map(|r| r.t_s), t_s)?;
        for (name, count) in [(LEFT.name(), left), (RIGHT.name(), right)] {
            if count.fract() != 0.0 || count.abs() > MAX_COUNT {
                return Err(line_fault(
                    path,
                    line,
                    format!("a whole number for {name}"),
                    count.to_string(),
                ));
            }
            if let Some([low, high]) = range
                && !(low as f64..=high as f64).contains(&count)
            {
                return Err(line_fault(
                    path,
                    line,
                    format!("{name} within tick_range = [{low}, {high}] of robot.toml"),
                    count.to_string(),
                ));
            }
        }
        readings.push(Reading {
            line,
            t_s,
            counts: [left as i64, right as i64],
        });
    }
    Ok(readings)
}

/// Ticks from one reading to the next; one entry less than readings.
fn differences(
    path: &Path,
    readings: &[Reading],
    wheels: &Wheels,
) -> Result<Vec<[i64; 2]>, SequenceError> {
    if let [only] = readings {
        return Err(line_fault(
            path,
            only.line,
            "at least two rows, a motion is the difference of counts",
            "one",
        ));
    }
    Ok(readings
        .windows(2)
        .map(|pair| match wheels.counts {
            Counts::SinceLastRow => pair[1].counts,
            Counts::Cumulative => core::array::from_fn(|wheel| {
                wrapped_difference(
                    pair[0].counts[wheel],
                    pair[1].counts[wheel],
                    wheels.tick_range,
                )
            }),
        })
        .collect())
}

/// The shortest way from one count to another on a counter that wraps from the end of `range` to its beginning.
fn wrapped_difference(from: i64, to: i64, range: Option<[i64; 2]>) -> i64 {
    let difference = i128::from(to) - i128::from(from);
    let shortest = match range {
        None => difference,
        Some([low, high]) => {
            let span = i128::from(high) - i128::from(low) + 1;
            (difference + span / 2).rem_euclid(span) - span / 2
        }
    };
    // Counts are below 2^53, so are their differences.
    shortest as i64
}

/// Refuses a difference that no wheel makes; names a wrap where it looks like one.
fn check_jumps(
    path: &Path,
    readings: &[Reading],
    differences: &[[i64; 2]],
    metres: [f64; 2],
    wheels: &Wheels,
) -> Result<(), SequenceError> {
    let times: Vec<f64> = readings.iter().map(|r| r.t_s).collect();
    let usual_s = usual_interval_s(&times).unwrap_or(1.0);
    for (wheel, side) in ["left", "right"].into_iter().enumerate() {
        let wrap = likely_wrap(readings, differences, wheel, wheels);
        let mut before_mps: Option<f64> = None;
        for (index, difference) in differences.iter().enumerate() {
            let ticks = difference[wheel];
            let dt_s = times[index + 1] - times[index];
            // Stamps jitter: the ticks of a short step may be those of a usual one.
            let speed = ticks as f64 * metres[wheel] / dt_s.max(usual_s);
            let step = before_mps.map_or(0.0, |before| (speed - before).abs());
            let allowed = MAX_SPEED_STEP_MPS + MAX_ACCELERATION_MPS2 * dt_s.max(usual_s);
            let wraps = wrap.is_some_and(|wrap| wrap.index == index);
            if speed.abs() > MAX_WHEEL_SPEED_MPS || step > allowed || wraps {
                let cause = match (wrap, wheels.tick_range, wheels.counts) {
                    (Some(Wrap { low, high, .. }), ..) => format!(
                        "; a counter that wraps? then put tick_range = [{low}, {high}] into [wheels] of robot.toml"
                    ),
                    (None, None, Counts::Cumulative) => "; a counter that wraps (tick_range in robot.toml), counts since the \
                         last row (counts = \"since_last_row\"), or a metres_per_tick that is too large?"
                        .to_owned(),
                    _ => "; rows that are missing, or a metres_per_tick that is too large?".to_owned(),
                };
                return Err(line_fault(
                    path,
                    readings[index + 1].line,
                    format!("a {side} count that a wheel can reach in {dt_s:.3} s"),
                    format!(
                        "a step of {ticks} ticks, {:.1} m, after {}{cause}",
                        ticks as f64 * metres[wheel],
                        readings[index].counts[wheel],
                    ),
                ));
            }
            before_mps = Some(speed);
        }
    }
    Ok(())
}

/// A difference that looks like the wrap of a counter, and the range that would explain it.
#[derive(Debug, Clone, Copy)]
struct Wrap {
    index: usize,
    low: i64,
    high: i64,
}

/// Looks for a difference of nearly the whole range of the smallest counter of 2^8 to 2^32 states that holds all counts,
/// against the direction of its neighbours, where usual differences are far smaller.
fn likely_wrap(
    readings: &[Reading],
    differences: &[[i64; 2]],
    wheel: usize,
    wheels: &Wheels,
) -> Option<Wrap> {
    if wheels.tick_range.is_some() || wheels.counts == Counts::SinceLastRow {
        return None;
    }
    let counts = || readings.iter().map(|r| r.counts[wheel]);
    let (smallest, largest) = (counts().min()?, counts().max()?);
    let (low, high) = (8..=32)
        .map(|bits| 1_i64 << bits)
        .map(|span| {
            if smallest < 0 {
                (-span / 2, span / 2 - 1)
            } else {
                (0, span - 1)
            }
        })
        .find(|&(low, high)| low <= smallest && largest <= high)?;
    let span = high - low + 1;
    let mut sizes: Vec<i64> = differences.iter().map(|d| d[wheel].abs()).collect();
    sizes.sort_unstable();
    if sizes[sizes.len() / 2] > span / 16 {
        return None;
    }
    let neighbour = |index: usize| {
        let before = index.checked_sub(1).map_or(0, |i| differences[i][wheel]);
        let after = differences.get(index + 1).map_or(0, |d| d[wheel]);
        if before == 0 { after } else { before }
    };
    (0..differences.len())
        .find(|&index| {
            let step = differences[index][wheel];
            step.abs() > span / 8 * 7 && step.signum() == -neighbour(index).signum()
        })
        .map(|index| Wrap { index, low, high })
}

/// Rows with the mean speed and turn rate of each interval.
fn rows(
    readings: &[Reading],
    differences: &[[i64; 2]],
    metres: [f64; 2],
    base_m: f64,
) -> Vec<OdometryRow> {
    let mut rows: Vec<OdometryRow> = readings
        .windows(2)
        .zip(differences)
        .map(|(pair, ticks)| {
            let [left_m, right_m] =
                core::array::from_fn(|wheel| ticks[wheel] as f64 * metres[wheel]);
            let travel = differential_drive(left_m, right_m, base_m);
            let dt_s = pair[1].t_s - pair[0].t_s;
            OdometryRow {
                t_s: pair[0].t_s,
                v_mps: travel.distance_m / dt_s,
                omega_radps: travel.turn_rad / dt_s,
            }
        })
        .collect();
    if let (Some(last), Some(reading)) = (rows.last().copied(), readings.last()) {
        rows.push(OdometryRow {
            t_s: reading.t_s,
            ..last
        });
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_wrap_at_both_ends() {
        let signed = Some([-32_768, 32_767]);
        assert_eq!(wrapped_difference(32_767, -32_768, signed), 1);
        assert_eq!(wrapped_difference(-32_768, 32_767, signed), -1);
        assert_eq!(wrapped_difference(32_760, -32_760, signed), 16);
        assert_eq!(wrapped_difference(-32_760, 32_760, signed), -16);
        assert_eq!(wrapped_difference(5, 9, signed), 4);
        let byte = Some([0, 255]);
        assert_eq!(wrapped_difference(250, 4, byte), 10);
        assert_eq!(wrapped_difference(4, 250, byte), -10);
        // Half the range may be either way; both ends of the widest counter are exact.
        assert_eq!(wrapped_difference(0, 128, byte), -128);
        assert_eq!(
            wrapped_difference(i64::MIN, i64::MAX, Some([i64::MIN, i64::MAX])),
            -1
        );
        assert_eq!(wrapped_difference(250, 4, None), -246);
    }

    /// Errors of quantisation cancel between neighbours: the way of many rows is as exact as that of few.
    #[test]
    fn quantisation_does_not_grow_with_the_row_rate() {
        let tick_m = 0.01;
        let truth_m = |t: f64| 0.37 * t;
        for rate in [10, 50, 200] {
            let readings: Vec<Reading> = (0..=10 * rate)
                .map(|i| {
                    let t_s = f64::from(i) / f64::from(rate);
                    let count = (truth_m(t_s) / tick_m).floor() as i64;
                    Reading {
                        line: 1,
                        t_s,
                        counts: [count; 2],
                    }
                })
                .collect();
            let ticks: Vec<[i64; 2]> = readings
                .windows(2)
                .map(|pair| [pair[1].counts[0] - pair[0].counts[0]; 2])
                .collect();
            let rows = rows(&readings, &ticks, [tick_m; 2], 0.2);
            let way: f64 = rows
                .windows(2)
                .map(|pair| pair[0].v_mps * (pair[1].t_s - pair[0].t_s))
                .sum();
            assert!((way - truth_m(10.0)).abs() < tick_m, "{rate} Hz: {way}");
            // As independent errors of a tick in every row they would be far more at the high rate.
            let independent = tick_m * f64::from(10 * rate).sqrt() / 6.0_f64.sqrt();
            assert!(rate < 200 || independent > 15.0 * tick_m);
        }
    }
}
