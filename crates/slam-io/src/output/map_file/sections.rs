//! The sections of a map: records of fixed size, one after the other behind their number.

use mono_geometry::{Camera, Distortion, Pinhole, Se2, Se3};
use nalgebra::Rotation3;
use slam_pipeline::{KnownErrors, KnownKeyframe, KnownLandmark, KnownMap, MapLandmark};

use super::bytes::{Bytes, Fault, put_f64, put_matrix, put_u32};
use super::checks;

/// A landmark without its descriptor: id, observations, position, covariance, where the descriptor is.
const LANDMARK_BYTES: usize = 4 + 4 + 24 + 72 + 1;
/// Rotation, translation, body, covariance.
const KEYFRAME_BYTES: usize = 72 + 24 + 24 + 72;
/// Id, anchor, observations, parameters, covariance, existence, direction, descriptor.
const ANCHORED_BYTES: usize = 12 + 24 + 72 + 8 + 24 + DESCRIPTOR_BYTES;
const DESCRIPTOR_BYTES: usize = 128;

/// Where the descriptor of a landmark is.
const NOWHERE: u8 = 0;
const HERE: u8 = 1;
const ANCHORED: u8 = 2;

/// The landmarks as points; descriptors that `known` has are not written twice.
pub(super) fn landmarks(landmarks: &[MapLandmark], known: Option<&KnownMap>) -> Vec<u8> {
    let anchored = known.map_or(&[][..], |map| &map.landmarks);
    let mut bytes = Vec::with_capacity(4 + landmarks.len() * LANDMARK_BYTES);
    // Ids are u32 and unique, so the count fits.
    put_u32(&mut bytes, landmarks.len() as u32);
    for landmark in landmarks {
        put_u32(&mut bytes, landmark.id);
        put_u32(&mut bytes, landmark.observations);
        put_f64(&mut bytes, landmark.position.iter());
        put_matrix(&mut bytes, &landmark.covariance);
        match &landmark.descriptor {
            None => bytes.push(NOWHERE),
            Some(own) if of(anchored, landmark.id).is_some_and(|a| a.descriptor == **own) => {
                bytes.push(ANCHORED);
            }
            Some(own) => {
                bytes.push(HERE);
                bytes.extend_from_slice(own.as_slice());
            }
        }
    }
    bytes
}

/// The landmarks as points; descriptors that are not here are those of `anchored`.
pub(super) fn read_landmarks(
    rest: &mut Bytes<'_>,
    anchored: &[KnownLandmark],
) -> Result<Vec<MapLandmark>, Fault> {
    let count = rest.count("landmarks", LANDMARK_BYTES)?;
    let mut landmarks: Vec<MapLandmark> = Vec::with_capacity(count);
    for _ in 0..count {
        let id = rest.u32()?;
        checks::ascending(landmarks.last().map(|l| l.id), id)?;
        let name = format!("landmark {id}");
        let observations = rest.u32()?;
        let position = rest.vector(&name)?;
        let covariance = rest.matrix(&name)?;
        checks::covariance(&covariance, &name)?;
        let descriptor = match rest.take::<1>()? {
            [NOWHERE] => None,
            [HERE] => Some(Box::new(rest.take::<DESCRIPTOR_BYTES>()?)),
            [ANCHORED] => match of(anchored, id) {
                Some(landmark) => Some(Box::new(landmark.descriptor)),
                None => {
                    return Err(Fault::new(
                        format!("{name} among the anchored landmarks"),
                        "none there",
                    ));
                }
            },
            [other] => {
                return Err(Fault::new(
                    format!("0, 1 or 2 before the descriptor of {name}"),
                    other.to_string(),
                ));
            }
        };
        landmarks.push(MapLandmark {
            id,
            position,
            covariance,
            observations,
            descriptor,
        });
    }
    Ok(landmarks)
}

fn of(anchored: &[KnownLandmark], id: u32) -> Option<&KnownLandmark> {
    let index = anchored.binary_search_by_key(&id, |l| l.id).ok()?;
    anchored.get(index)
}

/// Image size, intrinsics, number of the lens model, its coefficients.
pub(super) fn camera(camera: &Camera) -> Vec<u8> {
    let pinhole = camera.pinhole();
    let coefficients = camera.distortion().parameters();
    let model: u32 = match camera.distortion() {
        Distortion::None => 0,
        Distortion::Radtan { .. } => 1,
        Distortion::Rational { .. } => 2,
        Distortion::KannalaBrandt { .. } => 3,
    };
    let mut bytes = Vec::new();
    // A side of an image has far fewer than 2^32 pixels.
    put_u32(&mut bytes, pinhole.width as u32);
    put_u32(&mut bytes, pinhole.height as u32);
    put_f64(
        &mut bytes,
        &[pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy],
    );
    put_u32(&mut bytes, model);
    put_u32(&mut bytes, coefficients.len() as u32);
    put_f64(&mut bytes, &coefficients);
    bytes
}

