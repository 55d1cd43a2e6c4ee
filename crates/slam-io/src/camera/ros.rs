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
//! The message itself is read too, as `ros2 topic echo` (`k`, `d`) and `rostopic echo` (`K`, `D`) print it. Melodic's
//! calibrator writes a fisheye as `camera_model: fisheye` without a `distortion_model`.
//!
//! Models: `plumb_bob` (4 or 5 coefficients), `rational_polynomial` (8, or more of which the rest are zero),
//! `equidistant` (4). Rectification and projection describe the rectified image of a stereo pair; they are ignored, and
//! written as those of a single camera.

use super::yaml::Node;
use crate::error::SequenceError;
use mono_geometry::Distortion;

use super::file::{CameraFile, lens_from_opencv, number, numbers, opencv_coefficients};
use super::read::Wanted;
use super::skew::drop_skew;

pub(super) fn recognises(root: &Node<'_>) -> bool {
    let file = root.get("camera_matrix").is_some()
        && ["distortion_model", "camera_model", "rectification_matrix"]
            .iter()
            .any(|key| root.get(key).is_some());
    file || is_message(root)
}

/// Whether these are the keys of the message `sensor_msgs/CameraInfo`.
fn is_message(root: &Node<'_>) -> bool {
    root.get_any(&["k", "K"]).is_some()
        && root.get_any(&["d", "D"]).is_some()
        && root.get("distortion_model").is_some()
}

pub(super) fn parse(root: &Node<'_>, wanted: &mut Wanted<'_>) -> Result<CameraFile, SequenceError> {
    wanted.only_camera(root.path())?;
    let message = is_message(root) && root.get("camera_matrix").is_none();
    let (sides, matrix, coefficients) = if message {
        (["width", "height"], ["k", "K"], ["d", "D"])
    } else {
        (
            ["image_width", "image_height"],
            ["camera_matrix"; 2],
            ["distortion_coefficients"; 2],
        )
    };
    let matrix = root.need(&matrix)?;
    let [fx, fy, cx, cy, skew] = matrix.camera_matrix()?;
    let size = match (root.get(sides[0]), root.get(sides[1])) {
        (Some(width), Some(height)) => Some([width.pixels()?, height.pixels()?]),
        _ => None,
    };
    let missing = format!("the keys {} and {}", sides[0], sides[1]);
    let size = wanted.size_of(root.path(), size, &missing)?;
    let node = root.need(&coefficients)?;
    let coefficients = node.coefficients()?;
    let model = root.get_any(&["distortion_model", "camera_model"]);
    let name = match &model {
        Some(model) => model.text()?,
        None => String::new(),
    };
    // Melodic's calibrator writes the fisheye as camera_model.
    let fisheye = match root.get("camera_model") {
        Some(camera) => camera.text()? == "fisheye",
        None => false,
    };
    if name.is_empty() && !coefficients.is_empty() && !fisheye {
        wanted.note(format!(
            "no distortion_model: {} coefficients are taken as plumb_bob, as ROS does",
            coefficients.len()
        ));
    }
    let name = if fisheye { "fisheye" } else { name.as_str() };
    let distortion = lens(name, &coefficients).map_err(|(of, expected, found)| match of {
        Part::Coefficients => node.fault(&expected, found),
        Part::Model => model.as_ref().unwrap_or(&node).fault(&expected, found),
    })?;
    for key in ["binning_x", "binning_y"] {
        if let Some(binning) = root.get(key)
            && binning.number()? > 1.0
        {
            wanted.note(format!(
                "line {}: {key} is {}: the images are smaller than the {}x{} pixels of this calibration",
                binning.line(),
                binning.number()?,
                size[0],
                size[1]
            ));
        }
    }
    let camera = CameraFile::of(size, [fx, fy, cx, cy], distortion);
    drop_skew(&matrix, &camera, skew, wanted)?;
    Ok(camera)
}

/// The part of a message that a fault of the lens belongs to.
pub(crate) enum Part {
    /// The name of the model.
    Model,
    /// The coefficients.
    Coefficients,
}

/// The lens of a model's name and its coefficients, as `sensor_msgs/CameraInfo` has them.
///
/// # Errors
/// The part that is wrong, what was expected and what was found.
pub(crate) fn lens(
    model: &str,
    coefficients: &[f64],
) -> Result<Distortion, (Part, String, String)> {
    let count = |needed: &str| {
        Err((
            Part::Coefficients,
            needed.to_owned(),
            coefficients.len().to_string(),
        ))
    };
    match (model, coefficients) {
        ("equidistant" | "fisheye", &[k1, k2, k3, k4]) => {
            Ok(Distortion::KannalaBrandt { k1, k2, k3, k4 })
        }
        ("equidistant" | "fisheye", _) => count("4 coefficients"),
        ("" | "none" | "plumb_bob" | "radtan" | "pinhole" | "rational_polynomial", []) => {
            Ok(Distortion::None)
        }
        ("none", given) if given.iter().all(|&value| value == 0.0) => Ok(Distortion::None),
        ("" | "plumb_bob" | "radtan" | "pinhole", [_, _, _, _] | [_, _, _, _, _])
        | ("rational_polynomial", [_, _, _, _, _, _, _, _, ..]) => lens_from_opencv(coefficients)
            .map_err(|(expected, found)| (Part::Coefficients, expected, found)),
        ("" | "plumb_bob" | "radtan" | "pinhole", _) => count("4 or 5 coefficients"),
        ("rational_polynomial", _) => count("8 coefficients"),
        (other, _) => Err((
            Part::Model,
            "plumb_bob, rational_polynomial or equidistant".to_owned(),
            other.to_owned(),
        )),
    }
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
