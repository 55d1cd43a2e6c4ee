//! The mount of the camera from the static transforms of a log.
//!
//! `/tf_static` holds the frames of a robot as a tree: each has a parent and its pose there. The mount is the pose of the
//! image's optical frame in the frame of the body, by way of their common ancestor. The body is the frame that the odometry
//! names, otherwise `base_link` or `base_footprint`. Where `/tf_static` does not connect them, transforms on `/tf` that never
//! change count too.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion};
use robot_logs::{Message, MessageKind, RobotLog, TransformStamped};

use crate::camera::MountFile;
use crate::error::SequenceError;
use crate::warning::Warning;

/// Names of the body where the odometry has none.
const BODIES: [&str; 2] = ["base_link", "base_footprint"];
/// Longest believed chain of frames.
const LONGEST_CHAIN: usize = 64;
/// Height of the optical axis above which a frame not called optical is taken for one whose x axis looks forwards.
const UPWARDS: f64 = 0.9;
/// Largest change of a transform that still is none, metres and parts of a rotation.
const UNCHANGED: f64 = 1e-9;

/// Whether a calibration file states a mount itself.
pub(super) fn stated_in(file: &Path) -> bool {
    std::fs::read_to_string(file).is_ok_and(|text| {
        text.lines()
            .any(|line| line.trim_start().starts_with("[mount]"))
    })
}

/// A frame's parent and its pose there.
type Frames = BTreeMap<String, (String, Isometry3<f64>)>;

/// The mount, or half a sentence on why the log does not tell it.
///
/// # Errors
/// [`SequenceError`] when a message of the transforms cannot be read.
pub(super) fn of_log(
    log: &RobotLog,
    body: Option<&str>,
    optical: &str,
    warnings: &mut Vec<Warning>,
) -> Result<Result<MountFile, String>, SequenceError> {
    let optical = plain(optical);
    let bodies: Vec<&str> = body.map(plain).into_iter().chain(BODIES).collect();
    let topics = |fixed: bool| -> Vec<usize> {
        (0..log.topics().len())
            .filter(|&index| {
                let topic = &log.topics()[index];
                topic.kind == Some(MessageKind::Transforms)
                    && topic.name.ends_with("tf_static") == fixed
            })
            .collect()
    };
    let mut frames = Frames::new();
    for handle in log.handles(&topics(true)) {
        for one in transforms(log.message(&handle)?) {
            frames.insert(plain(&one.child_frame_id).to_string(), placed(&one));
        }
    }
    let mut found = chain(&frames, &bodies, optical);
    if found.is_none() {
        let mut moving: BTreeMap<String, bool> = BTreeMap::new();
        for handle in log.handles(&topics(false)) {
            for one in transforms(log.message(&handle)?) {
                let child = plain(&one.child_frame_id).to_string();
                let place = placed(&one);
                match frames.get(&child) {
                    Some(known) if !same(known, &place) => {
                        moving.insert(child, true);
                    }
                    Some(_) => {}
                    None => {
                        frames.insert(child, place);
                    }
                }
            }
        }
        frames.retain(|child, _| !moving.contains_key(child));
        found = chain(&frames, &bodies, optical);
    }
    let Some((body, body_from_camera)) = found else {
        return Ok(Err(if frames.is_empty() {
            "The log has no /tf_static".into()
        } else {
            format!(
                "The transforms of the log do not lead from {} to the images' frame {optical:?}",
                bodies[0]
            )
        }));
    };
    let mut rotation = body_from_camera.rotation.to_rotation_matrix().into_inner();
    if rotation[(2, 2)].abs() > UPWARDS && !optical.contains("optical") {
        warnings.push(Warning::new(
            "frame-not-optical",
            format!(
                "The images' frame {optical:?} looks up from {body} if its z axis is the optical one: it is taken for a \
                 frame whose x axis looks forwards, as simulators name it; a [mount] in a file given with --camera decides."
            ),
        ));
        // Camera x is the frame's -y, camera y its -z, camera z its x.
        rotation *= Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
    }
    Ok(Ok(MountFile {
        position_in_body: body_from_camera.translation.vector.into(),
        rotation_body_from_camera: std::array::from_fn(|i| {
            std::array::from_fn(|j| rounded(rotation[(i, j)]))
        }),
    }))
}