/// The camera.
pub(super) fn read_camera(rest: &mut Bytes<'_>) -> Result<Camera, Fault> {
    let (width, height) = (rest.u32()? as usize, rest.u32()? as usize);
    let intrinsic = "an intrinsic of the camera";
    let pinhole = Pinhole {
        width,
        height,
        fx: rest.f64(intrinsic)?,
        fy: rest.f64(intrinsic)?,
        cx: rest.f64(intrinsic)?,
        cy: rest.f64(intrinsic)?,
    };
    let zero = 0.0;
    let lens = match rest.u32()? {
        0 => Distortion::None,
        1 => Distortion::Radtan {
            k1: zero,
            k2: zero,
            p1: zero,
            p2: zero,
            k3: zero,
        },
        2 => Distortion::Rational {
            k1: zero,
            k2: zero,
            p1: zero,
            p2: zero,
            k3: zero,
            k4: zero,
            k5: zero,
            k6: zero,
        },
        3 => Distortion::KannalaBrandt {
            k1: zero,
            k2: zero,
            k3: zero,
            k4: zero,
        },
        other => {
            return Err(Fault::new(
                "lens model 0, 1, 2 or 3 of the camera",
                other.to_string(),
            ));
        }
    };
    let count = rest.count("coefficients of the lens", 8)?;
    let coefficients = (0..count)
        .map(|_| rest.f64("a coefficient of the lens"))
        .collect::<Result<Vec<_>, _>>()?;
    lens.with_parameters(&coefficients)
        .and_then(|lens| Camera::new(pinhole, lens))
        .map_err(|error| Fault::new("a camera", error.to_string()))
}

/// Keyframes in the order of their times.
pub(super) fn keyframes(keyframes: &[KnownKeyframe]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(4 + keyframes.len() * KEYFRAME_BYTES);
    put_u32(&mut bytes, keyframes.len() as u32);
    for keyframe in keyframes {
        put_matrix(&mut bytes, keyframe.world_from_camera.rotation.matrix());
        put_f64(&mut bytes, keyframe.world_from_camera.translation.iter());
        let body = &keyframe.body;
        put_f64(&mut bytes, &[body.x, body.y, body.phi]);
        put_matrix(&mut bytes, &keyframe.covariance);
    }
    bytes
}

/// The keyframes.
pub(super) fn read_keyframes(rest: &mut Bytes<'_>) -> Result<Vec<KnownKeyframe>, Fault> {
    let count = rest.count("keyframes", KEYFRAME_BYTES)?;
    let mut keyframes = Vec::with_capacity(count);
    for index in 0..count {
        let name = format!("keyframe {index}");
        let rotation = rest.matrix(&name)?;
        checks::rotation(&rotation, &name)?;
        let translation = rest.vector(&name)?;
        let body = rest.vector(&name)?;
        let covariance = rest.matrix(&name)?;
        checks::covariance(&covariance, &name)?;
        keyframes.push(KnownKeyframe {
            world_from_camera: Se3 {
                rotation: Rotation3::from_matrix_unchecked(rotation),
                translation,
            },
            body: Se2 {
                x: body.x,
                y: body.y,
                phi: body.z,
            },
            covariance,
        });
    }
    Ok(keyframes)
}

/// The joint covariance of the errors of some keyframes.
pub(super) fn errors(errors: &KnownErrors) -> Vec<u8> {
    let mut bytes = Vec::new();
    put_u32(&mut bytes, errors.keyframes.len() as u32);
    for keyframe in &errors.keyframes {
        put_u32(&mut bytes, *keyframe);
    }
    for block in errors.rows.iter().flatten() {
        put_matrix(&mut bytes, block);
    }
    bytes
}

/// The errors of keyframes.
pub(super) fn read_errors(rest: &mut Bytes<'_>) -> Result<KnownErrors, Fault> {
    let count = rest.count("keyframes with errors", 4)?;
    let keyframes = (0..count)
        .map(|_| rest.u32())
        .collect::<Result<Vec<_>, _>>()?;
    let blocks = count * (count + 1) / 2;
    if rest.left() / 72 < blocks {
        return Err(Fault::new(
            format!("{blocks} covariances of the errors of {count} keyframes"),
            format!("{} bytes left for them", rest.left()),
        ));
    }
    let rows = (0..count)
        .map(|row| {
            let name = format!("the error of keyframe {}", keyframes[row]);
            (0..=row).map(|_| rest.matrix(&name)).collect()
        })
        .collect::<Result<_, _>>()?;
    Ok(KnownErrors { keyframes, rows })
}

/// Landmarks in the cameras of their anchors.
pub(super) fn anchored(landmarks: &[KnownLandmark]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(4 + landmarks.len() * ANCHORED_BYTES);
    put_u32(&mut bytes, landmarks.len() as u32);
    for landmark in landmarks {
        put_u32(&mut bytes, landmark.id);
        put_u32(&mut bytes, landmark.anchor);
        put_u32(&mut bytes, landmark.observations);
        put_f64(&mut bytes, landmark.parameters.iter());
        put_matrix(&mut bytes, &landmark.covariance);
        put_f64(&mut bytes, &[landmark.existence]);
        put_f64(&mut bytes, landmark.last_direction.iter());
        bytes.extend_from_slice(&landmark.descriptor);
    }
    bytes
}

/// The landmarks in the cameras of their anchors.
pub(super) fn read_anchored(rest: &mut Bytes<'_>) -> Result<Vec<KnownLandmark>, Fault> {
    let count = rest.count("anchored landmarks", ANCHORED_BYTES)?;
    let mut landmarks: Vec<KnownLandmark> = Vec::with_capacity(count);
    for _ in 0..count {
        let id = rest.u32()?;
        checks::ascending(landmarks.last().map(|l| l.id), id)?;
        let name = format!("anchored landmark {id}");
        let landmark = KnownLandmark {
            id,
            anchor: rest.u32()?,
            observations: rest.u32()?,
            parameters: rest.vector(&name)?,
            covariance: rest.matrix(&name)?,
            existence: rest.f64(&name)?,
            last_direction: rest.vector(&name)?,
            descriptor: rest.take()?,
        };
        checks::covariance(&landmark.covariance, &name)?;
        landmarks.push(landmark);
    }
    Ok(landmarks)
}
