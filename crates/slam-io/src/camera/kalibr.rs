//! Kalibr's `camchain.yaml`: several cameras by name, each pinhole with radtan, equidistant or no distortion.
//!
//! ```yaml
//! cam0:
//!   camera_model: pinhole
//!   intrinsics: [458.654, 457.296, 367.215, 248.375]   # fu fv pu pv
//!   distortion_model: radtan                            # k1 k2 p1 p2; equidistant: k1 k2 k3 k4; none: nothing
//!   distortion_coeffs: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
//!   resolution: [752, 480]
//! ```
//!
//! Everything else (`T_cam_imu`, `T_cn_cnm1`, `rostopic`, `timeshift_cam_imu`) is ignored. In particular `T_cam_imu` is
//! not our mount: it starts at the IMU. The models `omni`, `eucm`, `ds` and `fov` are refused.

use super::yaml::Node;
use crate::error::SequenceError;
use mono_geometry::Distortion;

use super::file::{CameraFile, file_fault, number, numbers};
use super::read::Wanted;

/// Whether some key holds a camera.
pub(super) fn recognises(root: &Node<'_>) -> bool {
    root.keys().iter().any(|key| is_camera(root, key))
}

fn is_camera(root: &Node<'_>, key: &str) -> bool {
    root.get(key).is_some_and(|camera| {
        camera.get("intrinsics").is_some()
            && (camera.get("camera_model").is_some() || camera.get("resolution").is_some())
    })
}

pub(super) fn parse(root: &Node<'_>, wanted: &mut Wanted<'_>) -> Result<CameraFile, SequenceError> {
    let names: Vec<String> = root
        .keys()
        .into_iter()
        .filter(|key| is_camera(root, key))
        .collect();
    let name = wanted.choose(root.path(), &names, Some("cam0"))?;
    camera(&root.need(&[&name])?, wanted)
}

/// One camera: the mapping that holds its intrinsics. EuRoC's file of a sensor is such a mapping with other names.
pub(super) fn camera(
    camera: &Node<'_>,
    wanted: &mut Wanted<'_>,
) -> Result<CameraFile, SequenceError> {
    if let Some(model) = camera.get("camera_model") {
        match model.text()?.as_str() {
            "pinhole" => {}
            other => return Err(model.fault("pinhole", other)),
        }
    }
    let numbers = camera.need(&["intrinsics"])?.array()?;
    let size = match camera.get("resolution") {
        Some(resolution) => Some(resolution.pixel_pair()?),
        None => None,
    };
    let within = camera.place();
    let size = wanted.size_of(camera.path(), size, &format!("the key resolution{within}"))?;
    Ok(CameraFile::of(size, numbers, lens(camera, wanted)?))
}

fn lens(camera: &Node<'_>, wanted: &mut Wanted<'_>) -> Result<Distortion, SequenceError> {
    let given = camera.get_any(&["distortion_coeffs", "distortion_coefficients"]);
    let coefficients = match &given {
        Some(node) => node.numbers()?,
        None => Vec::new(),
    };
    let zero = coefficients.iter().all(|&value| value == 0.0);
    let Some(model) = camera.get("distortion_model") else {
        if zero {
            wanted.note(format!(
                "no distortion_model{}: taken for a camera without a lens",
                camera.place()
            ));
            return Ok(Distortion::None);
        }
        return Err(file_fault(
            camera.path(),
            format!("the key distortion_model{}", camera.place()),
            "coefficients without it",
        ));
    };
    let fault = |expected: &str| match &given {
        Some(node) => node.fault(expected, coefficients.len().to_string()),
        None => model.fault(expected, "none"),
    };
    match model.text()?.as_str() {
        "none" | "None" | "nothing" | "" => match &given {
            Some(given) if !zero => Err(given.fault("no coefficients", "some")),
            _ => Ok(Distortion::None),
        },
        // Empty lists and a fifth coefficient, k3 as OpenCV has it, are not Kalibr's own but are written by hand.
        "radtan" | "radial-tangential" | "plumb_bob" => match coefficients.as_slice() {
            [] => Ok(Distortion::None),
            &[k1, k2, p1, p2, ref rest @ ..] if rest.len() <= 1 => Ok(Distortion::Radtan {
                k1,
                k2,
                p1,
                p2,
                k3: rest.first().copied().unwrap_or(0.0),
            }),
            _ => Err(fault("4 numbers")),
        },
        "equidistant" | "equi" => match coefficients.as_slice() {
            &[k1, k2, k3, k4] => Ok(Distortion::KannalaBrandt { k1, k2, k3, k4 }),
            _ => Err(fault("4 numbers")),
        },
        other => Err(model.fault("radtan, equidistant or none", other)),
    }
}

pub(super) fn text(camera: &CameraFile) -> Result<String, SequenceError> {
    let refuse = |what: String| {
        Err(SequenceError::NoPlace {
            format: "a Kalibr camchain",
            what,
        })
    };
    let (model, coefficients) = match camera.distortion {
        Distortion::None => ("none", Vec::new()),
        Distortion::Radtan { k3, .. } if k3 != 0.0 => {
            return refuse(format!("k3 = {}", number(k3)));
        }
        Distortion::Radtan { k1, k2, p1, p2, .. } => ("radtan", vec![k1, k2, p1, p2]),
        Distortion::Rational { .. } => return refuse("a rational lens".into()),
        Distortion::KannalaBrandt { k1, k2, k3, k4 } => ("equidistant", vec![k1, k2, k3, k4]),
    };
    Ok(format!(
        "cam0:\n  camera_model: pinhole\n  intrinsics: [{}]\n  distortion_model: {model}\n  \
         distortion_coeffs: [{}]\n  resolution: [{}, {}]\n",
        numbers(&[camera.fx, camera.fy, camera.cx, camera.cy]),
        numbers(&coefficients),
        camera.width,
        camera.height,
    ))
}
