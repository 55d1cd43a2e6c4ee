//! Folders of ROS 2 bags, and files that were split: which files, in which order.
//!
//! `metadata.yaml` of `rosbag2` lists the files and tells how they are compressed. Without it the files of one kind are
//! taken in the natural order of their names, as the recorder numbers them.

use std::cmp::Ordering;
use std::fs;
use std::path::{Path, PathBuf};

use saphyr::{LoadableYamlNode as _, Yaml};

use crate::error::LogError;

const METADATA: &str = "metadata.yaml";
/// Key at the top of `metadata.yaml`.
const INFORMATION: &str = "rosbag2_bagfile_information";
/// Largest believed `metadata.yaml`, in bytes.
const LARGEST_METADATA: u64 = 1 << 26;

/// The files of a log.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Files {
    pub(crate) paths: Vec<PathBuf>,
    /// Whether every message is compressed by itself.
    pub(crate) zstd_messages: bool,
}

/// Whether `folder` looks like a log: it has the recorder's `metadata.yaml`, or files with the ending of a log and none
/// that an image sequence has.
pub(crate) fn is_log(folder: &Path) -> bool {
    let metadata = folder.join(METADATA);
    if metadata.is_file() {
        return fs::read(&metadata).is_ok_and(|text| {
            text.windows(INFORMATION.len())
                .any(|window| window == INFORMATION.as_bytes())
        });
    }
    log_files(folder).is_ok_and(|files| !files.is_empty())
}

/// The files of the log in `folder`.
pub(crate) fn files(folder: &Path) -> Result<Files, LogError> {
    let metadata = folder.join(METADATA);
    if metadata.is_file() {
        return described(folder, &metadata);
    }
    let paths = log_files(folder)?;
    if paths.is_empty() {
        return Err(LogError::Kind {
            path: folder.to_path_buf(),
            expected: "a folder with metadata.yaml or with .mcap, .db3 or .bag files".into(),
            found: "none of them".into(),
        });
    }
    Ok(Files {
        paths,
        zstd_messages: false,
    })
}

/// The files that `metadata.yaml` lists.
fn described(folder: &Path, metadata: &Path) -> Result<Files, LogError> {
    let unreadable = |source| LogError::Read {
        path: metadata.to_path_buf(),
        source,
    };
    let wrong = |expected: &str, found: String| LogError::Kind {
        path: metadata.to_path_buf(),
        expected: expected.into(),
        found,
    };
    let size = fs::metadata(metadata).map_err(unreadable)?.len();
    if size > LARGEST_METADATA {
        return Err(wrong("a small text", format!("{size} bytes")));
    }
    let bytes = fs::read(metadata).map_err(unreadable)?;
    let text = String::from_utf8_lossy(&bytes);
    let documents = Yaml::load_from_str(&text)
        .map_err(|error| wrong("YAML", error.to_string().replace('\n', " ")))?;
    let information = documents
        .first()
        .and_then(|document| document.as_mapping_get(INFORMATION))
        .ok_or_else(|| wrong(INFORMATION, "another text".into()))?;
    let text_of = |key: &str| {
        information
            .as_mapping_get(key)
            .and_then(|value| value.as_str())
            .unwrap_or_default()
            .to_ascii_lowercase()
    };
    let mode = text_of("compression_mode");
    let format = text_of("compression_format");
    let paths: Vec<PathBuf> = information
        .as_mapping_get("relative_file_paths")
        .and_then(|list| list.as_sequence())
        .into_iter()
        .flatten()
        .filter_map(|name| name.as_str())
        .map(|name| beside(folder, name))
        .collect();
    if paths.is_empty() {
        return Err(wrong("relative_file_paths with files", "none".into()));
    }
    let compressed = mode == "message";
    if compressed && format != "zstd" {
        return Err(wrong(
            "messages compressed by zstd",
            format!("compression_format {format:?}"),
        ));
    }
    Ok(Files {
        paths,
        zstd_messages: compressed,
    })
}

/// A listed file. Early recorders wrote the folder into the name too, so the last part counts where the whole is missing.
fn beside(folder: &Path, name: &str) -> PathBuf {
    let whole = folder.join(name);
    match Path::new(name).file_name() {
        Some(last) if !whole.exists() => folder.join(last),
        _ => whole,
    }
}

/// Files of one kind of log, in the natural order of their names.
fn log_files(folder: &Path) -> Result<Vec<PathBuf>, LogError> {
    let unreadable = |source| LogError::Read {
        path: folder.to_path_buf(),
        source,
    };
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(unreadable)? {
        names.push(entry.map_err(unreadable)?.path());
    }
    names.sort_by(|a, b| natural(&a.to_string_lossy(), &b.to_string_lossy()));
    for ending in ["mcap", "db3", "bag"] {
        let of_kind: Vec<PathBuf> = names
            .iter()
            .filter(|path| {
                path.extension()
                    .is_some_and(|own| own.eq_ignore_ascii_case(ending))
            })
            .cloned()
            .collect();
        if !of_kind.is_empty() {
            return Ok(of_kind);
        }
    }
    Ok(Vec::new())
}

/// Order in which 2 comes before 10.
fn natural(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a.as_bytes(), b.as_bytes());
    while let (Some(&x), Some(&y)) = (a.first(), b.first()) {
        let order = if x.is_ascii_digit() && y.is_ascii_digit() {
            let (first, rest_a) = digits(a);
            let (second, rest_b) = digits(b);
            (a, b) = (rest_a, rest_b);
            first.len().cmp(&second.len()).then(first.cmp(second))
        } else {
            (a, b) = (&a[1..], &b[1..]);
            x.cmp(&y)
        };
        if order.is_ne() {
            return order;
        }
    }
    a.len().cmp(&b.len())
}

/// The digits at the beginning without leading zeros, and the rest.
fn digits(text: &[u8]) -> (&[u8], &[u8]) {
    let count = text.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let (digits, rest) = text.split_at(count);
    let zeros = digits.iter().take_while(|&&byte| byte == b'0').count();
    (&digits[zeros..], rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn split_files_are_in_the_order_of_their_numbers() {
        let mut names = ["bag_10.mcap", "bag_2.mcap", "bag_002b.mcap", "bag.mcap"];
        names.sort_by(|a, b| natural(a, b));
        assert_eq!(
            names,
            ["bag.mcap", "bag_2.mcap", "bag_002b.mcap", "bag_10.mcap"]
        );
    }
}
