//! Settings of ORB-SLAM 2 and 3: one file with the camera, the extractor and the viewer.
//!
//! ```yaml
//! %YAML:1.0
//! Camera.type: "PinHole"        # KannalaBrandt8: k1 to k4 of a fisheye; Rectified: no lens
//! Camera.fx: 458.654            # ORB-SLAM 3: Camera1.fx, and Camera2.fx of a second camera
//! Camera.fy: 457.296
//! Camera.cx: 367.215
//! Camera.cy: 248.375
//! Camera.k1: -0.28340811        # missing ones are zero
//! Camera.width: 752             # most files of ORB-SLAM 2 have no size
//! Camera.height: 480
//! ```
//!
//! `Camera.newWidth` is the scaling that ORB-SLAM does itself; the calibration belongs to the images as they are.

use super::file::{CameraFile, lens_from_opencv};
use super::read::Wanted;
use super::yaml::Node;
use crate::error::SequenceError;
use mono_geometry::Distortion;

pub(super) fn recognises(root: &Node<'_>) -> bool {
    root.get_any(&["Camera.fx", "Camera1.fx"]).is_some()
}

pub(super) fn parse(root: &Node<'_>, wanted: &mut Wanted<'_>) -> Result<CameraFile, SequenceError> {
    let present: Vec<String> = ["Camera", "Camera1", "Camera2"]
        .into_iter()
        .filter(|name| root.get(&format!("{name}.fx")).is_some())
        .map(String::from)
        .collect();
    let prefix = wanted.choose(root.path(), &present, None)?;
    let value = |name: &str| root.need(&[&format!("{prefix}.{name}")])?.number();
    let optional = |name: &str| match root.get(&format!("{prefix}.{name}")) {
        Some(node) => node.number(),
        None => Ok(0.0),
    };
    let numbers = [value("fx")?, value("fy")?, value("cx")?, value("cy")?];
    let kind = root.get_any(&[&format!("{prefix}.type"), "Camera.type"]);
    let name = match &kind {
        Some(kind) => kind.text()?,
        None => "PinHole".to_owned(),
    };
    let lens = match (name.to_ascii_lowercase().as_str(), &kind) {
        ("pinhole", _) | (_, None) => lens_from_opencv(&[
            optional("k1")?,
            optional("k2")?,
            optional("p1")?,
            optional("p2")?,
            optional("k3")?,
        ])
        .unwrap_or(Distortion::None),
        ("rectified", _) => Distortion::None,
        ("kannalabrandt8", _) => Distortion::KannalaBrandt {
            k1: value("k1")?,
            k2: value("k2")?,
            k3: value("k3")?,
            k4: value("k4")?,
        },
        (other, Some(kind)) => {
            return Err(kind.fault("PinHole, KannalaBrandt8 or Rectified", other));
        }
    };
    let size = match (root.get("Camera.width"), root.get("Camera.height")) {
        (Some(width), Some(height)) => Some([width.pixels()?, height.pixels()?]),
        _ => None,
    };
    if let Some(new) = root.get_any(&["Camera.newWidth", "Camera.newHeight"]) {
        wanted.note(format!(
            "line {}: the scaling of Camera.newWidth and Camera.newHeight is ORB-SLAM's own; the camera is that of \
             the unscaled images",
            new.line()
        ));
    }
    let size = wanted.size_of(root.path(), size, "the keys Camera.width and Camera.height")?;
    Ok(CameraFile::of(size, numbers, lens))
}
