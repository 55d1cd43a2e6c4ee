//! EuRoC: `mav0/cam0/data.csv`, `mav0/cam0/data/`, `mav0/cam0/sensor.yaml`, `mav0/state_groundtruth_estimate0/data.csv`.
//!
//! Source: M. Burri et al., "The EuRoC micro aerial vehicle datasets", IJRR 35(10), 2016. Stamps are nanoseconds. The
//! body is the IMU, whose axes are those of its chip: where `T_BS` makes the camera look forward and upright it is taken
//! as the mount, otherwise the camera itself is taken as the body. The layout has no odometry; an `odometry.csv` beside
//! `mav0` is taken.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use super::calibrations::{Camera, foreign_camera, given_camera};
use super::folder::survey_of;
use super::frames::{frames_of, no_frames};
use super::motions::{TimedPoses, isometry_of, mount_of, rigid_motion};
use super::options::{OpenOptions, SequenceFormat};
use super::reference::relative_to_first;
use super::stamps::TimeUnit;
use super::survey::{Part, Survey};
use crate::camera::{CameraFile, CameraFormat, MountFile};
use crate::error::SequenceError;
use crate::images::listed_images;
use crate::text::{content_lines, finite, increasing, line_fault, quoted, read_text};
use crate::warning::Warning;

/// Folders of the ground truth, the second one of TUM-VI.
const TRUTHS: [&str; 2] = ["state_groundtruth_estimate0", "mocap0"];
/// Cosine of the largest angle between the camera's axes and those of an upright camera that looks forward.
const UPRIGHT_COSINE: f64 = 0.8;

/// The folder with `cam0` in it, if `path` has the layout.
pub(super) fn base_of(path: &Path) -> Option<PathBuf> {
    [path.join("mav0"), path.to_path_buf()]
        .into_iter()
        .find(|base| {
            ["data", "data.csv", "sensor.yaml"]
                .iter()
                .any(|name| base.join("cam0").join(name).exists())
        })
}

/// Looks at the folder.
pub(super) fn survey(root: &Path, options: &OpenOptions) -> Survey {
    let base = base_of(root).unwrap_or_else(|| root.join("mav0"));
    let mut warnings = Vec::new();
    let list = base.join("cam0/data.csv");
    let frames = match listed_images(&base.join("cam0/data")) {
        Ok(files) => frames_of(files, &list, &mut warnings),
        Err(fault) => no_frames(fault, &list),
    };
    // Nanoseconds and names that are stamps are the format, no remark.
    warnings.retain(|warning| {
        !["times-not-in-seconds", "times-from-names"].contains(&warning.name.as_str())
    });
    let first_s = frames.first_s();
    let sensor = base.join("cam0/sensor.yaml");
    let imu_from_camera = pose_in_imu(&sensor);
    let camera = given_camera(root, options, frames.size(), &mut warnings).unwrap_or_else(|| {
        let camera = own_camera(&sensor, &imu_from_camera, &mut warnings);
        Camera::of_layout(camera, "cam0/sensor.yaml")
    });
    // By way of the camera, whose place in both is known.
    let imu_from_body = imu_from_camera.map_or_else(
        |_| Isometry3::identity(),
        |imu| isometry_of(&imu) * isometry_of(&camera.mount()).inverse(),
    );
    let reference = reference(&base).map(|poses| {
        let bodies: TimedPoses = poses?
            .into_iter()
            .map(|(t_s, pose)| (t_s, pose * imu_from_body))
            .collect();
        Some(relative_to_first(&bodies, first_s))
    });
    survey_of(
        root,
        SequenceFormat::Euroc,
        frames,
        camera,
        reference,
        options,
        warnings,
    )
}

/// Keys without which a `sensor.yaml` is not that of a EuRoC camera.
const KEYS: [&str; 5] = [
    "T_BS",
    "resolution",
    "intrinsics",
    "distortion_model",
    "distortion_coefficients",
];

