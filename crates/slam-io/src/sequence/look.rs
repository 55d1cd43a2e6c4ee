//! Which layout a path has, by looking; and the sentence where it has none.

use std::fs;
use std::path::{Path, PathBuf};

use robot_logs::RobotLog;

use super::calibrations::CAMERA;
use super::odometry::ODOMETRY;
use super::options::SequenceFormat;
use super::{euroc, kitti, kitti_raw, tum_rgbd};
use crate::error::SequenceError;
use crate::images::{IMAGE_ENDINGS, listed_images, what_lies_there};

const VIDEOS: [&str; 9] = [
    "mp4", "avi", "mov", "mkv", "webm", "m4v", "mpg", "mpeg", "h264",
];
/// Endings of recorded logs, for the sentence about one that is damaged.
const LOGS: [&str; 5] = ["bag", "mcap", "db3", "zstd", "zst"];
const ARCHIVES: [&str; 8] = ["zip", "tar", "gz", "tgz", "bz2", "xz", "7z", "rar"];
/// The file that shows that a folder holds the results of a run.
const RUN: &str = "report_data.json";
/// Entries that are looked at below a folder without a sequence.
const LOOKED_AT: usize = 1000;
/// Sequences that a message names.
const NAMED: usize = 3;

/// The layout of what lies at `path`.
///
/// # Errors
/// One sentence that says what lies there and what is expected.
pub(super) fn format_of(path: &Path) -> Result<SequenceFormat, SequenceError> {
    if !path.is_dir() {
        let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
        let named = path.is_file() && LOGS.iter().any(|log| ending == *log);
        return if named || RobotLog::recognises(path) {
            Ok(SequenceFormat::Log)
        } else {
            Err(no_folder(path))
        };
    }
    if let Some(format) = layout_of(path) {
        return Ok(format);
    }
    if RobotLog::recognises(path) {
        return Ok(SequenceFormat::Log);
    }
    if listed_images(path).is_ok() {
        return match path.parent() {
            Some(parent) if is_images_folder(path) && has_text_files(parent) => {
                Err(no_sequence(path, "the folder of images of one", parent))
            }
            _ => Ok(SequenceFormat::Images),
        };
    }
    if path.join(RUN).is_file() {
        return Err(fault(
            path,
            "a sequence folder",
            "the results of a run: give the sequence it was made from".into(),
        ));
    }
    if has_text_files(path) {
        return Ok(SequenceFormat::Native);
    }
    Err(nothing_known(path))
}

/// The layout of a folder that shows it by the names in it.
fn layout_of(path: &Path) -> Option<SequenceFormat> {
    if path.join("images").is_dir() {
        Some(SequenceFormat::Native)
    } else if euroc::base_of(path).is_some() {
        Some(SequenceFormat::Euroc)
    } else if path.join(tum_rgbd::LIST).is_file() {
        Some(SequenceFormat::TumRgbd)
    } else if kitti_raw::images_folder(path).is_some() {
        Some(SequenceFormat::KittiRaw)
    } else if kitti::images_folder(path).is_some() {
        Some(SequenceFormat::Kitti)
    } else {
        None
    }
}

/// Whether one of the text files of the native layout lies there.
fn has_text_files(path: &Path) -> bool {
    ["times.txt", CAMERA, ODOMETRY]
        .iter()
        .any(|name| path.join(name).is_file())
}

fn is_images_folder(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name == "images")
}

/// The sentence about a path that is no folder.
fn no_folder(path: &Path) -> SequenceError {
    let ending = path
        .extension()
        .map(|ending| ending.to_string_lossy().to_lowercase())
        .unwrap_or_default();
    let is = |endings: &[&str]| endings.contains(&ending.as_str());
    let found = if !path.exists() {
        "nothing".into()
    } else if is(&VIDEOS) {
        format!(
            "a video: make a folder SEQ with its images, `mkdir -p SEQ/images; ffmpeg -i {} SEQ/images/%06d.png`, and \
             ask `mono-slam info SEQ` what else belongs into it",
            path.display()
        )
    } else if is(&ARCHIVES) {
        "an archive: unpack it and give the folder".into()
    } else if is(&IMAGE_ENDINGS) {
        "one image: give the folder".into()
    } else {
        "a file".into()
    };
    fault(path, "a sequence folder", found)
}

/// The sentence about a folder that is no sequence, with the sequences below it.
fn nothing_known(path: &Path) -> SequenceError {
    let below = sequences_below(path);
    let found = match below.as_slice() {
        [] => what_lies_there(path),
        [one] => format!("one in a folder below: give {}", one.display()),
        some => {
            let mut named: Vec<String> = some
                .iter()
                .take(NAMED)
                .map(|sequence| sequence.display().to_string())
                .collect();
            if some.len() > NAMED {
                named.push("...".into());
            }
            format!(
                "{} in folders below: give one, {}",
                some.len(),
                named.join(", ")
            )
        }
    };
    fault(
        path,
        "a sequence (a folder with images/, times.txt, camera.toml and odometry.csv, or one of EuRoC, TUM RGB-D or KITTI)",
        found,
    )
}

fn no_sequence(path: &Path, found: &str, instead: &Path) -> SequenceError {
    let instead = if instead.as_os_str().is_empty() {
        Path::new(".")
    } else {
        instead
    };
    fault(
        path,
        "a sequence folder",
        format!("{found}: give {}", instead.display()),
    )
}

/// Folders one or two levels below that show a layout by their names.
fn sequences_below(path: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut looked_at = 0;
    let mut open = vec![(path.to_path_buf(), 0)];
    while let Some((folder, depth)) = open.pop() {
        let Ok(entries) = fs::read_dir(&folder) else {
            continue;
        };
        for entry in entries.flatten() {
            looked_at += 1;
            if looked_at > LOOKED_AT {
                break;
            }
            let below = entry.path();
            if !below.is_dir() {
                continue;
            }
            if layout_of(&below).is_some() {
                found.push(below);
            } else if depth == 0 {
                open.push((below, 1));
            }
        }
    }
    found.sort();
    found
}

fn fault(path: &Path, expected: &str, found: String) -> SequenceError {
    SequenceError::File {
        path: path.to_path_buf(),
        expected: expected.into(),
        found,
    }
}
