//! `camera.toml`: intrinsics, lens distortion and where the camera sits on the body.
//!
//! ```toml
//! width = 320
//! height = 240
//! model = "pinhole"
//! fx = 262.53        # pixels; pixel (0,0) is the centre of the top-left pixel
//! fy = 262.12
//! cx = 154.07
//! cy = 118.02
//!
//! [distortion]       # optional
//! model = "radtan"   # k1 k2 p1 p2 and, optional, k3, in OpenCV's order
//! k1 = 0.11          # or model = "kannala-brandt" with k1 k2 k3 k4
//! k2 = -0.21
//! p1 = 0.0
//! p2 = 0.0
//!
//! [mount]            # optional; without it the camera looks along body x
//! position_in_body = [0.0, 0.0, 0.1]
//! rotation_body_from_camera = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
//! ```
//!
//! Body axes: x forward, y left, z up. Camera axes: x right, y down, z forward. The
//! columns of the rotation are the camera's axes in body axes. A rotation written with
//! few digits is accepted within [`ROTATION_TOLERANCE`] and replaced by the nearest
//! orthonormal matrix.

use std::path::Path;

use nalgebra::Matrix3;
use serde::Deserialize;

use super::SequenceError;
use super::text::{line_fault, read_text};

/// Largest believed deviation of `R^T R` from the identity, entry by entry: four written decimals.
const ROTATION_TOLERANCE: f64 = 1e-3;
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
    pub distortion: DistortionFile,
    /// Pose of the camera in the body.
    pub mount: MountFile,
}

