//! Camera calibrations: `camera.toml` and the files of other tools that hold the same.
//!
//! | [`CameraFormat`] | written by | lens models |
//! |---|---|---|
//! | `Toml` | this program, by hand | none, radtan, rational, kannala-brandt; and the mount |
//! | `Kalibr` | Kalibr, `camchain.yaml` | none, radtan without k3, equidistant |
//! | `OpenCv` | OpenCV's `FileStorage`, yml | 4, 5 or 8 coefficients, fisheye |
//! | `Ros` | ROS `camera_calibration` | `plumb_bob`, `rational_polynomial`, `equidistant` |
//!
//! [`read_calibration`] reads any of them, [`calibration_text`] writes any. All four put pixel (0, 0) at the centre of
//! the top-left pixel and the coefficients in OpenCV's order, so no number changes on the way: a file written here is
//! read back to the bit.
//!
//! Two things do not survive. The *mount* exists in `camera.toml` only: files of other tools are read with the default
//! mount, and writing them drops it. Kalibr's `T_cam_imu` places the camera at an IMU, not at the turning centre of a
//! wheeled robot, and is ignored. And a radial-tangential lens of zeros is read as no lens, because OpenCV and ROS
//! have no other way to write one.

mod file;
mod kalibr;
mod native;
mod opencv;
mod ros;
mod yaml;

use std::path::Path;

use crate::error::SequenceError;
use crate::text::{content_lines, quoted, read_text};
use file::file_fault;
use yaml::Node;

pub use file::{CameraFile, MountFile, SigmaFile};
pub(crate) use native::read_camera;

/// The file format of a calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CameraFormat {
    /// `camera.toml` of a sequence folder.
    Toml,
    /// Kalibr's `camchain.yaml`.
    Kalibr,
    /// OpenCV's `FileStorage` in YAML.
    OpenCv,
    /// ROS `camera_info`, as `camera_calibration` writes it.
    Ros,
}

/// Reads a calibration; without a `format` it is recognised by the contents of the file.
///
/// `camera` chooses among the cameras of a Kalibr file (`None`: `cam0`).
///
/// # Errors
/// [`SequenceError`] with the file, the line where there is one, what was expected and what was found: not a
/// calibration at all, a missing key, a wrong count, a number that is not finite, a lens model or a coefficient this
/// program does not have, a `camera` in a file of another format.
pub fn read_calibration(
    path: &Path,
    format: Option<CameraFormat>,
    camera: Option<&str>,
) -> Result<CameraFile, SequenceError> {
    let text = read_text(path)?;
    let format = match format {
        Some(format) => format,
        None => recognise(path, &text)?,
    };
    if let (Some(camera), true) = (camera, format != CameraFormat::Kalibr) {
        return Err(file_fault(
            path,
            format!("a Kalibr file to choose {camera} from"),
            "a file of one camera",
        ));
    }
    if format == CameraFormat::Toml {
        return native::parse(path, &text);
    }
    let text = yaml::standard_header(&text);
    let documents = yaml::load(path, &text)?;
    let root = Node::root(path, &documents)?;
    let found = match format {
        CameraFormat::Kalibr => kalibr::parse(&root, camera.unwrap_or("cam0"))?,
        CameraFormat::OpenCv => opencv::parse(&root)?,
        CameraFormat::Ros | CameraFormat::Toml => ros::parse(&root)?,
    };
    found.checked(path)
}

/// The calibration as the text of a file of the format.
///
/// # Errors
/// [`SequenceError::NoPlace`] for a lens the format cannot hold: Kalibr has no k3 and no rational lens.
pub fn calibration_text(
    camera: &CameraFile,
    format: CameraFormat,
) -> Result<String, SequenceError> {
    match format {
        CameraFormat::Toml => Ok(native::text(camera)),
        CameraFormat::Kalibr => kalibr::text(camera),
        CameraFormat::OpenCv => Ok(opencv::text(camera)),
        CameraFormat::Ros => Ok(ros::text(camera)),
    }
}

/// The format of a text, from its first line and its keys.
fn recognise(path: &Path, text: &str) -> Result<CameraFormat, SequenceError> {
    let foreign = |found: String| {
        file_fault(
            path,
            "a camera.toml, a Kalibr camchain, an OpenCV FileStorage or a ROS camera_info",
            found,
        )
    };
    let Some((_, first)) = content_lines(text).next() else {
        return Err(foreign("an empty file".into()));
    };
    // In TOML the first thing is a table or a key with its equals sign; in none of the YAML files.
    let before_equals = first.split('=').next().filter(|_| first.contains('='));
    if first.starts_with('[') || before_equals.is_some_and(|key| !key.contains(':')) {
        return Ok(CameraFormat::Toml);
    }
    let text = yaml::standard_header(text);
    let documents = yaml::load(path, &text)?;
    let Ok(root) = Node::root(path, &documents) else {
        return Err(foreign(quoted(first)));
    };
    if ros::recognises(&root) {
        Ok(CameraFormat::Ros)
    } else if opencv::recognises(&root) {
        Ok(CameraFormat::OpenCv)
    } else if kalibr::recognises(&root) {
        Ok(CameraFormat::Kalibr)
    } else {
        Err(foreign(format!("the keys {}", root.keys().join(", "))))
    }
}
