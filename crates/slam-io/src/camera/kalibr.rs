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

use super::file::{CameraFile, MountFile, SigmaFile, file_fault, number, numbers};

/// Whether some key holds a camera.
pub(super) fn recognises(root: &Node<'_>) -> bool {
    let holds = |key: &String| {
        root.get(key).is_some_and(|camera| {
            camera.get("intrinsics").is_some() && camera.get("camera_model").is_some()
        })
    };
    root.keys().iter().any(holds)
}

pub(super) fn parse(root: &Node<'_>, name: &str) -> Result<CameraFile, SequenceError> {
    let Some(camera) = root.get(name) else {
        return Err(file_fault(
            root.path(),
            format!("a camera {name}"),
            root.keys().join(", "),
        ));
    };
    let model = camera.need(&["camera_model"])?;
    match model.text()?.as_str() {
        "pinhole" => {}
        other => return Err(model.fault("pinhole", other)),
    }
    let [fx, fy, cx, cy] = camera.need(&["intrinsics"])?.array()?;
    let resolution = camera.need(&["resolution"])?;
    let [width, height] = resolution.pixel_pair()?;
    let model = camera.need(&["distortion_model"])?;
    let distortion = match model.text()?.as_str() {
        "none" => {
            if let Some(given) = camera.get("distortion_coeffs")
                && !given.numbers()?.iter().all(|&value| value == 0.0)
            {
                return Err(given.fault("no coefficients", "some"));
            }
            Distortion::None
        }
        "radtan" => {
            let [k1, k2, p1, p2] = camera.need(&["distortion_coeffs"])?.array()?;
            Distortion::Radtan {
                k1,
                k2,
                p1,
                p2,
                k3: 0.0,
            }
        }
        "equidistant" => {
            let [k1, k2, k3, k4] = camera.need(&["distortion_coeffs"])?.array()?;
            Distortion::KannalaBrandt { k1, k2, k3, k4 }
        }
        other => return Err(model.fault("radtan, equidistant or none", other)),
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
