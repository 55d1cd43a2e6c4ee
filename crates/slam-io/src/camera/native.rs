//! `camera.toml`: intrinsics, lens distortion and where the camera sits on the body.
//!
//! ```toml
//! width = 320
//! height = 240
//! model = "pinhole"
//! fx = 262.53        # pixels; pixel (0,0) is the centre of the top-left pixel
//! fy = 262.12
//! cx = 154.07
//! cy = 118.02
//!
//! [distortion]       # optional
//! model = "radtan"   # k1 k2 p1 p2 and, optional, k3, in OpenCV's order
//! k1 = 0.11          # or "rational" with k1 k2 p1 p2 k3 k4 k5 k6, all of them
//! k2 = -0.21         # or "kannala-brandt" with k1 k2 k3 k4
//! p1 = 0.0
//! p2 = 0.0
//!
//! [mount]            # optional; without it the camera looks along body x
//! position_in_body = [0.0, 0.0, 0.1]
//! rotation_body_from_camera = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
//!
//! [sigma]            # optional: standard deviations, any of fx fy cx cy k1 mount_yaw lever_x lever_y
//! fx = 0.9
//! ```
//!
//! Body axes: x forward, y left, z up. Camera axes: x right, y down, z forward. The
//! columns of the rotation are the camera's axes in body axes. A rotation written with
//! few digits is accepted within [`ROTATION_TOLERANCE`] and replaced by the nearest
//! orthonormal matrix.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::Matrix3;
use serde::Deserialize;

use crate::error::SequenceError;
use crate::text::line_fault;
use crate::toml_fault::{line_of_key, syntax_fault};
use mono_geometry::Distortion;

use super::file::{CameraFile, MountFile, SigmaFile, file_fault, number, numbers};

/// Largest believed deviation of `R^T R` from the identity, entry by entry: four written decimals.
const ROTATION_TOLERANCE: f64 = 1e-3;
/// A camera further from the centre of its robot along an axis is given in another unit, metres.
const MOST_LEVER_M: f64 = 50.0;

/// Checks the text of a camera file.
pub(super) fn parse(path: &Path, text: &str) -> Result<CameraFile, SequenceError> {
    let raw: RawCamera = ::toml::from_str(text)
        .map_err(|error| syntax_fault("a camera.toml", text, &error).of_file(path))?;
    // A fault names its key last; the line is where that stands.
    let fault = |(expected, found): Fault| match line_named(text, &expected, &found) {
        Some(line) => line_fault(path, line, expected, found),
        None => file_fault(path, expected, found),
    };
    if raw.model != "pinhole" {
        return Err(fault((
            "model = \"pinhole\"".into(),
            format!("{:?}", raw.model),
        )));
    }
    let camera = CameraFile {
        width: raw.width,
        height: raw.height,
        fx: raw.fx,
        fy: raw.fy,
        cx: raw.cx,
        cy: raw.cy,
        distortion: Distortion::None,
        mount: MountFile::default(),
        sigma: SigmaFile::default(),
    }
    .checked(path)?;
    for (name, value) in raw.sigma.known() {
        if !(value.is_finite() && value >= 0.0) {
            return Err(fault((
                format!("a finite {name} of at least 0 in [sigma]"),
                value.to_string(),
            )));
        }
    }
    Ok(CameraFile {
        distortion: match &raw.distortion {
            None => Distortion::None,
            Some(distortion) => checked_distortion(distortion).map_err(fault)?,
        },
        mount: match &raw.mount {
            None => MountFile::default(),
            Some(mount) => checked_mount(mount).map_err(fault)?,
        },
        sigma: raw.sigma,
        ..camera
    })
}

