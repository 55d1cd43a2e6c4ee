//! Does the odometry cover the images?
//!
//! A row holds to the next one and the last one for ever, so rows that stop too early, or that stay away for a while, are
//! still taken for speeds. Nothing is changed here; what is held for long is named, and odometry that does not touch the
//! images at all, or begins too long after the first of them, is refused.

use std::path::Path;

use super::rows::{OdometryRow, usual_interval_s};
use crate::error::SequenceError;
use crate::text::line_fault;
use crate::warning::Warning;

/// Steps beyond so many usual ones are holes.
const HOLE_STEPS: f64 = 5.0;
/// Holes named in a warning.
const NAMED_HOLES: usize = 3;
/// Rows this far apart, seconds and images, are slower than wheels are read: milliseconds at 500 Hz look like that.
const SLOW_S: f64 = 2.0;
const SLOW_FRAMES: f64 = 3.0;
/// Rounding of written times, seconds.
const ROUNDING_S: f64 = 1e-6;

/// Stretches within the time of the images, (from, to) in seconds, in which a speed is held for more than five usual row
/// intervals, the one after the last row included.
///
/// A single row has no usual interval: it is a constant speed. O(rows).
pub(super) fn holes(rows: &[OdometryRow], times_s: &[f64]) -> Vec<(f64, f64)> {
    let row_times: Vec<f64> = rows.iter().map(|row| row.t_s).collect();
    let (Some(usual_s), Some(&first), Some(&last)) = (
        usual_meanwhile_s(rows, times_s),
        times_s.first(),
        times_s.last(),
    ) else {
        return Vec::new();
    };
    let ends = row_times.iter().skip(1).copied().chain([last]);
    row_times
        .iter()
        .zip(ends)
        .filter(|&(&from, to)| to - from > HOLE_STEPS * usual_s)
        .map(|(&from, to)| (from.max(first), to.min(last)))
        .filter(|&(from, to)| to > from)
        .collect()
}

/// The usual step between rows while the images were taken, seconds; of all rows where fewer than three lie there. Rows of
/// another rate before the first image say nothing about a hole after it.
fn usual_meanwhile_s(rows: &[OdometryRow], times_s: &[f64]) -> Option<f64> {
    let times: Vec<f64> = rows.iter().map(|row| row.t_s).collect();
    let (Some(&first), Some(&last)) = (times_s.first(), times_s.last()) else {
        return usual_interval_s(&times);
    };
    let from = times.partition_point(|&t_s| t_s < first);
    let to = times.partition_point(|&t_s| t_s <= last);
    if to >= from + 3 {
        usual_interval_s(&times[from..to])
    } else {
        usual_interval_s(&times)
    }
}

