//! TUM RGB-D: `rgb.txt` with a stamp and a file a line, `rgb/`, `groundtruth.txt` of the colour camera.
//!
//! Source: J. Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", IROS 2012. The depth images are not
//! used. The folders hold neither calibration nor odometry: a `camera.toml` and an `odometry.csv` beside `rgb.txt` are
//! taken, and a calibration may be named.

use std::path::Path;

use super::calibrations::{Camera, given_camera, no_camera};
use super::folder::survey_of;
use super::frames::{frames_of, no_frames};
use super::options::{OpenOptions, SequenceFormat};
use super::reference::read_reference;
use super::survey::Survey;
use crate::images::listed_images;

/// File name of the list.
pub(super) const LIST: &str = "rgb.txt";

/// Looks at the folder.
pub(super) fn survey(root: &Path, options: &OpenOptions) -> Survey {
    let mut warnings = Vec::new();
    let list = root.join(LIST);
    let frames = match listed_images(&root.join("rgb")) {
        Ok(files) => frames_of(files, &list, &mut warnings),
        Err(fault) => no_frames(fault, &list),
    };
    let first_s = frames.first_s();
    let camera = given_camera(root, options, frames.size(), &mut warnings).unwrap_or_else(|| {
        let example = " (of freiburg1 for instance ORB-SLAM's TUM1.yaml)";
        Camera::of_layout(Err(no_camera(root, example)), "camera.toml")
    });
    let reference = read_reference(root, &camera.mount(), first_s);
    survey_of(
        root,
        SequenceFormat::TumRgbd,
        frames,
        camera,
        reference,
        options,
        warnings,
    )
}
