//! The calibration in a ROS `CameraInfo` message, whose fields are those of the YAML file without its keys.

use std::path::Path;

use super::file::{CameraFile, file_fault, lens_from_opencv};
use crate::error::SequenceError;
use mono_geometry::Distortion;

/// The calibration of `[width, height]` in pixels, `[fx, fy, cx, cy]`, the name of the lens model and its coefficients.
///
/// # Errors
/// [`SequenceError`] for `path` when a number is out of range or the lens model is not known.
pub(crate) fn camera_of_info(
    path: &Path,
    [width, height]: [u32; 2],
    [fx, fy, cx, cy]: [f64; 4],
    model: &str,
    coefficients: &[f64],
) -> Result<CameraFile, SequenceError> {
    let distortion = match (model, coefficients) {
        (_, all)
            if all.iter().all(|&value| value == 0.0)
                && !matches!(model, "equidistant" | "fisheye") =>
        {
            Distortion::None
        }
        // `Brown Conrady` is the name of librealsense.
        ("plumb_bob" | "rational_polynomial" | "Brown Conrady" | "", _) => {
            lens_from_opencv(coefficients)
                .map_err(|(expected, found)| file_fault(path, expected, found))?
        }
        // `fisheye` is the name of camera_calibration in ROS Melodic.
        ("equidistant" | "fisheye", &[k1, k2, k3, k4]) => {
            Distortion::KannalaBrandt { k1, k2, k3, k4 }
        }
        ("equidistant" | "fisheye", _) => {
            return Err(file_fault(
                path,
                "4 coefficients of an equidistant lens",
                coefficients.len().to_string(),
            ));
        }
        (other, _) => {
            return Err(file_fault(
                path,
                "a lens model plumb_bob, rational_polynomial or equidistant in its CameraInfo",
                format!("{other:?}"),
            ));
        }
    };
    CameraFile::of([width, height], [fx, fy, cx, cy], distortion).checked(path)
}