/// The first body that is connected with the optical frame, and the optical frame's pose in it.
fn chain<'a>(
    frames: &Frames,
    bodies: &[&'a str],
    optical: &str,
) -> Option<(&'a str, Isometry3<f64>)> {
    bodies.iter().find_map(|&body| {
        let of_optical = ancestors(frames, optical);
        let of_body = ancestors(frames, body);
        let known = |name: &str| {
            frames.contains_key(name) || frames.values().any(|(parent, _)| parent == name)
        };
        if !known(body) || !known(optical) {
            return None;
        }
        of_body.iter().find_map(|(name, ancestor_from_body)| {
            let (_, ancestor_from_camera) = of_optical.iter().find(|(own, _)| own == name)?;
            Some((body, ancestor_from_body.inverse() * ancestor_from_camera))
        })
    })
}

/// A frame and the frames above it, with the frame's pose in each.
fn ancestors<'a>(frames: &'a Frames, frame: &'a str) -> Vec<(&'a str, Isometry3<f64>)> {
    let mut list = vec![(frame, Isometry3::identity())];
    let mut name = frame;
    while let Some((parent, place)) = frames.get(name) {
        if list.len() > LONGEST_CHAIN {
            break;
        }
        let pose = place * list[list.len() - 1].1;
        list.push((parent, pose));
        name = parent;
    }
    list
}

fn transforms(message: Message) -> Vec<TransformStamped> {
    match message {
        Message::Transforms(transforms) => transforms,
        _ => Vec::new(),
    }
}

/// Parent and pose of a transform; a quaternion of zeros is no rotation.
fn placed(one: &TransformStamped) -> (String, Isometry3<f64>) {
    let [x, y, z, w] = one.transform.orientation;
    let quaternion = Quaternion::new(w, x, y, z);
    let rotation = if quaternion.norm() > 0.0 {
        UnitQuaternion::from_quaternion(quaternion)
    } else {
        UnitQuaternion::identity()
    };
    let [x, y, z] = one.transform.position;
    let pose = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
    (plain(&one.header.frame_id).to_string(), pose)
}

fn same(a: &(String, Isometry3<f64>), b: &(String, Isometry3<f64>)) -> bool {
    let way = a.1.translation.vector - b.1.translation.vector;
    a.0 == b.0 && way.norm() <= UNCHANGED && a.1.rotation.angle_to(&b.1.rotation) <= 1e3 * UNCHANGED
}

/// Without the noise that quaternions leave in the last digit, so that a camera that looks along an axis does so exactly.
fn rounded(value: f64) -> f64 {
    (value * 1e15).round() / 1e15
}

/// A frame's name without the slash of old ones.
fn plain(name: &str) -> &str {
    name.trim_start_matches('/')
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn frames() -> Frames {
        let turn = |axis: Vector3<f64>, angle: f64| UnitQuaternion::from_scaled_axis(axis * angle);
        let place = |parent: &str, x, y, z, rotation| {
            let pose = Isometry3::from_parts(Translation3::new(x, y, z), rotation);
            (parent.to_string(), pose)
        };
        // A camera on a mast, half a metre up and looking left; the body hangs below the footprint too.
        let left = turn(Vector3::z(), std::f64::consts::FRAC_PI_2);
        Frames::from([
            (
                "base_link".into(),
                place("base_footprint", 0.0, 0.0, 0.1, UnitQuaternion::identity()),
            ),
            (
                "mast".into(),
                place("base_footprint", 0.2, 0.0, 0.6, UnitQuaternion::identity()),
            ),
            ("camera".into(), place("mast", 0.0, 0.05, 0.0, left)),
        ])
    }

    #[test]
    fn the_mount_goes_over_the_common_ancestor() {
        let (body, pose) = chain(&frames(), &["base_link"], "camera").unwrap();
        assert_eq!(body, "base_link");
        assert!((pose.translation.vector - Vector3::new(0.2, 0.05, 0.5)).norm() < 1e-12);
        assert!((pose * Vector3::x() - Vector3::y()).norm() < 1e-12);
    }

    #[test]
    fn frames_that_are_not_connected_or_form_a_ring_have_no_mount() {
        assert!(chain(&frames(), &["base_link"], "other_camera").is_none());
        assert!(chain(&frames(), &["robot"], "camera").is_none());
        let mut ring = frames();
        let (_, pose) = ring["mast"].clone();
        ring.insert("base_footprint".into(), ("camera".into(), pose));
        assert!(ancestors(&ring, "camera").len() <= LONGEST_CHAIN + 1);
    }
}
