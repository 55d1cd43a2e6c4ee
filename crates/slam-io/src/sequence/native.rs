//! The native layout, and a folder of images with the same text files beside them.

use std::path::{Path, PathBuf};

use super::calibrations::{Camera, given_camera, no_camera};
use super::frames::{Frames, frames_of, known, no_frames};
use super::odometry::find_odometry;
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
    let Frames { images, times_s } = frames;
    // What the odometry is held against: the frames by its own clock.
    let by_odometry: Option<Vec<f64>> = known(&times_s).map(|times| {
        times
            .iter()
            .map(|t_s| t_s - options.odometry_offset_s)
            .collect()
    });
    Survey {
        name: String::new(),
        root: root.to_path_buf(),
        format,
        images,
        camera: camera.camera,
        camera_name: camera.name,
        sizes: Ok(()),
        odometry: find_odometry(root, by_odometry.as_deref(), &mut warnings),
        reference,
        times_s,
        warnings,
        camera_file: camera.file,
    }
}

fn images_in(folder: &Path) -> Part<Vec<PathBuf>> {
    if folder.is_dir() {
        return listed_images(folder);
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
