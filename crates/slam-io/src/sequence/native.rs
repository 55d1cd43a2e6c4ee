//! The native layout, and a folder of images with the same text files beside them.

use std::path::{Path, PathBuf};

use super::frames::{Frames, frames_of, no_frames};
use super::odometry::find_odometry;
use super::options::{OpenOptions, SequenceFormat};
use super::reference::read_reference;
use super::survey::{Part, Survey};
use crate::camera::{CameraFile, MountFile, read_calibration, read_camera};
use crate::error::SequenceError;
use crate::images::{IMAGE_ENDINGS, listed_images};

/// File name of the calibration.
pub(super) const CAMERA: &str = "camera.toml";

/// Looks at the folder; of [`SequenceFormat::Images`] the images lie in `root` itself.
pub(super) fn survey(root: &Path, format: SequenceFormat, options: &OpenOptions) -> Survey {
    let mut warnings = Vec::new();
    let folder = match format {
        SequenceFormat::Images => root.to_path_buf(),
        _ => root.join("images"),
    };
    let list = root.join("times.txt");
    let Frames { images, times_s } = match images_in(&folder) {
        Ok(files) => frames_of(files, &list, &mut warnings),
        Err(fault) => no_frames(fault, &list),
    };
    let Camera {
        camera,
        name: camera_name,
        file: camera_file,
    } = camera_of(root, options);
    let first_s = times_s
        .as_ref()
        .ok()
        .and_then(|times| times.first().copied());
    let mount = camera
        .as_ref()
        .map_or_else(|_| MountFile::default(), |camera| camera.mount);
    Survey {
        name: String::new(),
        root: root.to_path_buf(),
        format,
        images,
        camera,
        camera_name,
        sizes: Ok(()),
        odometry: find_odometry(
            root,
            times_s.as_deref().ok().filter(|times| !times.is_empty()),
            &mut warnings,
        ),
        reference: read_reference(root, &mount, first_s),
        times_s,
        warnings,
        camera_file,
    }
}

/// A calibration and where it came from.
pub(super) struct Camera {
    pub(super) camera: Part<CameraFile>,
    /// The file's name, for messages.
    pub(super) name: String,
    /// `camera.toml`, if the calibration is exactly its contents.
    pub(super) file: Option<PathBuf>,
}

/// The calibration that the options name, otherwise `camera.toml` of the folder.
pub(super) fn camera_of(root: &Path, options: &OpenOptions) -> Camera {
    if let Some(path) = &options.camera {
        return Camera {
            camera: read_calibration(path, None, None),
            name: path.display().to_string(),
            file: None,
        };
    }
    let path = root.join(CAMERA);
    Camera {
        camera: if path.exists() {
            read_camera(&path)
        } else {
            Err(no_camera(&path))
        },
        name: CAMERA.into(),
        file: Some(path),
    }
}

/// The sentence about a missing calibration.
pub(super) fn no_camera(path: &Path) -> SequenceError {
    let shown = path.display();
    SequenceError::Missing {
        path: path.to_path_buf(),
        holds: format!(
            "the calibration of the camera; make it from photographs of a checkerboard with `mono-slam calibrate \
             PHOTOS --board 9x6 --square 0.025 --out {shown}`, or from a file of Kalibr, OpenCV or ROS with \
             `mono-slam camera FILE --out {shown}`, or name such a file with --camera"
        ),
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
