//! KITTI raw: `image_00/data`, `image_00/timestamps.txt`, `oxts/data`, `oxts/timestamps.txt`, calibrations above it.
//!
//! Source: A. Geiger et al., "Vision meets robotics: the KITTI dataset", IJRR 32(11), 2013. The body is the GPS/INS unit
//! (x forward, y left, z up). Its forward velocity and its turn rate about the up axis are the odometry, its poses the
//! reference: longitude and latitude by the Mercator projection at the scale of the first latitude.

use std::path::{Path, PathBuf};

use mono_geometry::Distortion;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::calibrations::{Camera, given_camera, no_camera};
use super::coverage::check_coverage;
use super::folder::by_clock_of_odometry;
use super::frames::{Frames, no_frames, stamped};
use super::kitti_text::{
    CAMERAS, Numbered, centre_in_camera_0, numbered, numbers_of, times_of_day,
};
use super::motions::{mount_of, rigid_motion};
use super::odometry::find_odometry;
use super::options::{OpenOptions, SequenceFormat};
use super::reference::relative_to_first;
use super::rows::{Odometry, OdometryRow, OdometrySource};
use super::survey::{Part, Survey};
use crate::camera::{CameraFile, MountFile, SigmaFile};
use crate::error::SequenceError;
use crate::images::listed_images;
use crate::text::{content_lines, finite, line_fault, read_text};
use crate::warning::Warning;

/// Mean radius of the earth's equator in the data set's own tools, metres.
const EARTH_RADIUS_M: f64 = 6_378_137.0;
/// Numbers in a file of the unit.
const NUMBERS: usize = 30;
/// The unit's first reading may be this much later than the first image, seconds: both are stamped at their trigger.
const EARLY_S: f64 = 0.1;

/// The folder of images and the number of its camera, if `path` has the layout.
pub(super) fn images_folder(path: &Path) -> Option<(PathBuf, usize)> {
    CAMERAS
        .into_iter()
        .map(|camera| (path.join(format!("image_{camera:02}")), camera))
        .find(|(folder, _)| folder.is_dir())
}

/// Looks at the folder.
pub(super) fn survey(root: &Path, options: &OpenOptions) -> Survey {
    let mut warnings = Vec::new();
    let (folder, number) = images_folder(root).unwrap_or_else(|| (root.join("image_00"), 0));
    let list = folder.join("timestamps.txt");
    let frames = match listed_images(&folder.join("data")) {
        Err(fault) => no_frames(fault, &list),
        Ok(files) => match times_of_day(&list)
            .and_then(|times_s| numbered(files.clone(), times_s, &list, &mut warnings))
        {
            Ok(Numbered { files, times_s, .. }) => stamped(files, times_s, &mut warnings),
            Err(fault) => Frames {
                images: stamped(files, Vec::new(), &mut warnings).images,
                times_s: Err(fault),
            },
        },
    };
    let first_s = frames.first_s();
    let camera = given_camera(root, options, frames.size(), &mut warnings).unwrap_or_else(|| {
        Camera::of_layout(
            own_camera(root, number, frames.size(), &mut warnings),
            "calib_cam_to_cam.txt",
        )
    });
    let readings = readings(root);
    let by_odometry = by_clock_of_odometry(&frames.times_s, options);
    let odometry = match &readings {
        Ok(Some(readings)) if !root.join("odometry.csv").exists() => {
            let mut rows = rows(readings, first_s);
            let times_s = by_odometry.as_deref().unwrap_or_default();
            check_coverage(&root.join("oxts"), None, &mut rows, times_s).map(|remarks| {
                warnings.extend(remarks);
                Odometry {
                    rows,
                    source: OdometrySource::File("oxts (GPS/INS unit)".into()),
                    file: None,
                }
            })
        }
        _ => find_odometry(root, by_odometry.as_deref(), &mut warnings),
    };
    let Frames { images, times_s } = frames;
    Survey {
        name: String::new(),
        root: root.to_path_buf(),
        format: SequenceFormat::KittiRaw,
        images,
        times_s,
        camera: camera.camera,
        camera_name: camera.name,
        sizes: Ok(()),
        odometry,
        reference: readings.map(|readings| {
            let poses = poses(&readings?);
            (!poses.is_empty()).then(|| relative_to_first(&poses, first_s))
        }),
        warnings,
        camera_file: camera.file,
    }
}

