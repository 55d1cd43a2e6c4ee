//! The contents of a camera file, whoever wrote it, and the pieces that its readers and writers share.

use std::path::Path;

use mono_geometry::{Camera, Distortion, GeometryError, Mount, Pinhole};
use nalgebra::{Matrix3, Vector3};
use serde::Deserialize;

use crate::error::SequenceError;

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
    /// How well the numbers are known; formats of other tools have no place for it.
    pub sigma: SigmaFile,
}

/// Standard deviations of the numbers of a camera file, `[sigma]` in `camera.toml`; `None` where nothing is known.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SigmaFile {
    /// Focal length along columns, pixels.
    pub fx: Option<f64>,
    /// Focal length along rows, pixels.
    pub fy: Option<f64>,
    /// Column of the principal point, pixels.
    pub cx: Option<f64>,
    /// Row of the principal point, pixels.
    pub cy: Option<f64>,
    /// First lens coefficient.
    pub k1: Option<f64>,
    /// Turn of the mount about body z, radians.
    pub mount_yaw: Option<f64>,
    /// Position of the camera in the body, forward, metres.
    pub lever_x: Option<f64>,
    /// Position of the camera in the body, to the left, metres.
    pub lever_y: Option<f64>,
}

impl SigmaFile {
    /// The values that are known, with their names.
    pub(super) fn known(&self) -> impl Iterator<Item = (&'static str, f64)> {
        [
            ("fx", self.fx),
            ("fy", self.fy),
            ("cx", self.cx),
            ("cy", self.cy),
            ("k1", self.k1),
            ("mount_yaw", self.mount_yaw),
            ("lever_x", self.lever_x),
            ("lever_y", self.lever_y),
        ]
        .into_iter()
        .filter_map(|(name, value)| Some((name, value?)))
    }
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

impl CameraFile {
    /// A camera of another tool: fx, fy, cx, cy in pixels, at the default place on the body.
    pub(super) fn of([width, height]: [u32; 2], numbers: [f64; 4], distortion: Distortion) -> Self {
        let [fx, fy, cx, cy] = numbers;
        CameraFile {
            width,
            height,
            fx,
            fy,
            cx,
            cy,
            distortion,
            mount: MountFile::default(),
            sigma: SigmaFile::default(),
        }
    }

    /// The camera and its mount on the body.
    ///
    /// # Errors
    /// [`GeometryError`] with the number that describes no camera.
    pub fn camera_and_mount(&self) -> Result<(Camera, Mount), GeometryError> {
        let pinhole = Pinhole {
            width: self.width as usize,
            height: self.height as usize,
            fx: self.fx,
            fy: self.fy,
            cx: self.cx,
            cy: self.cy,
        };
        let rows = self.mount.rotation_body_from_camera;
        let rotation = Matrix3::from_fn(|i, j| rows[i][j]);
        Ok((
            Camera::new(pinhole, self.distortion)?,
            Mount::new(&rotation, &Vector3::from(self.mount.position_in_body))?,
        ))
    }

    /// The file with a lens of zeros taken for none, or what is wrong with its numbers.
    pub(crate) fn checked(mut self, path: &Path) -> Result<Self, SequenceError> {
        for (name, side) in [("width", self.width), ("height", self.height)] {
            if side == 0 || side > MAX_SIDE_PIXELS {
                return Err(file_fault(
                    path,
                    format!("{name} from 1 to {MAX_SIDE_PIXELS}"),
                    side.to_string(),
                ));
            }
        }
        if [self.fx, self.fy] == [0.0; 2] {
            return Err(file_fault(
                path,
                "the numbers of a calibrated camera",
                "fx and fy of zero, as a camera that was never calibrated has them",
            ));
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
pub(super) fn lens_from_opencv(coefficients: &[f64]) -> Result<Distortion, (String, String)> {
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
pub(super) fn opencv_coefficients(lens: &Distortion) -> Vec<f64> {
    match lens {
        Distortion::None => vec![0.0; 5],
        _ => lens.parameters(),
    }
}

/// Fault of a file as a whole.
pub(super) fn file_fault(
    path: &Path,
    expected: impl Into<String>,
    found: impl Into<String>,
) -> SequenceError {
    SequenceError::File {
        path: path.to_path_buf(),
        expected: expected.into(),
        found: found.into(),
    }
}

/// A number that reads back to the same bits, and that YAML 1.1, YAML 1.2 and TOML all take for a float: with a
/// point, and a sign in the exponent.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:?}");
    let Some((mantissa, exponent)) = text.split_once('e') else {
        return text;
    };
    let point = if mantissa.contains('.') { "" } else { ".0" };
    let sign = if exponent.starts_with('-') { "" } else { "+" };
    format!("{mantissa}{point}e{sign}{exponent}")
}

/// Numbers between commas.
pub(super) fn numbers(values: &[f64]) -> String {
    let written: Vec<String> = values.iter().map(|&value| number(value)).collect();
    written.join(", ")
}
