//! camodocal's camera files, as VINS-Mono and VINS-Fusion use them.
//!
//! ```yaml
//! %YAML:1.0
//! ---
//! model_type: PINHOLE
//! image_width: 752
//! image_height: 480
//! distortion_parameters: {k1: -0.28, k2: 0.07, p1: 0.0002, p2: 0.00002}
//! projection_parameters: {fx: 458.6, fy: 457.3, cx: 367.2, cy: 248.4}
//! ```
//!
//! `KANNALA_BRANDT` has k2, k3, k4, k5, mu, mv, u0, v0 in `projection_parameters`: r = theta + k2 theta^3 + ... + k5
//! theta^9, our k1 to k4. `PINHOLE_FULL` is the rational lens. `MEI` is a pinhole where its mirror parameter xi is
//! zero, and refused otherwise, as `SCARAMUZZA` is.

use super::file::CameraFile;
use super::read::Wanted;
use super::yaml::Node;
use crate::error::SequenceError;
use mono_geometry::Distortion;

pub(super) fn recognises(root: &Node<'_>) -> bool {
    root.get("model_type").is_some() && root.get("projection_parameters").is_some()
}

pub(super) fn parse(root: &Node<'_>, wanted: &mut Wanted<'_>) -> Result<CameraFile, SequenceError> {
    wanted.only_camera(root.path())?;
    let model = root.need(&["model_type"])?;
    let projection = root.need(&["projection_parameters"])?;
    let number = |node: &Node<'_>, name: &str| node.need(&[name])?.number();
    let four = |names: [&str; 4]| -> Result<[f64; 4], SequenceError> {
        Ok([
            number(&projection, names[0])?,
            number(&projection, names[1])?,
            number(&projection, names[2])?,
            number(&projection, names[3])?,
        ])
    };
    let distortion = root.get("distortion_parameters");
    let coefficient = |name: &str| match distortion.as_ref().and_then(|node| node.get(name)) {
        Some(node) => node.number(),
        None => Ok(0.0),
    };
    let radtan = || -> Result<Distortion, SequenceError> {
        Ok(Distortion::Radtan {
            k1: coefficient("k1")?,
            k2: coefficient("k2")?,
            p1: coefficient("p1")?,
            p2: coefficient("p2")?,
            k3: 0.0,
        })
    };
    let (numbers, lens) = match model.text()?.to_ascii_uppercase().as_str() {
        "PINHOLE" => (four(["fx", "fy", "cx", "cy"])?, radtan()?),
        "PINHOLE_FULL" => (
            four(["fx", "fy", "cx", "cy"])?,
            Distortion::Rational {
                k1: coefficient("k1")?,
                k2: coefficient("k2")?,
                p1: coefficient("p1")?,
                p2: coefficient("p2")?,
                k3: coefficient("k3")?,
                k4: coefficient("k4")?,
                k5: coefficient("k5")?,
                k6: coefficient("k6")?,
            },
        ),
        "KANNALA_BRANDT" => (
            four(["mu", "mv", "u0", "v0"])?,
            Distortion::KannalaBrandt {
                k1: number(&projection, "k2")?,
                k2: number(&projection, "k3")?,
                k3: number(&projection, "k4")?,
                k4: number(&projection, "k5")?,
            },
        ),
        "MEI" => {
            let mirror = root
                .get("mirror_parameters")
                .or_else(|| Some(root.clone()))
                .and_then(|node| node.get("xi"));
            let xi = match &mirror {
                Some(node) => node.number()?,
                None => return Err(model.fault("mirror_parameters with xi", "none")),
            };
            if xi != 0.0 {
                return Err(model.fault(
                    "PINHOLE, PINHOLE_FULL or KANNALA_BRANDT",
                    format!("MEI with xi = {xi}, a lens that this program does not have"),
                ));
            }
            (four(["gamma1", "gamma2", "u0", "v0"])?, radtan()?)
        }
        other => {
            return Err(model.fault("PINHOLE, PINHOLE_FULL or KANNALA_BRANDT", other));
        }
    };
    let size = match (root.get("image_width"), root.get("image_height")) {
        (Some(width), Some(height)) => Some([width.pixels()?, height.pixels()?]),
        _ => None,
    };
    let size = wanted.size_of(root.path(), size, "the keys image_width and image_height")?;
    Ok(CameraFile::of(size, numbers, lens))
}
