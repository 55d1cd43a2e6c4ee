//! EuRoC's `sensor.yaml` of a camera folder.
//!
//! ```yaml
//! sensor_type: camera
//! camera_model: pinhole
//! intrinsics: [458.654, 457.296, 367.215, 248.375]   # fu, fv, cu, cv
//! distortion_model: radial-tangential                # or equidistant
//! distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
//! resolution: [752, 480]
//! ```
//!
//! `T_BS` places the camera at the recording's body, which is an IMU, not the turning centre of a wheeled robot; it is
//! not read here.

use super::file::CameraFile;
use super::kalibr;
use super::read::Wanted;
use super::yaml::Node;
use crate::error::SequenceError;

pub(super) fn recognises(root: &Node<'_>) -> bool {
    root.get("intrinsics").is_some()
        && (root.get("camera_model").is_some() || root.get("distortion_model").is_some())
}

pub(super) fn parse(root: &Node<'_>, wanted: &mut Wanted<'_>) -> Result<CameraFile, SequenceError> {
    wanted.only_camera(root.path())?;
    kalibr::camera(root, wanted)
}