/// The camera of the sensor's file, on the body where its axes allow it.
fn own_camera(
    sensor: &Path,
    imu_from_camera: &Part<MountFile>,
    warnings: &mut Vec<Warning>,
) -> Part<CameraFile> {
    let text = read_text(sensor)?;
    // Before anything else: files of other scripts that bear the name are often not even YAML.
    let keys: Vec<&str> = text
        .lines()
        .filter_map(|line| line.split_once(':'))
        .map(|(key, _)| key)
        .collect();
    let missing: Vec<&str> = KEYS.into_iter().filter(|key| !keys.contains(key)).collect();
    if !missing.is_empty() {
        return Err(SequenceError::File {
            path: sensor.to_path_buf(),
            expected: format!("the keys {} of a EuRoC camera", KEYS.join(", ")),
            found: format!(
                "no {}: write the calibration into a camera.toml and name it with --camera",
                missing.join(", ")
            ),
        });
    }
    let mut notes = Vec::new();
    let mut camera = foreign_camera(sensor, Some(CameraFormat::Euroc), None, None, &mut notes)?;
    match imu_from_camera {
        Ok(mount) if is_upright(mount) => {
            camera.mount = *mount;
            warnings.push(Warning::new(
                "body-is-imu",
                "The body of this layout is the IMU, it is taken for the turning centre of the robot; the mount in a \
                 camera.toml beside mav0 would say better.",
            ));
        }
        _ => warnings.push(Warning::new(
            "camera-taken-as-body",
            "The body of this layout is an IMU whose axes are not those of a wheeled robot (x forward, y left, z up), so \
             the camera itself is taken as the body, looking forward and level; the mount of a robot is given in a \
             camera.toml.",
        )),
    }
    Ok(camera)
}

/// `T_BS`, the camera's pose in the IMU.
fn pose_in_imu(sensor: &Path) -> Part<MountFile> {
    let text = read_text(sensor)?;
    let fault = |found: String| SequenceError::File {
        path: sensor.to_path_buf(),
        expected: "T_BS with the 16 numbers of a rigid motion".into(),
        found,
    };
    let numbers = text
        .split_once("T_BS")
        .and_then(|(_, after)| after.split_once('['))
        .and_then(|(_, after)| after.split_once(']'))
        .map(|(numbers, _)| numbers)
        .ok_or_else(|| fault("none".into()))?;
    let values = numbers
        .split(',')
        .map(|cell| {
            cell.trim()
                .parse::<f64>()
                .ok()
                .filter(|value| value.is_finite())
        })
        .collect::<Option<Vec<f64>>>()
        .ok_or_else(|| fault("something else".into()))?;
    let &[a, b, c, x, d, e, f, y, g, h, i, z, ..] = values.as_slice() else {
        return Err(fault(format!("{} numbers", values.len())));
    };
    let imu_from_camera = rigid_motion(&[a, b, c, d, e, f, g, h, i], [x, y, z]);
    Ok(mount_of(&imu_from_camera))
}

fn is_upright(mount: &MountFile) -> bool {
    let [x, _, z] = mount.rotation_body_from_camera;
    // The optical axis along x, the camera's down against z.
    x[2] > UPRIGHT_COSINE && -z[1] > UPRIGHT_COSINE
}

/// Poses of the IMU, (time in seconds, world from IMU).
fn reference(base: &Path) -> Part<Option<TimedPoses>> {
    let Some(path) = TRUTHS
        .iter()
        .map(|name| base.join(name).join("data.csv"))
        .find(|path| path.exists())
    else {
        return Ok(None);
    };
    let text = read_text(&path)?;
    let mut poses: TimedPoses = Vec::new();
    for (line, content) in content_lines(&text) {
        let cells: Vec<&str> = content.split(',').map(str::trim).collect();
        let Some((stamp, rest)) = cells.split_first().filter(|(_, rest)| rest.len() >= 7) else {
            return Err(line_fault(
                &path,
                line,
                "a stamp in nanoseconds, a position and a quaternion (t,x,y,z,qw,qx,qy,qz)",
                quoted(content),
            ));
        };
        let t_s = TimeUnit::Nanoseconds.seconds(stamp, finite(&path, line, "the stamp", stamp)?);
        let mut values = [0.0; 7];
        for (value, cell) in values.iter_mut().zip(rest) {
            *value = finite(&path, line, "the pose", cell)?;
        }
        let [x, y, z, qw, qx, qy, qz] = values;
        increasing(&path, line, poses.last().map(|pose| pose.0), t_s)?;
        let rotation = UnitQuaternion::try_new(Quaternion::new(qw, qx, qy, qz), f64::EPSILON)
            .ok_or_else(|| SequenceError::Line {
                path: path.clone(),
                line,
                expected: "a quaternion".into(),
                found: "zeros".into(),
            })?;
        poses.push((
            t_s,
            Isometry3::from_parts(Translation3::new(x, y, z), rotation),
        ));
    }
    Ok(Some(poses).filter(|poses| !poses.is_empty()))
}
