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
//! Also read: the names `cameraMatrix` / `distCoeffs`, `Camera_Matrix` / `Distortion_Coefficients`, `image_size` or
//! `imageSize` as a list, and the header `%YAML 1.2` of OpenCV 5. Coefficients: 4, 5, 8, 12 or 14; those of a thin
//! prism or a tilted sensor must be zero. With `fisheye_model: 1` (as the calibration sample marks `cv::fisheye`) there
//! are 4, and they are k1 to k4 of the fisheye.

use super::yaml::Node;
use crate::error::SequenceError;
use mono_geometry::Distortion;

use super::file::{
    CameraFile, MountFile, SigmaFile, lens_from_opencv, number, numbers, opencv_coefficients,
};

const MATRIX: [&str; 3] = ["camera_matrix", "cameraMatrix", "Camera_Matrix"];
const COEFFICIENTS: [&str; 3] = [
    "distortion_coefficients",
    "distCoeffs",
    "Distortion_Coefficients",
];

pub(super) fn recognises(root: &Node<'_>) -> bool {
    root.get_any(&MATRIX).is_some()
}

pub(super) fn parse(root: &Node<'_>) -> Result<CameraFile, SequenceError> {
    let [fx, fy, cx, cy] = root.need(&MATRIX)?.camera_matrix()?;
    let [width, height] = match root.get_any(&["image_size", "imageSize"]) {
        Some(size) => size.pixel_pair()?,
        None => [
            root.need(&["image_width", "imageWidth", "image_Width"])?
                .pixels()?,
            root.need(&["image_height", "imageHeight", "image_Height"])?
                .pixels()?,
        ],
    };
    let node = root.need(&COEFFICIENTS)?;
    let (rows, columns, coefficients) = node.matrix()?;
    if rows != 1 && columns != 1 {
        return Err(node.fault("one row or one column", format!("{rows} x {columns}")));
    }
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
