//! Reading text files of numbers: finite values, faults with their line.

use std::fs;
use std::path::Path;

use crate::error::SequenceError;

/// Longest piece of a file quoted in a message, in characters.
const QUOTED_CHARS: usize = 40;

/// Whole file as text; see `decoded_text`.
///
/// # Errors
/// [`SequenceError`] where the file cannot be read or is no text.
pub fn read_text(path: &Path) -> Result<String, SequenceError> {
    decoded_text(path, &read_bytes(path)?)
}

/// Whole file as bytes.
pub(crate) fn read_bytes(path: &Path) -> Result<Vec<u8>, SequenceError> {
    fs::read(path).map_err(|source| SequenceError::Read {
        path: path.to_path_buf(),
        source,
    })
}

/// The text of bytes in UTF-8, or in UTF-16 with a byte order mark as the shell of Windows writes it. The mark is left
/// out.
pub(crate) fn decoded_text(path: &Path, bytes: &[u8]) -> Result<String, SequenceError> {
    let wide = |rest: &[u8], unit: fn([u8; 2]) -> u16| {
        let (pairs, odd) = rest.as_chunks::<2>();
        if !odd.is_empty() {
            return None;
        }
        char::decode_utf16(pairs.iter().map(|pair| unit(*pair)))
            .collect::<Result<String, _>>()
            .ok()
    };
    let foreign = |expected: &str, found: String| SequenceError::File {
        path: path.to_path_buf(),
        expected: expected.into(),
        found,
    };
    let utf16 = match bytes {
        [0xff, 0xfe, rest @ ..] => Some(wide(rest, u16::from_le_bytes)),
        [0xfe, 0xff, rest @ ..] => Some(wide(rest, u16::from_be_bytes)),
        _ => None,
    };
    if let Some(text) = utf16 {
        return text.ok_or_else(|| foreign("UTF-16 text", "a broken character".into()));
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok(text.to_owned()),
        Err(error) => Err(foreign(
            "UTF-8 text",
            format!("a foreign byte at offset {}", error.valid_up_to()),
        )),
    }
}

/// `found` in quotes, shortened so that a binary file does not flood the message.
pub(crate) fn quoted(found: &str) -> String {
    let mut shown: String = found.chars().take(QUOTED_CHARS).collect();
    if found.chars().nth(QUOTED_CHARS).is_some() {
        shown.push('…');
    }
    format!("{shown:?}")
}

/// Fault of one line.
pub(crate) fn line_fault(
    path: &Path,
    line: u64,
    expected: impl Into<String>,
    found: impl Into<String>,
) -> SequenceError {
    SequenceError::Line {
        path: path.to_path_buf(),
        line,
        expected: expected.into(),
        found: found.into(),
    }
}

/// A finite number.
pub(crate) fn finite(path: &Path, line: u64, name: &str, text: &str) -> Result<f64, SequenceError> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(line_fault(
            path,
            line,
            format!("a finite number for {name}"),
            quoted(text),
        )),
    }
}

/// Refuses a time that does not come after the one before it.
pub(crate) fn increasing(
    path: &Path,
    line: u64,
    before: Option<f64>,
    time_s: f64,
) -> Result<(), SequenceError> {
    match before {
        Some(before) if time_s == before => Err(line_fault(
            path,
            line,
            format!("a time after {before} s"),
            format!("{time_s} s, equal to the time before"),
        )),
        Some(before) if time_s < before => Err(line_fault(
            path,
            line,
            format!("a time after {before} s"),
            format!("{time_s} s"),
        )),
        _ => Ok(()),
    }
}

/// Rows of finite numbers under an exact header: (line number, values in the header's order).
///
/// Blank lines and lines starting with `#` do not count.
pub(crate) fn read_table<const COLUMNS: usize>(
    path: &Path,
    header: [&str; COLUMNS],
) -> Result<Vec<(u64, [f64; COLUMNS])>, SequenceError> {
    let text = read_text(path)?;
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut rows = Vec::new();
    let mut header_seen = false;
    for record in reader.records() {
        let record = record.map_err(|error| SequenceError::File {
            path: path.to_path_buf(),
            expected: "comma-separated values".into(),
            found: error.to_string(),
        })?;
        let line = record.position().map_or(0, csv::Position::line);
        if !header_seen {
            if !record.iter().eq(header) {
                let found = record.iter().collect::<Vec<_>>().join(",");
                return Err(line_fault(
                    path,
                    line,
                    format!("the header {}", header.join(",")),
                    quoted(&found),
                ));
            }
            header_seen = true;
            continue;
        }
        if record.len() != COLUMNS {
            return Err(line_fault(
                path,
                line,
                format!("{COLUMNS} values"),
                format!("{}", record.len()),
            ));
        }
        let mut values = [0.0; COLUMNS];
        for ((value, name), cell) in values.iter_mut().zip(header).zip(record.iter()) {
            *value = finite(path, line, name, cell)?;
        }
        rows.push((line, values));
    }
    if rows.is_empty() {
        return Err(SequenceError::File {
            path: path.to_path_buf(),
            expected: format!("the header {} and at least one row", header.join(",")),
            found: if header_seen {
                "the header alone"
            } else {
                "an empty file"
            }
            .into(),
        });
    }
    Ok(rows)
}

/// Lines of a text file that carry something, with their numbers; `#` starts a comment line.
pub(crate) fn content_lines(text: &str) -> impl Iterator<Item = (u64, &str)> {
    text.trim_start_matches('\u{feff}')
        .lines()
        .zip(1_u64..)
        .map(|(line, number)| (number, line.trim()))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
}
