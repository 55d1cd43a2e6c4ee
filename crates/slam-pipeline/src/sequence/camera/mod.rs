//! Camera calibrations: what `camera.toml` holds, and the files of other tools that hold it too.
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

mod kalibr;
mod native;
mod opencv;
mod ros;
mod yaml;

use std::path::Path;

use mono_geometry::Distortion;

use super::SequenceError;
use super::text::{content_lines, quoted, read_text};
use yaml::Node;

pub(super) use native::read_camera;

/// Largest image side; a larger number is a slip of the keyboard.
const MAX_SIDE_PIXELS: u32 = 65_535;

/// Contents of `camera.toml`.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraFile {
    /// Image columns.
    pub width: u32,
    /// Image rows.
    pub height: u32,
    /// Focal length along columns, pixels.
    pub fx: f64,
    /// Focal length along rows, pixels.
    pub fy: f64,
    /// Column of the principal point, pixels.
    pub cx: f64,
    /// Row of the principal point, pixels.
    pub cy: f64,
    /// Lens distortion.
    pub distortion: Distortion,
    /// Pose of the camera in the body.
    pub mount: MountFile,
}

/// Pose of the camera in the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MountFile {
    /// Camera centre in body axes, metres.
    pub position_in_body: [f64; 3],
    /// Rows of the rotation; its columns are the camera's x, y, z axes in body axes.
    pub rotation_body_from_camera: [[f64; 3]; 3],
}

impl Default for MountFile {
    /// At the body's origin, looking along body x, upright.
    fn default() -> Self {
        MountFile {
            position_in_body: [0.0; 3],
            rotation_body_from_camera: [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]],
        }
    }
}

/// Whose file a calibration is in.
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

/// Reads a calibration; without a `format` it is recognised by what the file says.
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

impl CameraFile {
    /// The file with a lens of zeros taken for none, or what is wrong with its numbers.
    fn checked(mut self, path: &Path) -> Result<Self, SequenceError> {
        for (name, side) in [("width", self.width), ("height", self.height)] {
            if side == 0 || side > MAX_SIDE_PIXELS {
                return Err(file_fault(
                    path,
                    format!("{name} from 1 to {MAX_SIDE_PIXELS}"),
                    side.to_string(),
                ));
            }
        }
        for (name, focal) in [("fx", self.fx), ("fy", self.fy)] {
            if !(focal.is_finite() && focal > 0.0) {
                return Err(file_fault(
                    path,
                    format!("a positive {name}"),
                    focal.to_string(),
                ));
            }
        }
        for (name, centre) in [("cx", self.cx), ("cy", self.cy)] {
            if !centre.is_finite() {
                return Err(file_fault(
                    path,
                    format!("a finite {name}"),
                    centre.to_string(),
                ));
            }
        }
        // The fisheye polynomial of zeros is no pinhole.
        if let Distortion::Radtan { k1, k2, p1, p2, k3 } = self.distortion
            && [k1, k2, p1, p2, k3] == [0.0; 5]
        {
            self.distortion = Distortion::None;
        }
        Ok(self)
    }
}

/// A lens of OpenCV's coefficients, 4, 5, 8, 12 or 14 of them: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tx ty.
///
/// The rational lens only where its denominator is one; otherwise the count, or the name of the coefficient this program
/// has no place for.
fn lens_from_opencv(coefficients: &[f64]) -> Result<Distortion, (String, String)> {
    if !matches!(coefficients.len(), 4 | 5 | 8 | 12 | 14) {
        return Err((
            "4, 5, 8, 12 or 14 distortion coefficients".into(),
            coefficients.len().to_string(),
        ));
    }
    let mut all = [0.0; 14];
    all[..coefficients.len()].copy_from_slice(coefficients);
    let [k1, k2, p1, p2, k3, k4, k5, k6, beyond @ ..] = all;
    for (name, value) in ["s1", "s2", "s3", "s4", "tau_x", "tau_y"]
        .iter()
        .zip(beyond)
    {
        if value != 0.0 {
            return Err((
                "a lens without thin prism and tilted sensor".into(),
                format!("{name} = {value}"),
            ));
        }
    }
    Ok(if [k4, k5, k6] == [0.0; 3] {
        Distortion::Radtan { k1, k2, p1, p2, k3 }
    } else {
        Distortion::Rational {
            k1,
            k2,
            p1,
            p2,
            k3,
            k4,
            k5,
            k6,
        }
    })
}

/// The coefficients in OpenCV's order, five zeros for no lens.
fn opencv_coefficients(lens: &Distortion) -> Vec<f64> {
    match lens {
        Distortion::None => vec![0.0; 5],
        _ => lens.parameters(),
    }
}

/// Fault of a file as a whole.
fn file_fault(path: &Path, expected: impl Into<String>, found: impl Into<String>) -> SequenceError {
    SequenceError::File {
        path: path.to_path_buf(),
        expected: expected.into(),
        found: found.into(),
    }
}

/// A number that reads back to the same bits, and that YAML 1.1, YAML 1.2 and TOML all take for a float: with a
/// point, and a sign in the exponent.
fn number(value: f64) -> String {
    let text = format!("{value:?}");
    let Some((mantissa, exponent)) = text.split_once('e') else {
        return text;
    };
    let point = if mantissa.contains('.') { "" } else { ".0" };
    let sign = if exponent.starts_with('-') { "" } else { "+" };
    format!("{mantissa}{point}e{sign}{exponent}")
}

/// Numbers between commas.
fn numbers(values: &[f64]) -> String {
    let written: Vec<String> = values.iter().map(|&value| number(value)).collect();
    written.join(", ")
}
