//! The calibration of a sequence: the one that the caller names, its own `camera.toml`, that of its layout.

use std::path::{Path, PathBuf};

use super::options::OpenOptions;
use super::survey::Part;
use crate::camera::{
    CalibrationRequest, CameraFile, CameraFormat, MountFile, read_calibration, read_camera,
};
use crate::error::SequenceError;
use crate::warning::Warning;

/// File name of the native calibration.
pub(super) const CAMERA: &str = "camera.toml";

/// A calibration and where it came from.
pub(super) struct Camera {
    pub(super) camera: Part<CameraFile>,
    /// The file's name, for messages.
    pub(super) name: String,
    /// `camera.toml`, if the calibration is exactly its contents.
    pub(super) file: Option<PathBuf>,
}

impl Camera {
    /// The calibration that a layout keeps in a file of its own.
    pub(super) fn of_layout(camera: Part<CameraFile>, name: &str) -> Self {
        Self {
            camera,
            name: name.into(),
            file: None,
        }
    }

    /// The mount, the default one where there is no calibration.
    pub(super) fn mount(&self) -> MountFile {
        self.camera
            .as_ref()
            .map_or_else(|_| MountFile::default(), |camera| camera.mount)
    }
}

/// The calibration that the options name, otherwise `camera.toml` of the folder, if there is one of them.
///
/// `size` are columns and rows of the images, for calibrations that do not say them.
pub(super) fn given_camera(
    root: &Path,
    options: &OpenOptions,
    size: Option<[u32; 2]>,
    warnings: &mut Vec<Warning>,
) -> Option<Camera> {
    if let Some(path) = &options.camera {
        return Some(Camera::of_layout(
            foreign_camera(path, None, None, size, warnings),
            &path.display().to_string(),
        ));
    }
    let path = root.join(CAMERA);
    path.exists().then(|| Camera {
        camera: read_camera(&path).inspect(|camera| {
            let oddities = camera.oddities().into_iter();
            warnings.extend(oddities.map(|oddity| Warning::new("unusual-camera", oddity)));
        }),
        name: CAMERA.into(),
        file: Some(path),
    })
}

/// Reads the calibration of another tool; its notes become warnings.
pub(super) fn foreign_camera(
    path: &Path,
    format: Option<CameraFormat>,
    camera: Option<String>,
    size: Option<[u32; 2]>,
    warnings: &mut Vec<Warning>,
) -> Part<CameraFile> {
    let mut request = CalibrationRequest {
        format,
        camera,
        size: None,
    };
    let mut found = read_calibration(path, &request);
    if found.is_err() && size.is_some() {
        // A file without a size takes that of the images; of one that says another the first answer counts.
        request.size = size;
        found = read_calibration(path, &request).or(found);
    }
    let found = found?;
    warnings.extend(
        found
            .notes
            .into_iter()
            .map(|note| Warning::new("calibration", format!("{}: {note}.", path.display()))),
    );
    Ok(found.camera)
}

/// The sentence about a missing calibration; `example` names a file that would do.
pub(super) fn no_camera(root: &Path, example: &str) -> SequenceError {
    let path = root.join(CAMERA);
    let shown = path.display();
    SequenceError::Missing {
        holds: format!(
            "the calibration of the camera; make it from photographs of a checkerboard with `mono-slam calibrate \
             PHOTOS --board 9x6 --square 0.025 --out {shown}`, or convert a file of another tool with `mono-slam \
             camera FILE --out {shown}`, or name such a file with --camera FILE{example}"
        ),
        path,
    }
}
