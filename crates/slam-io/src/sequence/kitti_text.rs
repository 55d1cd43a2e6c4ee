//! Text files of KITTI: calibrations of a name, a colon and numbers; frames by their number; times of day.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use super::survey::Part;
use crate::error::SequenceError;
use crate::text::{content_lines, finite, line_fault, quoted, read_text};
use crate::warning::Warning;

/// Image folders of the four cameras in the order in which they are looked for: grey before colour, left before right.
pub(super) const CAMERAS: [usize; 4] = [0, 2, 1, 3];

/// The numbers behind a name in a calibration file; `None` when there is no such line.
pub(super) fn numbers_of(path: &Path, name: &str) -> Part<Option<Vec<f64>>> {
    let text = read_text(path)?;
    for (line, content) in content_lines(&text) {
        let Some((key, values)) = content.split_once(':') else {
            continue;
        };
        if key.trim() == name {
            return values
                .split_ascii_whitespace()
                .map(|cell| finite(path, line, name, cell))
                .collect::<Part<Vec<f64>>>()
                .map(Some);
        }
    }
    Ok(None)
}

/// Centre of a rectified camera in the axes of camera 0, from its projection `K [I | t]`: the centre is `-t`.
pub(super) fn centre_in_camera_0(projection: &[f64]) -> Vector3<f64> {
    let &[fx, _, cx, px, _, fy, cy, py, _, _, _, pz] = projection else {
        return Vector3::zeros();
    };
    -Vector3::new((px - cx * pz) / fx, (py - cy * pz) / fy, pz)
}

/// Files, their times, and their numbers in the lists of the sequence.
pub(super) struct Numbered {
    pub(super) files: Vec<PathBuf>,
    pub(super) times_s: Vec<f64>,
    pub(super) numbers: Vec<usize>,
}

/// Brings files and times together: one for one, or by the number in the name where files are missing.
pub(super) fn numbered(
    files: Vec<PathBuf>,
    times_s: Vec<f64>,
    list: &Path,
    warnings: &mut Vec<Warning>,
) -> Part<Numbered> {
    if files.len() == times_s.len() {
        return Ok(Numbered {
            numbers: (0..files.len()).collect(),
            files,
            times_s,
        });
    }
    let number = |path: &PathBuf| path.file_stem()?.to_str()?.parse::<usize>().ok();
    let numbers: Option<Vec<usize>> = files.iter().map(number).collect();
    match numbers {
        Some(numbers) if numbers.iter().all(|&number| number < times_s.len()) => {
            warnings.push(Warning::new(
                "frames-missing",
                format!(
                    "{} of the {} frames of {} are here, they are taken by the numbers in their names.",
                    files.len(),
                    times_s.len(),
                    list.display()
                ),
            ));
            Ok(Numbered {
                times_s: numbers.iter().map(|&number| times_s[number]).collect(),
                files,
                numbers,
            })
        }
        _ => Err(SequenceError::File {
            path: list.to_path_buf(),
            expected: format!("{} times, one per image", files.len()),
            found: times_s.len().to_string(),
        }),
    }
}

/// Seconds since 1970 of lines such as `2011-09-26 13:02:25.964389445`, strictly increasing.
pub(super) fn times_of_day(path: &Path) -> Part<Vec<f64>> {
    let text = read_text(path)?;
    let mut times_s: Vec<f64> = Vec::new();
    for (line, content) in content_lines(&text) {
        let time_s = time_of_day(content).ok_or_else(|| {
            line_fault(
                path,
                line,
                "a date and a time as in 2011-09-26 13:02:25.964389445",
                quoted(content),
            )
        })?;
        crate::text::increasing(path, line, times_s.last().copied(), time_s)?;
        times_s.push(time_s);
    }
    Ok(times_s)
}

fn time_of_day(text: &str) -> Option<f64> {
    let (date, time) = text.split_once(' ')?;
    let [year, month, day] = three(date, '-')?;
    let [hour, minute, second] = three(time.trim(), ':')?;
    let (year, month, day) = (
        year.parse::<i64>().ok()?,
        month.parse::<i64>().ok()?,
        day.parse::<i64>().ok()?,
    );
    let (hour, minute, second) = (
        hour.parse::<f64>().ok()?,
        minute.parse::<f64>().ok()?,
        second.parse::<f64>().ok()?,
    );
    let inside = (1970..=9999).contains(&year)
        && (1..=12).contains(&month)
        && (1..=31).contains(&day)
        && (0.0..24.0).contains(&hour)
        && (0.0..60.0).contains(&minute)
        && (0.0..61.0).contains(&second);
    inside.then(|| {
        days_since_1970(year, month, day) as f64 * 86_400.0 + hour * 3600.0 + minute * 60.0 + second
    })
}

fn three(text: &str, separator: char) -> Option<[&str; 3]> {
    let parts: Vec<&str> = text.split(separator).collect();
    parts.try_into().ok()
}

/// Days of the Gregorian calendar, counted in years that begin in March, so that a leap day is their last.
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    let year = if month > 2 { year } else { year - 1 };
    let month_from_march = (month + 9) % 12;
    365 * year + year / 4 - year / 100 + year / 400 + (153 * month_from_march + 2) / 5 + day
        - 1
        - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_day_are_seconds_since_1970() {
        // By `date -u -d ... +%s`.
        assert_eq!(time_of_day("1970-01-01 00:00:00"), Some(0.0));
        assert_eq!(time_of_day("2011-09-26 13:02:25"), Some(1_317_042_145.0));
        assert_eq!(time_of_day("2012-02-29 23:59:59"), Some(1_330_559_999.0));
        let fraction = time_of_day("2011-09-26 13:02:25.964389445").unwrap();
        assert!((fraction - 1_317_042_145.964_389_4).abs() < 1e-6);
        for wrong in [
            "2011-09-26",
            "2011-13-26 00:00:00",
            "2011-09-26 25:00:00",
            "1.5",
            "",
        ] {
            assert_eq!(time_of_day(wrong), None, "{wrong}");
        }
    }

    #[test]
    fn a_camera_to_the_right_has_a_positive_centre() {
        // P1 of sequence 05: the right grey camera, 0.537 m to the right of camera 0.
        let p1 = [
            707.0912, 0.0, 601.8873, -379.8145, 0.0, 707.0912, 183.1104, 0.0, 0.0, 0.0, 1.0, 0.0,
        ];
        let centre = centre_in_camera_0(&p1);
        assert!((centre.x - 0.537_150).abs() < 1e-5, "{centre}");
        assert_eq!((centre.y, centre.z), (0.0, 0.0));
    }
}
