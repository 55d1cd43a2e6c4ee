//! Image files and their times, brought together.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::survey::Part;
use super::times::{Times, read_times, times_of_names};
use crate::error::SequenceError;
use crate::images::{ImageFiles, Images, WholeFiles, whole_files};
use crate::warning::Warning;

/// Images and times of a sequence, one for the other.
pub(super) struct Frames {
    pub(super) images: Part<Images>,
    pub(super) times_s: Part<Vec<f64>>,
}

impl Frames {
    /// Time of the first image, if it is known.
    pub(super) fn first_s(&self) -> Option<f64> {
        self.times_s.as_ref().ok()?.first().copied()
    }

    /// Columns and rows of the first image, if it can be read.
    pub(super) fn size(&self) -> Option<[u32; 2]> {
        let (width, height) = self.images.as_ref().ok()?.size(0).ok()?;
        Some([width, height])
    }
}

/// The times, where there are any.
pub(super) fn known(times_s: &Part<Vec<f64>>) -> Option<&[f64]> {
    times_s.as_deref().ok().filter(|times| !times.is_empty())
}

/// The frames of image files whose times are in `list`; where there is no list, in the names of the files.
pub(super) fn frames_of(files: Vec<PathBuf>, list: &Path, warnings: &mut Vec<Warning>) -> Frames {
    let names: Vec<String> = files
        .iter()
        .map(|path| {
            let name = path.file_name().unwrap_or_default();
            name.to_string_lossy().into_owned()
        })
        .collect();
    let times = if list.exists() {
        read_times(list, &names, warnings)
    } else {
        match times_of_names(&names, warnings) {
            Some(times_s) => Ok(Times {
                times_s,
                images: None,
            }),
            None => Err(no_times(list, names.len())),
        }
    };
    match times {
        Err(fault) => Frames {
            images: whole_files(files).map(|whole| opened(whole, warnings)),
            times_s: Err(fault),
        },
        Ok(times) => {
            let files = match &times.images {
                Some(indices) => indices.iter().map(|&index| files[index].clone()).collect(),
                None => files,
            };
            stamped(files, times.times_s, warnings)
        }
    }
}

/// The frames of image files with one time each; a cut last one is left out with its time.
pub(super) fn stamped(
    files: Vec<PathBuf>,
    mut times_s: Vec<f64>,
    warnings: &mut Vec<Warning>,
) -> Frames {
    let images = whole_files(files).map(|whole| {
        times_s.truncate(whole.files.len());
        opened(whole, warnings)
    });
    Frames {
        images,
        times_s: Ok(times_s),
    }
}

/// Nothing but the fault of the images; the times are not looked for.
pub(super) fn no_frames(fault: SequenceError, list: &Path) -> Frames {
    Frames {
        images: Err(fault),
        times_s: if list.exists() {
            Ok(Vec::new())
        } else {
            Err(no_times(list, 0))
        },
    }
}

fn opened(whole: WholeFiles, warnings: &mut Vec<Warning>) -> Images {
    if let Some(fault) = whole.cut {
        warnings.push(Warning::new(
            "last-image-cut",
            format!(
                "The last image was cut while it was written ({fault}), the {} before it are used.",
                whole.files.len()
            ),
        ));
    }
    let images = Images::new(Arc::new(ImageFiles(whole.files)));
    warnings.extend(images.warning());
    images
}

fn no_times(list: &Path, images: usize) -> SequenceError {
    let example = if images > 0 {
        "; for images at an even rate --fps 10 (their number a second) stands in for it"
    } else {
        ""
    };
    SequenceError::Missing {
        path: list.to_path_buf(),
        holds: format!(
            "the time of every image in seconds, one a line in the order of the images{example}"
        ),
    }
}
