//! `times.txt`: the time of every image in seconds, strictly increasing.
//!
//! Either one time a line, in the order of the images, or a time and the name of its image a line, in either order: the
//! `rgb.txt` of TUM RGB-D and the `data.csv` of EuRoC are such lists. Where there is no list, names that are stamps
//! since 1970 (`1403715273262142976.png`) or seconds with decimals (`1305031229.528748.png`) tell the times.

use std::collections::BTreeMap;
use std::path::Path;

use super::stamps::{TimeUnit, median_step, refuse_other_units};
use crate::error::SequenceError;
use crate::images::IMAGE_ENDINGS;
use crate::text::{content_lines, finite, increasing, line_fault, quoted, read_text};
use crate::warning::Warning;

/// Times and the images they belong to.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Times {
    /// Seconds, strictly increasing.
    pub(super) times_s: Vec<f64>,
    /// For every time the index of its image; `None` where every image has a time.
    pub(super) images: Option<Vec<usize>>,
}

/// Reads the times of the images called `names`.
pub(super) fn read_times(
    path: &Path,
    names: &[String],
    warnings: &mut Vec<Warning>,
) -> Result<Times, SequenceError> {
    let text = read_text(path)?;
    let rows: Vec<Row<'_>> = content_lines(&text)
        .map(|(line, content)| Row::parse(path, line, content))
        .collect::<Result<_, _>>()?;
    let times_s = in_seconds(path, &rows, warnings)?;
    if rows.first().is_some_and(|row| row.image.is_some()) {
        let images = images_of(path, &rows, names, warnings)?;
        return Ok(Times {
            times_s,
            images: Some(images),
        });
    }
    if times_s.len() != names.len() {
        return Err(SequenceError::File {
            path: path.to_path_buf(),
            expected: format!("{} times, one per image", names.len()),
            found: format!("{}{}", times_s.len(), left_out(names)),
        });
    }
    Ok(Times {
        times_s,
        images: None,
    })
}

/// The first place at which numbered names leave numbers out, as a clause behind a count; empty where there is none, and where
/// most steps are wider than one.
fn left_out(names: &[String]) -> String {
    let number = |name: &String| -> Option<u64> {
        let stem = name.rsplit_once('.')?.0;
        let digits = stem
            .trim_end_matches(|sign: char| sign.is_ascii_digit())
            .len();
        stem.get(digits..)?.parse().ok()
    };
    let leaps: Vec<&[String]> = names
        .windows(2)
        .filter(|pair| match (number(&pair[0]), number(&pair[1])) {
            (Some(before), Some(after)) => after > before.saturating_add(1),
            _ => false,
        })
        .collect();
    match leaps.first() {
        Some(&[before, after]) if 2 * leaps.len() < names.len() => {
            format!("; an image between {before} and {after} seems to be missing")
        }
        _ => String::new(),
    }
}

/// Reads a list of times alone.
pub(super) fn read_column(
    path: &Path,
    warnings: &mut Vec<Warning>,
) -> Result<Vec<f64>, SequenceError> {
    let text = read_text(path)?;
    let rows: Vec<Row<'_>> = content_lines(&text)
        .map(|(line, content)| Row::parse(path, line, content))
        .collect::<Result<_, _>>()?;
    in_seconds(path, &rows, warnings)
}

/// The times that the names of images tell; `None` where they tell none.
pub(super) fn times_of_names(names: &[String], warnings: &mut Vec<Warning>) -> Option<Vec<f64>> {
    let stamps: Vec<(&str, f64)> = names
        .iter()
        .map(|name| {
            let stem = name
                .rsplit_once('.')
                .map_or(name.as_str(), |(stem, _)| stem);
            let known = |byte: u8| byte.is_ascii_digit() || byte == b'.';
            let value = stem.parse().ok().filter(|_| stem.bytes().all(known))?;
            Some((stem, value))
        })
        .collect::<Option<_>>()?;
    let values: Vec<f64> = stamps.iter().map(|stamp| stamp.1).collect();
    let unit = match TimeUnit::since_1970(*values.first()?, median_step(&values)) {
        Some(unit) => unit,
        // A counter has no decimals.
        None if stamps.iter().all(|(stem, _)| stem.contains('.')) => TimeUnit::Seconds,
        None => return None,
    };
    let times_s: Vec<f64> = stamps
        .iter()
        .map(|(stem, value)| unit.seconds(stem, *value))
        .collect();
    if times_s.windows(2).any(|pair| pair[1] <= pair[0]) {
        return None;
    }
    warnings.push(Warning::new(
        "times-from-names",
        format!(
            "There is no times.txt: the names of the images are taken as their times, in {} (the first is {}).",
            unit.name(),
            names.first()?
        ),
    ));
    Some(times_s)
}

/// A line of the list.
struct Row<'a> {
    line: u64,
    text: &'a str,
    stamp: f64,
    image: Option<&'a str>,
}