/// The text of a camera file.
pub(super) fn text(camera: &CameraFile) -> String {
    let mut text = format!(
        "width = {}\nheight = {}\nmodel = \"pinhole\"\n",
        camera.width, camera.height
    );
    let mut line = |name: &str, value: f64| {
        // Writing into a String cannot fail.
        let _ = writeln!(text, "{name} = {}", number(value));
    };
    for (name, value) in [
        ("fx", camera.fx),
        ("fy", camera.fy),
        ("cx", camera.cx),
        ("cy", camera.cy),
    ] {
        line(name, value);
    }
    let (model, names): (&str, &[&str]) = match camera.distortion {
        Distortion::None => ("", &[]),
        Distortion::Radtan { .. } => ("radtan", &["k1", "k2", "p1", "p2", "k3"]),
        Distortion::Rational { .. } => (
            "rational",
            &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"],
        ),
        Distortion::KannalaBrandt { .. } => ("kannala-brandt", &["k1", "k2", "k3", "k4"]),
    };
    if !names.is_empty() {
        let _ = writeln!(text, "\n[distortion]\nmodel = \"{model}\"");
        for (name, value) in names.iter().zip(camera.distortion.parameters()) {
            let _ = writeln!(text, "{name} = {}", number(value));
        }
    }
    if camera.mount != MountFile::default() {
        let rows = camera.mount.rotation_body_from_camera;
        let _ = writeln!(
            text,
            "\n[mount]\nposition_in_body = [{}]\nrotation_body_from_camera = [[{}], [{}], [{}]]",
            numbers(&camera.mount.position_in_body),
            numbers(&rows[0]),
            numbers(&rows[1]),
            numbers(&rows[2]),
        );
    }
    let mut known = camera.sigma.known().peekable();
    if known.peek().is_some() {
        text.push_str("\n[sigma]\n");
    }
    for (name, value) in known {
        let _ = writeln!(text, "{name} = {}", number(value));
    }
    text
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCamera {
    width: u32,
    height: u32,
    model: String,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    distortion: Option<RawDistortion>,
    mount: Option<RawMount>,
    #[serde(default)]
    sigma: SigmaFile,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawDistortion {
    model: String,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    k5: Option<f64>,
    k6: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMount {
    position_in_body: [f64; 3],
    rotation_body_from_camera: [[f64; 3]; 3],
}

/// (expected, found).
type Fault = (String, String);

/// The line of the key that a fault speaks of: the word before "in [section]", or the model.
fn line_named(text: &str, expected: &str, found: &str) -> Option<u64> {
    if let Some(section) = expected.split_once(" as model of [") {
        return line_of_key(text, Some(section.1.trim_end_matches(']')), "model");
    }
    if expected.starts_with("model = ") {
        return line_of_key(text, None, "model");
    }
    let (before, after) = expected.split_once(" in [")?;
    let section = after.split(']').next();
    // A key that is missing has no line.
    (found != "none")
        .then(|| line_of_key(text, section, before.split_whitespace().last()?))
        .flatten()
}

fn checked_distortion(raw: &RawDistortion) -> Result<Distortion, Fault> {
    let need = |name: &str, value: Option<f64>| match value {
        Some(value) if value.is_finite() => Ok(value),
        Some(value) => Err((
            format!("a finite {name} in [distortion]"),
            value.to_string(),
        )),
        None => Err((
            format!("{name} in [distortion] for model {:?}", raw.model),
            "none".to_string(),
        )),
    };
    let refuse = |name: &str, value: Option<f64>| match value {
        None => Ok(()),
        Some(value) => Err((
            format!("no {name} in [distortion] for model {:?}", raw.model),
            format!("{name} = {value}"),
        )),
    };
    match raw.model.as_str() {
        "radtan" => {
            for (name, value) in [("k4", raw.k4), ("k5", raw.k5), ("k6", raw.k6)] {
                refuse(name, value)?;
            }
            Ok(Distortion::Radtan {
                k1: need("k1", raw.k1)?,
                k2: need("k2", raw.k2)?,
                p1: need("p1", raw.p1)?,
                p2: need("p2", raw.p2)?,
                k3: need("k3", Some(raw.k3.unwrap_or(0.0)))?,
            })
        }
        "rational" => Ok(Distortion::Rational {
            k1: need("k1", raw.k1)?,
            k2: need("k2", raw.k2)?,
            p1: need("p1", raw.p1)?,
            p2: need("p2", raw.p2)?,
            k3: need("k3", raw.k3)?,
            k4: need("k4", raw.k4)?,
            k5: need("k5", raw.k5)?,
            k6: need("k6", raw.k6)?,
        }),
        "kannala-brandt" => {
            let others = [
                ("p1", raw.p1),
                ("p2", raw.p2),
                ("k5", raw.k5),
                ("k6", raw.k6),
            ];
            for (name, value) in others {
                refuse(name, value)?;
            }
            Ok(Distortion::KannalaBrandt {
                k1: need("k1", raw.k1)?,
                k2: need("k2", raw.k2)?,
                k3: need("k3", raw.k3)?,
                k4: need("k4", raw.k4)?,
            })
        }
        other => {
            let here = match other {
                "plumb_bob" | "brown_conrady" | "opencv" | "radial-tangential" => Some("radtan"),
                "rational_polynomial" => Some("rational"),
                "equidistant" | "fisheye" | "kb4" => Some("kannala-brandt"),
                _ => None,
            };
            Err((
                "\"radtan\", \"rational\" or \"kannala-brandt\" as model of [distortion]".into(),
                match here {
                    Some(here) => format!("{other:?}, which is called \"{here}\" here"),
                    None => format!("{other:?}"),
                },
            ))
        }
    }
}

fn checked_mount(raw: &RawMount) -> Result<MountFile, Fault> {
    if raw.position_in_body.iter().any(|value| !value.is_finite()) {
        return Err((
            "a finite position_in_body in [mount]".into(),
            format!("{:?}", raw.position_in_body),
        ));
    }
    if let Some(far) = raw
        .position_in_body
        .iter()
        .find(|value| value.abs() > MOST_LEVER_M)
    {
        return Err((
            format!(
                "metres within {MOST_LEVER_M} of the robot's centre as position_in_body in [mount]"
            ),
            format!("{far}: are these millimetres?"),
        ));
    }
    let rows = raw.rotation_body_from_camera;
    let mut rotation = Matrix3::from_fn(|row, column| rows[row][column]);
    let deviation = (rotation.transpose() * rotation - Matrix3::identity()).abs();
    // Written so that a NaN fails.
    let orthonormal = deviation.iter().all(|&entry| entry <= ROTATION_TOLERANCE);
    if !orthonormal {
        return Err((
            format!(
                "orthonormal columns, within {ROTATION_TOLERANCE}, of the rotation_body_from_camera in [mount]"
            ),
            format!("a deviation of {}", deviation.max()),
        ));
    }
    if rotation.determinant() <= 0.0 {
        return Err((
            "a right-handed rotation_body_from_camera in [mount] (determinant +1)".into(),
            format!("a determinant of {}", rotation.determinant()),
        ));
    }
    // Newton's iteration for the orthonormal polar factor: quadratic, and exact for exact rotations.
    for _ in 0..4 {
        rotation = rotation * (Matrix3::identity() * 3.0 - rotation.transpose() * rotation) * 0.5;
    }
    Ok(MountFile {
        position_in_body: raw.position_in_body,
        rotation_body_from_camera: std::array::from_fn(|row| {
            std::array::from_fn(|column| rotation[(row, column)])
        }),
    })
}
