//! `times.txt`: one time stamp per image, seconds, strictly increasing.

use std::path::Path;

use crate::error::SequenceError;
use crate::text::{content_lines, finite, increasing, read_text};

/// Reads the time stamps of `images` images.
pub(super) fn read_times(path: &Path, images: usize) -> Result<Vec<f64>, SequenceError> {
    let text = read_text(path)?;
    let mut times_s = Vec::new();
    for (line, content) in content_lines(&text) {
        let time_s = finite(path, line, "the time of an image", content)?;
        increasing(path, line, times_s.last().copied(), time_s)?;
        times_s.push(time_s);
    }
    if times_s.len() != images {
        return Err(SequenceError::File {
            path: path.to_path_buf(),
            expected: format!("{images} times, one per image"),
            found: times_s.len().to_string(),
        });
    }
    Ok(times_s)
}