/// A calibration file beside the recording or in the folder of its day.
fn beside(root: &Path, name: &str) -> Option<PathBuf> {
    let resolved = root.canonicalize().unwrap_or_else(|_| root.to_path_buf());
    [
        Some(resolved.clone()),
        resolved.parent().map(Path::to_path_buf),
    ]
    .into_iter()
    .flatten()
    .map(|folder| folder.join(name))
    .find(|path| path.is_file())
}

/// The camera of `calib_cam_to_cam.txt` on the GPS/INS unit.
fn own_camera(
    root: &Path,
    number: usize,
    size: Option<[u32; 2]>,
    warnings: &mut Vec<Warning>,
) -> Part<CameraFile> {
    let Some(path) = beside(root, "calib_cam_to_cam.txt") else {
        return Err(no_camera(
            root,
            " (KITTI's own, calib_cam_to_cam.txt, belongs into the folder above)",
        ));
    };
    let need = |name: String, count: usize| -> Part<Vec<f64>> {
        match numbers_of(&path, &name)? {
            Some(values) if values.len() == count => Ok(values),
            found => Err(SequenceError::File {
                path: path.clone(),
                expected: format!("{count} numbers for {name}"),
                found: found.map_or("none".into(), |values| values.len().to_string()),
            }),
        }
    };
    let projection = need(format!("P_rect_{number:02}"), 12)?;
    let rectified = need(format!("S_rect_{number:02}"), 2)?;
    let raw = need(format!("S_{number:02}"), 2)?;
    let is_raw = size.is_some_and(|[width, height]| {
        [f64::from(width), f64::from(height)] == raw.as_slice() && raw != rectified
    });
    let (width_height, numbers, distortion) = if is_raw {
        let k = need(format!("K_{number:02}"), 9)?;
        let d = need(format!("D_{number:02}"), 5)?;
        let lens = Distortion::Radtan {
            k1: d[0],
            k2: d[1],
            p1: d[2],
            p2: d[3],
            k3: d[4],
        };
        (raw, [k[0], k[4], k[2], k[5]], lens)
    } else {
        let p = &projection;
        (rectified, [p[0], p[5], p[2], p[6]], Distortion::None)
    };
    let mount = mount(root, &path, &projection, number, is_raw, warnings)?;
    let [fx, fy, cx, cy] = numbers;
    CameraFile {
        width: width_height[0] as u32,
        height: width_height[1] as u32,
        fx,
        fy,
        cx,
        cy,
        distortion,
        mount,
        sigma: SigmaFile::default(),
    }
    .checked(&path)
}

/// Pose of the camera in the GPS/INS unit, by way of the laser scanner.
fn mount(
    root: &Path,
    cameras: &Path,
    projection: &[f64],
    number: usize,
    is_raw: bool,
    warnings: &mut Vec<Warning>,
) -> Part<MountFile> {
    let files = (
        beside(root, "calib_imu_to_velo.txt"),
        beside(root, "calib_velo_to_cam.txt"),
    );
    let (Some(imu_to_velo), Some(velo_to_cam)) = files else {
        warnings.push(Warning::new(
            "mount-unknown",
            "Without calib_imu_to_velo.txt and calib_velo_to_cam.txt nothing says where the camera sits: it is taken as \
             the body, looking forward and level.",
        ));
        return Ok(MountFile::default());
    };
    let velo_from_imu = rigid(&imu_to_velo)?;
    let camera_0_from_velo = rigid(&velo_to_cam)?;
    let rectified = match numbers_of(cameras, "R_rect_00")?.map(<[f64; 9]>::try_from) {
        Some(Ok(rotation)) if !is_raw => rigid_motion(&rotation, [0.0; 3]),
        _ => Isometry3::identity(),
    };
    let mut camera_0_from_camera = Isometry3::identity();
    if number != 0 {
        camera_0_from_camera.translation = Translation3::from(centre_in_camera_0(projection));
    }
    Ok(mount_of(
        &((rectified * camera_0_from_velo * velo_from_imu).inverse() * camera_0_from_camera),
    ))
}

