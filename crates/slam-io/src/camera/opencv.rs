//! OpenCV's `FileStorage` in YAML, as its calibration sample and most users' programs write it.
//!
//! ```yaml
//! %YAML:1.0
//! ---
//! image_width: 640
//! image_height: 480
//! camera_matrix: !!opencv-matrix
//!    rows: 3
//!    cols: 3
//!    dt: d
//!    data: [ 500., 0., 320., 0., 501., 240., 0., 0., 1. ]
//! distortion_coefficients: !!opencv-matrix
//!    rows: 5
//!    cols: 1
//!    dt: d
//!    data: [ -0.28, 0.07, 0., 0., 0. ]
//! ```
//!
//! The same in XML is read too, and what Python programs write of it. Also read: the names `cameraMatrix` / `distCoeffs`, `mtx` / `dist`, `K` / `D`, `M1` / `D1` (and `M2` / `D2`) of a stereo pair, `Camera_Matrix` / `Distortion_Coefficients`, `image_size` or
//! `imageSize` as a list, and the header `%YAML 1.2` of OpenCV 5. Coefficients: 4, 5, 8, 12 or 14; those of a thin
//! prism or a tilted sensor must be zero. With `fisheye_model: 1` (as the calibration sample marks `cv::fisheye`) there
//! are 4, and they are k1 to k4 of the fisheye.

use super::yaml::Node;
use crate::error::SequenceError;
use mono_geometry::Distortion;

use super::file::{CameraFile, lens_from_opencv, number, numbers, opencv_coefficients};
use super::read::Wanted;
use super::skew::drop_skew;

const MATRIX: [&str; 8] = [
    "camera_matrix",
    "cameraMatrix",
    "Camera_Matrix",
    "cam_matrix",
    "intrinsic_matrix",
    "mtx",
    "K",
    "M1",
];
const COEFFICIENTS: [&str; 11] = [
    "distortion_coefficients",
    "distCoeffs",
    "Distortion_Coefficients",
    "distortion",
    "dist_coeffs",
    "dist_coeff",
    "dist_coefs",
    "distCoeff",
    "dist",
    "D",
    "D1",
];
/// Names of the stereo sample: matrix and coefficients of its two cameras.
const STEREO: [(&str, &str, &str); 2] = [("1", "M1", "D1"), ("2", "M2", "D2")];

pub(super) fn recognises(root: &Node<'_>) -> bool {
    root.get_any(&MATRIX).is_some()
}

pub(super) fn parse(root: &Node<'_>, wanted: &mut Wanted<'_>) -> Result<CameraFile, SequenceError> {
    let (matrix, node) = if root.get("M1").is_some() {
        let names: Vec<String> = STEREO
            .iter()
            .filter(|(_, matrix, _)| root.get(matrix).is_some())
            .map(|(name, _, _)| (*name).to_owned())
            .collect();
        let chosen = wanted.choose(root.path(), &names, None)?;
        let (_, matrix, coefficients) = STEREO[usize::from(chosen == "2")];
        (root.need(&[matrix])?, root.need(&[coefficients])?)
    } else {
        wanted.only_camera(root.path())?;
        (root.need(&MATRIX)?, root.need(&COEFFICIENTS)?)
    };
    let [fx, fy, cx, cy, skew] = matrix.camera_matrix()?;
    let size = match root.get_any(&["image_size", "imageSize", "img_size", "size"]) {
        Some(size) => Some(size.pixel_pair()?),
        None => {
            let width = root.get_any(&["image_width", "imageWidth", "image_Width", "width"]);
            let height = root.get_any(&["image_height", "imageHeight", "image_Height", "height"]);
            match (width, height) {
                (Some(width), Some(height)) => Some([width.pixels()?, height.pixels()?]),
                _ => None,
            }
        }
    };
    let size = wanted.size_of(root.path(), size, "the keys image_width and image_height")?;
    let coefficients = node.coefficients()?;
    let fisheye = match root.get("fisheye_model") {
        Some(flag) => !matches!(flag.text()?.as_str(), "0" | "false"),
        None => false,
    };
    let distortion = if fisheye {
        let &[k1, k2, k3, k4] = coefficients.as_slice() else {
            return Err(node.fault("4 fisheye coefficients", coefficients.len().to_string()));
        };
        Distortion::KannalaBrandt { k1, k2, k3, k4 }
    } else {
        lens_from_opencv(&coefficients).map_err(|(expected, found)| node.fault(&expected, found))?
    };
    let camera = CameraFile::of(size, [fx, fy, cx, cy], distortion);
    drop_skew(&matrix, &camera, skew, wanted)?;
    Ok(camera)
}

pub(super) fn text(camera: &CameraFile) -> String {
    let coefficients = opencv_coefficients(&camera.distortion);
    let fisheye = matches!(camera.distortion, Distortion::KannalaBrandt { .. });
    format!(
        "%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\n\
         camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   \
         data: [ {}, 0.0, {}, 0.0, {}, {}, 0.0, 0.0, 1.0 ]\n\
         distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: {}\n   dt: d\n   data: [ {} ]\n\
         fisheye_model: {}\n",
        camera.width,
        camera.height,
        number(camera.fx),
        number(camera.cx),
        number(camera.fy),
        number(camera.cy),
        coefficients.len(),
        numbers(&coefficients),
        u8::from(fisheye),
    )
}