/// Checks rows against the times of the images. A first row up to one usual interval after the first image is put back to
/// that image. `line` is that of the first row, if it came from a text file.
pub(super) fn check_coverage(
    path: &Path,
    line: Option<u64>,
    rows: &mut Vec<OdometryRow>,
    times_s: &[f64],
) -> Result<Vec<Warning>, SequenceError> {
    let mut warnings = Vec::new();
    let row_times: Vec<f64> = rows.iter().map(|row| row.t_s).collect();
    let (Some(&first), Some(&last), Some(&row_first), Some(&row_last)) = (
        times_s.first(),
        times_s.last(),
        row_times.first(),
        row_times.last(),
    ) else {
        return Ok(warnings);
    };
    let usual_s = usual_meanwhile_s(rows, times_s).unwrap_or(0.0);
    let name = path
        .file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    let too_old = rows.len() > 1 && row_last + HOLE_STEPS * usual_s < first;
    if too_old || (row_first > last && times_s.len() > 1) {
        return Err(SequenceError::File {
            path: path.to_path_buf(),
            expected: format!(
                "rows while the images were taken, {} to {} s",
                seconds(first),
                seconds(last)
            ),
            found: format!(
                "rows from {} to {} s: do both clocks count seconds from the same moment?",
                seconds(row_first),
                seconds(row_last)
            ),
        });
    }
    let late_s = row_first - first;
    if late_s > 0.0 {
        if late_s > usual_s + ROUNDING_S {
            let without = times_s
                .partition_point(|&t| t + usual_s + ROUNDING_S < row_first)
                .min(times_s.len());
            let images = if without == 1 {
                "the first image".to_owned()
            } else {
                format!("the first {without} images")
            };
            let expected = format!("a first row no later than the first frame at {first} s");
            let found =
                format!("{row_first} s; leave out {images}, the odometry covers the others");
            return Err(match line {
                Some(line) => line_fault(path, line, expected, found),
                None => SequenceError::File {
                    path: path.to_path_buf(),
                    expected,
                    found,
                },
            });
        }
        warnings.push(Warning::new(
            "odometry-begins-late",
            format!(
                "{name} begins {} s after the first image: its first speed is taken for that time, too",
                seconds(late_s)
            ),
        ));
        if let Some(&row) = rows.first() {
            rows.insert(0, OdometryRow { t_s: first, ..row });
        }
    }
    let held = |from: f64| {
        let index = rows
            .partition_point(|row| row.t_s <= from)
            .saturating_sub(1);
        rows.get(index).map_or_else(String::new, |row| {
            format!("{:.2} m/s and {:.2} rad/s", row.v_mps, row.omega_radps)
        })
    };
    if let ([only], true) = (&rows[..], last > first) {
        warnings.push(Warning::new(
            "odometry-one-row",
            format!(
                "{name} has one row: its speed is held for all {} s of the images, {}",
                seconds(last - first),
                held(only.t_s)
            ),
        ));
    }
    let frame_s = usual_interval_s(times_s).unwrap_or(f64::INFINITY);
    if rows.len() > 2 && usual_s >= SLOW_S && usual_s > SLOW_FRAMES * frame_s {
        warnings.push(Warning::new(
            "odometry-slow",
            format!(
                "{name} has a row every {} s, images come every {} s: each speed is held for many of them; times are expected \
                 in seconds",
                seconds(usual_s),
                seconds(frame_s)
            ),
        ));
    }
    let mut holes = holes(rows, times_s);
    if let Some(&(from, to)) = holes.last()
        && from >= row_last
    {
        holes.pop();
        warnings.push(Warning::new(
            "odometry-ends-early",
            format!(
                "{name} ends at {} s, the images at {} s: for {} s its last speed is held, {}",
                seconds(row_last),
                seconds(to),
                seconds(to - from),
                held(from)
            ),
        ));
    }
    if let [(from, to), ..] = holes[..] {
        let listed: Vec<String> = holes
            .iter()
            .take(NAMED_HOLES)
            .map(|&(from, to)| format!("{} to {} s", seconds(from), seconds(to)))
            .collect();
        let more = match holes.len().saturating_sub(NAMED_HOLES) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let during = if holes.len() == 1 {
            format!(
                "{} s long the speed before it is held, {}",
                seconds(to - from),
                held(from)
            )
        } else {
            "the speed before each is held meanwhile".to_owned()
        };
        warnings.push(Warning::new(
            "odometry-hole",
            format!(
                "{name} has no row from {}{more}, rows usually come every {} s: {during}",
                listed.join(", "),
                seconds(usual_s)
            ),
        ));
    }
    Ok(warnings)
}