/// The motion `R`, `T` of a calibration file.
fn rigid(path: &Path) -> Part<Isometry3<f64>> {
    let rotation = numbers_of(path, "R")?.map(<[f64; 9]>::try_from);
    let translation = numbers_of(path, "T")?.map(<[f64; 3]>::try_from);
    match (rotation, translation) {
        (Some(Ok(rotation)), Some(Ok(translation))) => Ok(rigid_motion(&rotation, translation)),
        _ => Err(SequenceError::File {
            path: path.to_path_buf(),
            expected: "R with nine numbers and T with three".into(),
            found: "others".into(),
        }),
    }
}

/// A reading of the GPS/INS unit.
struct Reading {
    t_s: f64,
    values: [f64; NUMBERS],
}

/// The readings in order; `None` when there are none.
fn readings(root: &Path) -> Part<Option<Vec<Reading>>> {
    let folder = root.join("oxts");
    let data = folder.join("data");
    if !data.is_dir() {
        return Ok(None);
    }
    let list = folder.join("timestamps.txt");
    let times_s = times_of_day(&list)?;
    let mut files: Vec<PathBuf> = std::fs::read_dir(&data)
        .map_err(|source| SequenceError::Read {
            path: data.clone(),
            source,
        })?
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "txt"))
        .collect();
    files.sort();
    let Numbered { files, times_s, .. } = numbered(files, times_s, &list, &mut Vec::new())?;
    files
        .iter()
        .zip(times_s)
        .map(|(path, t_s)| {
            let text = read_text(path)?;
            let Some((line, content)) = content_lines(&text).next() else {
                return Err(line_fault(path, 1, "30 numbers", "an empty file"));
            };
            let values = content
                .split_ascii_whitespace()
                .map(|cell| finite(path, line, "a reading", cell))
                .collect::<Part<Vec<f64>>>()?;
            let count = values.len();
            let values = values
                .try_into()
                .map_err(|_wrong_count| line_fault(path, line, "30 numbers", count.to_string()))?;
            Ok(Reading { t_s, values })
        })
        .collect::<Part<Vec<_>>>()
        .map(|readings| Some(readings).filter(|readings| !readings.is_empty()))
}

/// Forward speed and turn rate about the up axis.
fn rows(readings: &[Reading], first_s: Option<f64>) -> Vec<OdometryRow> {
    let mut rows: Vec<OdometryRow> = readings
        .iter()
        .map(|reading| OdometryRow {
            t_s: reading.t_s,
            v_mps: reading.values[8],
            omega_radps: reading.values[22],
        })
        .collect();
    if let (Some(row), Some(first_s)) = (rows.first_mut(), first_s)
        && row.t_s > first_s
        && row.t_s - first_s < EARLY_S
    {
        row.t_s = first_s;
    }
    rows
}

/// World from the unit.
fn poses(readings: &[Reading]) -> Vec<(f64, Isometry3<f64>)> {
    let scale = readings
        .first()
        .map_or(1.0, |reading| reading.values[0].to_radians().cos());
    readings
        .iter()
        .map(|reading| {
            let [latitude, longitude, altitude, roll, pitch, yaw, ..] = reading.values;
            let x = scale * EARTH_RADIUS_M * longitude.to_radians();
            let y = scale * EARTH_RADIUS_M * ((90.0 + latitude).to_radians() / 2.0).tan().ln();
            let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            let translation = Translation3::from(Vector3::new(x, y, altitude));
            (reading.t_s, Isometry3::from_parts(translation, rotation))
        })
        .collect()
}