/// Lens distortion as written in the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DistortionFile {
    /// An ideal pinhole.
    None,
    /// Radial and tangential, OpenCV's coefficients.
    Radtan {
        /// Radial, second order.
        k1: f64,
        /// Radial, fourth order.
        k2: f64,
        /// Tangential.
        p1: f64,
        /// Tangential.
        p2: f64,
        /// Radial, sixth order.
        k3: f64,
    },
    /// Equidistant fisheye of Kannala and Brandt.
    KannalaBrandt {
        /// Third power of the angle.
        k1: f64,
        /// Fifth power.
        k2: f64,
        /// Seventh power.
        k3: f64,
        /// Ninth power.
        k4: f64,
    },
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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCamera {
    width: u32,
    height: u32,
    model: String,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    distortion: Option<RawDistortion>,
    mount: Option<RawMount>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawDistortion {
    model: String,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMount {
    position_in_body: [f64; 3],
    rotation_body_from_camera: [[f64; 3]; 3],
}

/// Reads and checks a camera file.
pub(super) fn read_camera(path: &Path) -> Result<CameraFile, SequenceError> {
    let text = read_text(path)?;
    let raw: RawCamera = toml::from_str(&text).map_err(|error| {
        let offset = error.span().map_or(0, |span| span.start.min(text.len()));
        let line = 1 + text.as_bytes()[..offset]
            .iter()
            .filter(|&&byte| byte == b'\n')
            .count() as u64;
        line_fault(
            path,
            line,
            "a camera file",
            error.message().replace('\n', " "),
        )
    })?;
    let fault = |expected: &str, found: String| SequenceError::File {
        path: path.to_path_buf(),
        expected: expected.into(),
        found,
    };
    if raw.model != "pinhole" {
        return Err(fault("model = \"pinhole\"", format!("{:?}", raw.model)));
    }
    for (name, side) in [("width", raw.width), ("height", raw.height)] {
        if side == 0 || side > MAX_SIDE_PIXELS {
            return Err(fault(
                &format!("{name} from 1 to {MAX_SIDE_PIXELS}"),
                side.to_string(),
            ));
        }
    }
    for (name, focal) in [("fx", raw.fx), ("fy", raw.fy)] {
        if !(focal.is_finite() && focal > 0.0) {
            return Err(fault(&format!("a positive {name}"), focal.to_string()));
        }
    }
    for (name, centre) in [("cx", raw.cx), ("cy", raw.cy)] {
        if !centre.is_finite() {
            return Err(fault(&format!("a finite {name}"), centre.to_string()));
        }
    }
    let distortion = match &raw.distortion {
        None => DistortionFile::None,
        Some(distortion) => {
            checked_distortion(distortion).map_err(|(expected, found)| fault(&expected, found))?
        }
    };
    let mount = match &raw.mount {
        None => MountFile::default(),
        Some(mount) => checked_mount(mount).map_err(|(expected, found)| fault(&expected, found))?,
    };
    Ok(CameraFile {
        width: raw.width,
        height: raw.height,
        fx: raw.fx,
        fy: raw.fy,
        cx: raw.cx,
        cy: raw.cy,
        distortion,
        mount,
    })
}

/// (expected, found).
type Fault = (String, String);

fn checked_distortion(raw: &RawDistortion) -> Result<DistortionFile, Fault> {
    let need = |name: &str, value: Option<f64>| match value {
        Some(value) if value.is_finite() => Ok(value),
        Some(value) => Err((
            format!("a finite {name} in [distortion]"),
            value.to_string(),
        )),
        None => Err((
            format!("{name} in [distortion] for model {:?}", raw.model),
            "none".to_string(),
        )),
    };
    let refuse = |name: &str, value: Option<f64>| match value {
        None => Ok(()),
        Some(value) => Err((
            format!("no {name} in [distortion] for model {:?}", raw.model),
            format!("{name} = {value}"),
        )),
    };
    match raw.model.as_str() {
        "radtan" => {
            refuse("k4", raw.k4)?;
            Ok(DistortionFile::Radtan {
                k1: need("k1", raw.k1)?,
                k2: need("k2", raw.k2)?,
                p1: need("p1", raw.p1)?,
                p2: need("p2", raw.p2)?,
                k3: need("k3", Some(raw.k3.unwrap_or(0.0)))?,
            })
        }
        "kannala-brandt" => {
            refuse("p1", raw.p1)?;
            refuse("p2", raw.p2)?;
            Ok(DistortionFile::KannalaBrandt {
                k1: need("k1", raw.k1)?,
                k2: need("k2", raw.k2)?,
                k3: need("k3", raw.k3)?,
                k4: need("k4", raw.k4)?,
            })
        }
        other => Err((
            "\"radtan\" or \"kannala-brandt\" as model of [distortion]".into(),
            format!("{other:?}"),
        )),
    }
}

fn checked_mount(raw: &RawMount) -> Result<MountFile, Fault> {
    if raw.position_in_body.iter().any(|value| !value.is_finite()) {
        return Err((
            "a finite position_in_body in [mount]".into(),
            format!("{:?}", raw.position_in_body),
        ));
    }
    let rows = raw.rotation_body_from_camera;
    let mut rotation = Matrix3::from_fn(|row, column| rows[row][column]);
    let deviation = (rotation.transpose() * rotation - Matrix3::identity()).abs();
    // Written so that a NaN fails.
    let orthonormal = deviation.iter().all(|&entry| entry <= ROTATION_TOLERANCE);
    if !orthonormal {
        return Err((
            format!(
                "orthonormal columns in rotation_body_from_camera of [mount] within {ROTATION_TOLERANCE}"
            ),
            format!("a deviation of {}", deviation.max()),
        ));
    }
    if rotation.determinant() <= 0.0 {
        return Err((
            "a right-handed rotation_body_from_camera in [mount] (determinant +1)".into(),
            format!("a determinant of {}", rotation.determinant()),
        ));
    }
    // Newton's iteration for the orthonormal polar factor: quadratic, and exact for exact rotations.
    for _ in 0..4 {
        rotation = rotation * (Matrix3::identity() * 3.0 - rotation.transpose() * rotation) * 0.5;
    }
    Ok(MountFile {
        position_in_body: raw.position_in_body,
        rotation_body_from_camera: std::array::from_fn(|row| {
            std::array::from_fn(|column| rotation[(row, column)])
        }),
    })
}