impl<'a> Row<'a> {
    fn parse(path: &Path, line: u64, content: &'a str) -> Result<Self, SequenceError> {
        let cells: Vec<&str> = content
            .split([' ', '\t', ','])
            .filter(|cell| !cell.is_empty())
            .collect();
        let (text, image) = match *cells.as_slice() {
            [stamp, image] if is_image(image) => (stamp, Some(image)),
            [image, stamp] if is_image(image) => (stamp, Some(image)),
            _ => (content, None),
        };
        let stamp = finite(path, line, "the time of an image", text)?;
        Ok(Self {
            line,
            text,
            stamp,
            image,
        })
    }
}

/// The stamps of the rows as increasing seconds.
fn in_seconds(
    path: &Path,
    rows: &[Row<'_>],
    warnings: &mut Vec<Warning>,
) -> Result<Vec<f64>, SequenceError> {
    let values: Vec<f64> = rows.iter().map(|row| row.stamp).collect();
    let unit = values
        .first()
        .and_then(|&first| TimeUnit::since_1970(first, median_step(&values)))
        .unwrap_or(TimeUnit::Seconds);
    let mut times_s: Vec<f64> = Vec::with_capacity(rows.len());
    for row in rows {
        let time_s = unit.seconds(row.text, row.stamp);
        increasing(path, row.line, times_s.last().copied(), time_s)?;
        times_s.push(time_s);
    }
    refuse_other_units(path, "frames", &times_s)?;
    if unit != TimeUnit::Seconds {
        warnings.push(Warning::new(
            "times-not-in-seconds",
            format!(
                "{} holds {} since 1970 (the first is {}), they are read as such.",
                path.display(),
                unit.name(),
                rows.first().map_or("", |row| row.text)
            ),
        ));
    }
    Ok(times_s)
}

/// For every row the index of its image among `names`.
fn images_of(
    path: &Path,
    rows: &[Row<'_>],
    names: &[String],
    warnings: &mut Vec<Warning>,
) -> Result<Vec<usize>, SequenceError> {
    let index_of: BTreeMap<&str, usize> = names.iter().map(String::as_str).zip(0..).collect();
    let mut images = Vec::with_capacity(rows.len());
    let mut missing = Vec::new();
    for row in rows {
        let Some(listed) = row.image else {
            return Err(line_fault(
                path,
                row.line,
                "a time and the name of its image, as in the lines before",
                quoted(row.text),
            ));
        };
        let name = listed.rsplit(['/', '\\']).next().unwrap_or(listed);
        match index_of.get(name) {
            Some(&index) => images.push(index),
            None => missing.push(name),
        }
    }
    if let Some(first) = missing.first() {
        return Err(SequenceError::File {
            path: path.to_path_buf(),
            expected: format!("{} images that are on disk", rows.len()),
            found: format!("{} of them missing, the first is {first}", missing.len()),
        });
    }
    let unlisted = names.len().saturating_sub(images.len());
    if unlisted > 0 {
        warnings.push(Warning::new(
            "images-not-listed",
            format!(
                "{unlisted} of {} images are not in {}, they are left out.",
                names.len(),
                path.display()
            ),
        ));
    }
    Ok(images)
}

fn is_image(cell: &str) -> bool {
    cell.rsplit_once('.').is_some_and(|(_, ending)| {
        IMAGE_ENDINGS
            .iter()
            .any(|known| ending.eq_ignore_ascii_case(known))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(names: &[&str]) -> Option<(Vec<f64>, String)> {
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        let mut warnings = Vec::new();
        let times = times_of_names(&names, &mut warnings)?;
        assert_eq!(warnings.len(), 1);
        Some((times, warnings.remove(0).message))
    }

    #[test]
    fn names_that_are_stamps_tell_the_times() {
        let (times, told_by) =
            told(&["1403715273262142976.png", "1403715273312143104.png"]).unwrap();
        assert_eq!(times, [1_403_715_273.262_143, 1_403_715_273.312_143]);
        assert!(told_by.contains("in nanoseconds"), "{told_by}");
        let (times, _) = told(&["1305031229.528748.png", "1305031229.564425.png"]).unwrap();
        assert_eq!(times, [1_305_031_229.528_748, 1_305_031_229.564_425]);
        assert_eq!(told(&["0.00.png", "0.25.png"]).unwrap().0, [0.0, 0.25]);
        let (times, _) = told(&["1700000000000000.jpg", "1700000000050000.jpg"]).unwrap();
        assert_eq!(times, [1.7e9, 1.7e9 + 0.05]);
    }

    #[test]
    fn counters_and_words_tell_no_times() {
        for names in [
            &["000000.png", "000001.png"][..],
            &["1.png", "2.png"],
            &["a1.5.png", "a2.5.png"],
            &["1.5.png", "1.5.jpg"],
            &["1.5.2.png"],
            &[],
        ] {
            assert_eq!(told(names), None, "{names:?}");
        }
    }
}