/// Seconds as a person writes them: to the millisecond, without zeros at the end.
fn seconds(t_s: f64) -> String {
    let text = format!("{t_s:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(times: impl IntoIterator<Item = f64>) -> Vec<OdometryRow> {
        times
            .into_iter()
            .map(|t_s| OdometryRow {
                t_s,
                v_mps: 0.2,
                omega_radps: 0.0,
            })
            .collect()
    }

    fn said(times: impl IntoIterator<Item = f64>, images: &[f64]) -> Vec<String> {
        match check_coverage(Path::new("odometry.csv"), Some(2), &mut rows(times), images) {
            Ok(warnings) => warnings.iter().map(ToString::to_string).collect(),
            Err(fault) => vec![fault.to_string()],
        }
    }

    #[test]
    fn held_speeds_are_named_with_their_times() {
        let images: Vec<f64> = (0..20).map(|i| 0.5 * f64::from(i)).collect();
        let tenths = |from: u32, to: u32| (from..=to).map(|i| f64::from(i) / 10.0);
        assert!(said(tenths(0, 95), &images).is_empty());
        // Four intervals without a row are no hole.
        assert!(said(tenths(0, 30).chain(tenths(34, 95)), &images).is_empty());
        assert_eq!(
            said(tenths(0, 30).chain(tenths(41, 95)), &images),
            [
                "[odometry-hole] odometry.csv has no row from 3 to 4.1 s, rows usually come every 0.1 s: 1.1 s long the speed \
              before it is held, 0.20 m/s and 0.00 rad/s."
            ]
        );
        assert_eq!(
            said(tenths(0, 30), &images),
            [
                "[odometry-ends-early] odometry.csv ends at 3 s, the images at 9.5 s: for 6.5 s its last speed is held, 0.20 m/s \
              and 0.00 rad/s."
            ]
        );
        let many = [
            0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 2.0, 4.0, 6.0, 9.0, 9.1, 9.2, 9.3,
        ];
        assert_eq!(
            said(many, &images),
            [
                "[odometry-hole] odometry.csv has no row from 0.8 to 2 s, 2 to 4 s, 4 to 6 s and 1 more, rows usually come every \
              0.1 s: the speed before each is held meanwhile."
            ]
        );
        // A fast logger before the first image makes no holes of the slower rows after it.
        assert!(
            said(
                (-4000..0).map(|k| f64::from(k) * 1e-3).chain(tenths(0, 95)),
                &images
            )
            .is_empty()
        );
        assert_eq!(
            said([0.0], &images),
            [
                "[odometry-one-row] odometry.csv has one row: its speed is held for all 9.5 s of the images, 0.20 m/s and 0.00 \
              rad/s."
            ]
        );
        // Holes before the first image and after the last are nobody's concern.
        assert!(
            said(
                [-9.0, -1.0, -0.9, -0.8].into_iter().chain(tenths(0, 95)),
                &images
            )
            .is_empty()
        );
    }

    #[test]
    fn a_late_first_row_is_put_back_by_one_interval_at_most() {
        let images: Vec<f64> = (0..20).map(|i| 0.5 * f64::from(i)).collect();
        let late = |by: f64| (0..100).map(move |i| by + f64::from(i) / 10.0);
        let mut odometry = rows(late(0.05));
        let path = Path::new("odometry.csv");
        let warnings = check_coverage(path, Some(2), &mut odometry, &images).expect("covered");
        assert_eq!(warnings[0].name, "odometry-begins-late");
        assert_eq!((odometry[0].t_s, odometry[1].t_s), (0.0, 0.05));
        assert_eq!(
            said(late(1.3), &images),
            [
                "odometry.csv, line 2: expected a first row no later than the first frame at 0 s, found 1.3 s; leave out the \
              first 3 images, the odometry covers the others"
            ]
        );
        assert_eq!(
            said(late(0.2), &images),
            [
                "odometry.csv, line 2: expected a first row no later than the first frame at 0 s, found 0.2 s; leave out the \
              first image, the odometry covers the others"
            ]
        );
    }

    /// Times in milliseconds left one speed for the whole drive, and nothing was said.
    #[test]
    fn regress_times_in_milliseconds_are_told() {
        let images: Vec<f64> = (0..20).map(|i| 0.5 * f64::from(i)).collect();
        assert_eq!(
            said((0..96).map(|i| 100.0 * f64::from(i)), &images),
            [
                "[odometry-slow] odometry.csv has a row every 100 s, images come every 0.5 s: each speed is held for many of \
                 them; times are expected in seconds."
            ]
        );
        // A time lapse with rows as slow as its images, and two rows that are a constant speed.
        let slow: Vec<f64> = (0..20).map(|i| 5.0 * f64::from(i)).collect();
        assert!(said(slow.iter().copied(), &slow).is_empty());
        assert!(said([0.0, 9.5], &images).is_empty());
    }

    #[test]
    fn other_clocks_are_refused_with_both_spans() {
        let epoch: Vec<f64> = (0..20).map(|i| 1.7e9 + 0.5 * f64::from(i)).collect();
        let start = || (0..96).map(|i| f64::from(i) / 10.0);
        assert_eq!(
            said(start(), &epoch),
            [
                "odometry.csv: expected rows while the images were taken, 1700000000 to 1700000009.5 s, found rows from 0 to 9.5 \
              s: do both clocks count seconds from the same moment?"
            ]
        );
        let relative: Vec<f64> = (0..20).map(|i| 0.5 * f64::from(i)).collect();
        assert!(
            said(start().map(|t| 1.7e9 + t), &relative)[0]
                .contains("0 to 9.5 s, found rows from 1700000000")
        );
    }
}
