//! ROS `camera_info` as YAML, the file of `camera_calibration` and `camera_info_manager`.
//!
//! ```yaml
//! image_width: 640
//! image_height: 480
//! camera_name: camera
//! camera_matrix: {rows: 3, cols: 3, data: [500.0, 0.0, 320.0, 0.0, 501.0, 240.0, 0.0, 0.0, 1.0]}
//! distortion_model: plumb_bob
//! distortion_coefficients: {rows: 1, cols: 5, data: [-0.28, 0.07, 0.0, 0.0, 0.0]}
//! rectification_matrix: {rows: 3, cols: 3, data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]}
//! projection_matrix: {rows: 3, cols: 4, data: [...]}
//! ```
//!
//! Models: `plumb_bob` (4 or 5 coefficients), `rational_polynomial` (8, or more of which the rest are zero),
//! `equidistant` (4). Rectification and projection describe the rectified image of a stereo pair; they are ignored, and
//! written as those of a single camera.

use super::yaml::Node;
use crate::error::SequenceError;
use mono_geometry::Distortion;

use super::file::{
    CameraFile, MountFile, SigmaFile, lens_from_opencv, number, numbers, opencv_coefficients,
};

pub(super) fn recognises(root: &Node<'_>) -> bool {
    root.get("camera_matrix").is_some() && root.get("distortion_model").is_some()
}

pub(super) fn parse(root: &Node<'_>) -> Result<CameraFile, SequenceError> {
    let width = root.need(&["image_width"])?.pixels()?;
    let height = root.need(&["image_height"])?.pixels()?;
    let [fx, fy, cx, cy] = root.need(&["camera_matrix"])?.camera_matrix()?;
    let model = root.need(&["distortion_model"])?;
    let node = root.need(&["distortion_coefficients"])?;
    let (_, _, coefficients) = node.matrix()?;
    let count = |needed: &str| node.fault(needed, coefficients.len().to_string());
    let distortion = match (model.text()?.as_str(), coefficients.as_slice()) {
        ("equidistant", &[k1, k2, k3, k4]) => Distortion::KannalaBrandt { k1, k2, k3, k4 },
        ("equidistant", _) => return Err(count("4 coefficients")),
        ("plumb_bob", [_, _, _, _] | [_, _, _, _, _])
        | ("rational_polynomial", [_, _, _, _, _, _, _, _, ..]) => lens_from_opencv(&coefficients)
            .map_err(|(expected, found)| node.fault(&expected, found))?,
        ("plumb_bob", _) => return Err(count("4 or 5 coefficients")),
        ("rational_polynomial", _) => return Err(count("8 coefficients")),
        (other, _) => {
            return Err(model.fault("plumb_bob, rational_polynomial or equidistant", other));
        }
    };
    Ok(CameraFile {
        width,
        height,
        fx,
        fy,
        cx,
        cy,
        distortion,
        mount: MountFile::default(),
        sigma: SigmaFile::default(),
    })
}

pub(super) fn text(camera: &CameraFile) -> String {
    let model = match camera.distortion {
        Distortion::None | Distortion::Radtan { .. } => "plumb_bob",
        Distortion::Rational { .. } => "rational_polynomial",
        Distortion::KannalaBrandt { .. } => "equidistant",
    };
    let coefficients = opencv_coefficients(&camera.distortion);
    let [fx, fy, cx, cy] = [camera.fx, camera.fy, camera.cx, camera.cy].map(number);
    format!(
        "image_width: {}\nimage_height: {}\ncamera_name: camera\n\
         camera_matrix:\n  rows: 3\n  cols: 3\n  data: [{fx}, 0.0, {cx}, 0.0, {fy}, {cy}, 0.0, 0.0, 1.0]\n\
         distortion_model: {model}\n\
         distortion_coefficients:\n  rows: 1\n  cols: {}\n  data: [{}]\n\
         rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n\
         projection_matrix:\n  rows: 3\n  cols: 4\n  \
         data: [{fx}, 0.0, {cx}, 0.0, 0.0, {fy}, {cy}, 0.0, 0.0, 0.0, 1.0, 0.0]\n",
        camera.width,
        camera.height,
        coefficients.len(),
        numbers(&coefficients),
    )
}
