//! The native layout, and a folder of images with the same text files beside them.

use std::path::{Path, PathBuf};

use super::calibrations::{Camera, given_camera, no_camera};
use super::folder::survey_of;
use super::frames::{frames_of, no_frames};
use super::options::{OpenOptions, SequenceFormat};
use super::reference::read_reference;
use super::survey::{Part, Survey};
use crate::error::SequenceError;
use crate::images::{IMAGE_ENDINGS, listed_images};

/// Looks at the folder; of [`SequenceFormat::Images`] the images lie in `root` itself.
pub(super) fn survey(root: &Path, format: SequenceFormat, options: &OpenOptions) -> Survey {
    let mut warnings = Vec::new();
    let folder = match format {
        SequenceFormat::Images => root.to_path_buf(),
        _ => root.join("images"),
    };
    let list = root.join("times.txt");
    let frames = match images_in(&folder) {
        Ok(files) => frames_of(files, &list, &mut warnings),
        Err(fault) => no_frames(fault, &list),
    };
    let first_s = frames.first_s();
    let camera = given_camera(root, options, frames.size(), &mut warnings)
        .unwrap_or_else(|| Camera::of_layout(Err(no_camera(root, "")), "camera.toml"));
    let reference = read_reference(root, &camera.mount(), first_s);
    survey_of(root, format, frames, camera, reference, options, warnings)
}

fn images_in(folder: &Path) -> Part<Vec<PathBuf>> {
    if folder.is_dir() {
        return listed_images(folder);
    }
    if folder.exists() {
        return Err(SequenceError::File {
            path: folder.to_path_buf(),
            expected: "a folder of images".into(),
            found: "a file".into(),
        });
    }
    Err(SequenceError::Missing {
        path: folder.to_path_buf(),
        holds: format!(
            "the images, one file per frame (.{}); `ffmpeg -i VIDEO {}/%06d.png` takes a video apart",
            IMAGE_ENDINGS.join(", ."),
            folder.display()
        ),
    })
}
