//! The image files of a folder, in the order in which they were taken.
//!
//! Names are compared as people count: runs of digits by their value, the rest letter by letter, so that `2.png` comes
//! before `10.png`. Names that are numbers with decimals, such as the stamps of TUM RGB-D, are compared by their value.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::error::SequenceError;

/// Endings of the image files that are read, in lower case.
pub(crate) const IMAGE_ENDINGS: [&str; 10] = [
    "png", "jpg", "jpeg", "pgm", "ppm", "pnm", "bmp", "tif", "tiff", "webp",
];
/// Number of kinds of files that a message names.
const NAMED_KINDS: usize = 3;

/// The images behind a list of files and folders; a folder stands for its images in their counting order.
///
/// # Errors
/// [`SequenceError`] when a folder cannot be listed or holds no image.
pub fn image_files(inputs: &[PathBuf]) -> Result<Vec<PathBuf>, SequenceError> {
    let mut files = Vec::new();
    for input in inputs {
        if input.is_dir() {
            files.extend(listed_images(input)?);
        } else {
            files.push(input.clone());
        }
    }
    Ok(files)
}

/// Image files of a folder in the counting order of their names, at least one.
///
/// Two files of one frame (`000001.png` beside `000001.jpg`) are a fault: which one is meant, nobody knows.
pub(crate) fn listed_images(folder: &Path) -> Result<Vec<PathBuf>, SequenceError> {
    let mut images: Vec<PathBuf> = entries(folder)?
        .into_iter()
        .filter(|path| has_image_name(path) && !path.is_dir())
        .collect();
    if images.is_empty() {
        return Err(SequenceError::File {
            path: folder.to_path_buf(),
            expected: format!("at least one image (.{})", IMAGE_ENDINGS.join(", .")),
            found: what_lies_there(folder),
        });
    }
    let stems: Vec<String> = images.iter().map(|path| stem(path)).collect();
    if stems.iter().all(|stem| decimal(stem).is_some()) {
        images.sort_by(|a, b| {
            let value = |path: &Path| decimal(&stem(path)).unwrap_or_default();
            value(a).total_cmp(&value(b)).then_with(|| a.cmp(b))
        });
    } else {
        images.sort_by(|a, b| counting_order(&name(a), &name(b)).then_with(|| a.cmp(b)));
    }
    refuse_pairs(folder, &images)?;
    Ok(images)
}

/// Kinds and counts of what a folder holds, for a message: `3 .raw files and 1 folder`.
pub(crate) fn what_lies_there(folder: &Path) -> String {
    let mut kinds: BTreeMap<String, usize> = BTreeMap::new();
    for path in entries(folder).unwrap_or_default() {
        let kind = match path.extension() {
            _ if path.is_dir() => "folder".to_owned(),
            None => "file without ending".to_owned(),
            Some(ending) => format!(".{} file", ending.to_string_lossy()),
        };
        *kinds.entry(kind).or_default() += 1;
    }
    let mut kinds: Vec<(String, usize)> = kinds.into_iter().collect();
    kinds.sort_by(|a, b| b.1.cmp(&a.1).then_with(|| a.0.cmp(&b.0)));
    let others = kinds.len() > NAMED_KINDS;
    let mut named: Vec<String> = kinds
        .into_iter()
        .take(NAMED_KINDS)
        .map(|(kind, count)| match (count, kind.as_str()) {
            (1, _) => format!("1 {kind}"),
            (_, "file without ending") => format!("{count} files without ending"),
            _ => format!("{count} {kind}s"),
        })
        .collect();
    if others {
        named.push("others".into());
    }
    match named.pop() {
        None => "an empty folder".into(),
        Some(last) if named.is_empty() => last,
        Some(last) => format!("{} and {last}", named.join(", ")),
    }
}

/// Visible entries of a folder.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, SequenceError> {
    let unreadable = |source| SequenceError::Read {
        path: folder.to_path_buf(),
        source,
    };
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if !name(&path).starts_with('.') {
            found.push(path);
        }
    }
    Ok(found)
}

fn has_image_name(path: &Path) -> bool {
    path.extension().is_some_and(|ending| {
        IMAGE_ENDINGS
            .iter()
            .any(|known| ending.eq_ignore_ascii_case(known))
    })
}

/// Refuses two files that differ in their ending only.
fn refuse_pairs(folder: &Path, images: &[PathBuf]) -> Result<(), SequenceError> {
    let mut by_stem: BTreeMap<String, &Path> = BTreeMap::new();
    let mut first = None;
    let mut count = 0;
    for path in images {
        if let Some(before) = by_stem.insert(stem(path), path) {
            first.get_or_insert((name(before), name(path)));
            count += 1;
        }
    }
    let Some((one, other)) = first else {
        return Ok(());
    };
    let more = match count {
        1 => String::new(),
        _ => format!(" ({count} such pairs)"),
    };
    Err(SequenceError::File {
        path: folder.to_path_buf(),
        expected: "one file per frame".into(),
        found: format!("{one} beside {other}{more}: keep one of the two kinds"),
    })
}

fn name(path: &Path) -> String {
    path.file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

fn stem(path: &Path) -> String {
    path.file_stem()
        .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}

/// The value of digits, a point and digits.
fn decimal(text: &str) -> Option<f64> {
    let (whole, fraction) = text.split_once('.')?;
    let digits = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    (digits(whole) && digits(fraction))
        .then(|| text.parse().ok())
        .flatten()
}

/// Order of two names in which a run of digits counts with its value.
fn counting_order(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a, b);
    loop {
        let (Some(left), Some(right)) = (a.chars().next(), b.chars().next()) else {
            return a.len().cmp(&b.len());
        };
        let order = if left.is_ascii_digit() && right.is_ascii_digit() {
            let (digits_a, rest_a) = digits(a);
            let (digits_b, rest_b) = digits(b);
            (a, b) = (rest_a, rest_b);
            let (value_a, value_b) = (
                digits_a.trim_start_matches('0'),
                digits_b.trim_start_matches('0'),
            );
            // Without leading zeros the longer number is the larger one.
            value_a
                .len()
                .cmp(&value_b.len())
                .then_with(|| value_a.cmp(value_b))
        } else {
            (a, b) = (&a[left.len_utf8()..], &b[right.len_utf8()..]);
            left.cmp(&right)
        };
        if order != Ordering::Equal {
            return order;
        }
    }
}

/// Leading digits and the rest.
fn digits(text: &str) -> (&str, &str) {
    let end = text
        .find(|character: char| !character.is_ascii_digit())
        .unwrap_or(text.len());
    text.split_at(end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_ordered_as_people_count() {
        let mut names = vec!["10.png", "9.png", "1.png", "b2.png", "b10.png", "a.png"];
        names.sort_by(|a, b| counting_order(a, b));
        let expected = ["1.png", "9.png", "10.png", "a.png", "b2.png", "b10.png"];
        assert_eq!(names, expected);
        assert_eq!(counting_order("007", "7"), Ordering::Equal);
        // Beyond the range of any integer type.
        let long = "123456789012345678901234567890";
        assert_eq!(counting_order(long, "99"), Ordering::Greater);
        assert_eq!(counting_order("ä1", "ä1b"), Ordering::Less);
    }

    #[test]
    fn only_digits_around_a_point_are_a_decimal() {
        assert_eq!(decimal("1.5"), Some(1.5));
        for text in ["15", "1.5.2", "a1.5", "1.", ".5", "-1.5"] {
            assert_eq!(decimal(text), None, "{text}");
        }
    }
}
