//! Which program wrote a text: from its first line and its keys, never from its name.

use std::path::Path;

use super::file::file_fault;
use super::format::CameraFormat;
use super::yaml::{self, Node};
use super::{camodocal, colmap, euroc, kalibr, kitti, opencv, orbslam, read, ros};
use crate::error::SequenceError;
use crate::text::{content_lines, quoted};

const KNOWN: &str =
    "a calibration of camera.toml, Kalibr, OpenCV, ROS, ORB-SLAM, VINS, COLMAP, EuRoC or KITTI";

/// The format of a text.
///
/// # Errors
/// [`SequenceError`] for a text that is none of them, with what it begins with.
pub(super) fn recognise(path: &Path, text: &str) -> Result<CameraFormat, SequenceError> {
    let foreign = |found: String| file_fault(path, KNOWN, found);
    let Some((_, first)) = content_lines(text).next() else {
        return Err(foreign("an empty file".into()));
    };
    if first.starts_with('<') {
        return Ok(CameraFormat::OpenCv);
    }
    if colmap::recognises(first) {
        return Ok(CameraFormat::Colmap);
    }
    if kitti::recognises(text) {
        return Ok(CameraFormat::Kitti);
    }
    if looks_like_toml(text) {
        return Ok(CameraFormat::Toml);
    }
    let yaml_text = yaml::standard_header(text);
    let documents = yaml::load(path, &yaml_text)?;
    let Ok(root) = Node::root(path, &documents) else {
        return Err(foreign(quoted(first)));
    };
    type Recognises = fn(&Node<'_>) -> bool;
    let formats: [(CameraFormat, Recognises); 6] = [
        (CameraFormat::Ros, ros::recognises),
        (CameraFormat::OpenCv, opencv::recognises),
        (CameraFormat::OrbSlam, orbslam::recognises),
        (CameraFormat::Camodocal, camodocal::recognises),
        (CameraFormat::Kalibr, kalibr::recognises),
        (CameraFormat::Euroc, euroc::recognises),
    ];
    for (format, recognises) in formats {
        if recognises(&root) {
            return Ok(format);
        }
    }
    if let Some(other) = root.get_any(&["cam0_calib", "cam1_calib"])
        && let Ok(name) = other.text()
    {
        return Err(foreign(format!(
            "settings of VINS-Fusion, whose camera is in {name}"
        )));
    }
    if root.get_any(&["T1", "R1", "P1"]).is_some() {
        return Err(foreign(
            "the extrinsics of a stereo pair; the cameras are in its intrinsics file".into(),
        ));
    }
    Err(foreign(format!("the keys {}", read::listed(&root.keys()))))
}

/// Whether the first thing is a table or a key with its equals sign, which no other of the formats has.
pub(super) fn looks_like_toml(text: &str) -> bool {
    let Some((_, first)) = content_lines(text).next() else {
        return false;
    };
    let table = first.starts_with('[')
        && first
            .trim_end_matches(|c: char| c.is_whitespace() || c == ']')
            .trim_start_matches('[')
            .chars()
            .all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '.' || c == '-');
    let key = first.split('=').next().filter(|_| first.contains('='));
    table || key.is_some_and(|key| !key.contains([':', '<', '{']))
}
