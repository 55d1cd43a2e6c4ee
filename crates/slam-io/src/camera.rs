//! Camera calibrations: `camera.toml` and the files of other tools that hold the same.
//!
//! | [`CameraFormat`] | written by | lens models |
//! |---|---|---|
//! | `Toml` | this program, by hand | none, radtan, rational, kannala-brandt; and the mount |
//! | `Kalibr` | Kalibr, `camchain.yaml` | none, radtan, equidistant |
//! | `OpenCv` | OpenCV's `FileStorage`, yml, xml, json | 4, 5 or 8 coefficients, fisheye |
//! | `Ros` | ROS `camera_calibration`, `topic echo` of `CameraInfo` | `plumb_bob`, `rational_polynomial`, `equidistant` |
//! | `OrbSlam` | settings of ORB-SLAM 2 and 3 | PinHole, KannalaBrandt8, Rectified |
//! | `Camodocal` | camodocal, VINS | PINHOLE, PINHOLE_FULL, KANNALA_BRANDT |
//! | `Colmap` | `cameras.txt`, `cameras.bin` | pinholes, radial ones, OPENCV, OPENCV_FISHEYE, FULL_OPENCV |
//! | `Euroc` | `sensor.yaml` | radial-tangential, equidistant |
//! | `Kitti` | `calib_cam_to_cam.txt`, `calib.txt` | none: the images are rectified |
//!
//! [`read_calibration`] reads any of them, [`calibration_text`] writes the first four. Those put pixel (0, 0) at the
//! centre of the top-left pixel and the coefficients in OpenCV's order, so no number changes on the way: a file written
//! here is read back to the bit. COLMAP's half pixel is taken off.
//!
//! Two things do not survive. The *mount* exists in `camera.toml` only: files of other tools are read with the default
//! mount, and writing them drops it. Kalibr's `T_cam_imu` places the camera at an IMU, not at the turning centre of a
//! wheeled robot, and is ignored. And a radial-tangential lens of zeros is read as no lens, because OpenCV and ROS
//! have no other way to write one.

mod camodocal;
mod colmap;
mod euroc;
mod file;
mod format;
mod info;
mod kalibr;
mod kitti;
mod native;
mod opencv;
mod orbslam;
mod plausible;
mod read;
mod recognise;
mod ros;
mod skew;
mod xml;
mod yaml;

use std::path::Path;

use crate::error::SequenceError;
use crate::text::{decoded_text, read_bytes};
use read::Wanted;
use yaml::Node;

pub use file::{CameraFile, MountFile, SigmaFile};
pub use format::CameraFormat;
pub(crate) use info::camera_of_info;

/// How a calibration is to be read; the default recognises everything.
#[derive(Debug, Clone, Default)]
pub struct CalibrationRequest {
    /// The format (`None`: recognised by the contents).
    pub format: Option<CameraFormat>,
    /// The camera to take from a file of several (`None`: the first or usual one, with a note).
    pub camera: Option<String>,
    /// Columns and rows of the images, for files that do not say them.
    pub size: Option<[u32; 2]>,
}

/// A calibration that was read.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundCalibration {
    /// The camera.
    pub camera: CameraFile,
    /// One sentence for everything that was left out, assumed or looks odd.
    pub notes: Vec<String>,
}

/// Reads a calibration of any of the formats.
///
/// # Errors
/// [`SequenceError`] with the file, the line where there is one, what was expected and what was found: not a
/// calibration at all, a missing key, a wrong count, a number that is not finite, a lens model or a coefficient this
/// program does not have, a choice of camera that the file does not offer, no image size or another one, numbers that
/// no camera has ([`CameraFile::implausible`]).
pub fn read_calibration(
    path: &Path,
    request: &CalibrationRequest,
) -> Result<FoundCalibration, SequenceError> {
    let bytes = read_bytes(path)?;
    let mut wanted = Wanted::new(request.camera.as_deref(), request.size);
    let camera = parse(path, &bytes, request.format, &mut wanted)?.plausible(path)?;
    let mut notes = wanted.into_notes();
    notes.extend(camera.oddities());
    Ok(FoundCalibration { camera, notes })
}

fn parse(
    path: &Path,
    bytes: &[u8],
    format: Option<CameraFormat>,
    wanted: &mut Wanted<'_>,
) -> Result<CameraFile, SequenceError> {
    if format.is_none_or(|format| format == CameraFormat::Colmap)
        && let Some(read) = colmap::parse_binary(path, bytes, wanted)
    {
        return read?.checked(path);
    }
    let text = decoded_text(path, bytes)?;
    let format = match format {
        Some(format) => format,
        None => recognise::recognise(path, &text)?,
    };
    let read = match format {
        CameraFormat::Toml => {
            wanted.only_camera(path)?;
            let camera = native::parse(path, &text)?;
            wanted.size_of(path, Some([camera.width, camera.height]), "a size")?;
            return Ok(camera);
        }
        CameraFormat::Colmap => colmap::parse_text(path, &text, wanted),
        CameraFormat::Kitti => kitti::parse(path, &text, wanted),
        tree => {
            let text = yaml::standard_header(&text);
            let documents = if text.trim_start().starts_with('<') {
                xml::load(path, &text)?
            } else {
                yaml::load(path, &text)?
            };
            let root = Node::root(path, &documents)?;
            match tree {
                CameraFormat::Kalibr => kalibr::parse(&root, wanted),
                CameraFormat::OpenCv => opencv::parse(&root, wanted),
                CameraFormat::OrbSlam => orbslam::parse(&root, wanted),
                CameraFormat::Camodocal => camodocal::parse(&root, wanted),
                CameraFormat::Euroc => euroc::parse(&root, wanted),
                _ => ros::parse(&root, wanted),
            }
        }
    };
    read?.checked(path)
}

/// Reads and checks `camera.toml` of a sequence.
///
/// # Errors
/// As [`read_calibration`]; the file of another tool under this name is answered with the command that converts it.
pub(crate) fn read_camera(path: &Path) -> Result<CameraFile, SequenceError> {
    let text = decoded_text(path, &read_bytes(path)?)?;
    if !recognise::looks_like_toml(&text)
        && let Ok(format) = recognise::recognise(path, &text)
        && format != CameraFormat::Toml
    {
        return Err(file::file_fault(
            path,
            "a camera.toml",
            format!(
                "{}, which `mono-slam camera {path} --out {path}` converts",
                format.title(),
                path = path.display()
            ),
        ));
    }
    native::parse(path, &text)?.plausible(path)
}

/// The calibration as the text of a file of the format.
///
/// # Errors
/// [`SequenceError::NoPlace`] for a lens the format cannot hold (Kalibr has no k3 and no rational lens), and for the
/// formats that are only read.
pub fn calibration_text(
    camera: &CameraFile,
    format: CameraFormat,
) -> Result<String, SequenceError> {
    match format {
        CameraFormat::Toml => Ok(native::text(camera)),
        CameraFormat::Kalibr => kalibr::text(camera),
        CameraFormat::OpenCv => Ok(opencv::text(camera)),
        CameraFormat::Ros => Ok(ros::text(camera)),
        other => Err(SequenceError::NoPlace {
            format: "this program, which only reads it,",
            what: other.title().to_owned(),
        }),
    }
}
