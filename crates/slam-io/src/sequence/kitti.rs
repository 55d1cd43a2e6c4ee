//! KITTI odometry: `sequences/NN` with `image_0`, `times.txt`, `calib.txt`, and `poses/NN.txt` beside or above it.
//!
//! Source: A. Geiger, P. Lenz, R. Urtasun, "Are we ready for autonomous driving? The KITTI vision benchmark suite", CVPR
//! 2012. The images are rectified. The poses are those of camera 0; where another camera is used they are moved to it.
//! Where the camera sits on the car the files do not say: it is taken as the body, looking forward.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Translation3};

use super::calibrations::{Camera, foreign_camera, given_camera};
use super::folder::survey_of;
use super::frames::{Frames, no_frames, stamped};
use super::kitti_text::{CAMERAS, Numbered, centre_in_camera_0, numbered, numbers_of};
use super::motions::{isometry_of, rigid_motion};
use super::options::{OpenOptions, SequenceFormat};
use super::reference::relative_to_first;
use super::survey::{Part, Survey};
use super::times::read_column;
use crate::camera::CameraFormat;
use crate::images::listed_images;
use crate::text::{content_lines, finite, line_fault, read_text};
use crate::warning::Warning;

/// The folder of images and the number of its camera, if `path` has the layout.
pub(super) fn images_folder(path: &Path) -> Option<(PathBuf, usize)> {
    CAMERAS
        .into_iter()
        .map(|camera| (path.join(format!("image_{camera}")), camera))
        .find(|(folder, _)| folder.is_dir())
}

/// Looks at the folder.
pub(super) fn survey(root: &Path, options: &OpenOptions) -> Survey {
    let mut warnings = Vec::new();
    let (folder, number) = images_folder(root).unwrap_or_else(|| (root.join("image_0"), 0));
    let list = root.join("times.txt");
    let mut numbers = Vec::new();
    let frames = match listed_images(&folder) {
        Err(fault) => no_frames(fault, &list),
        Ok(files) => match read_column(&list, &mut warnings)
            .and_then(|times_s| numbered(files.clone(), times_s, &list, &mut warnings))
        {
            Ok(found) => {
                let Numbered { files, times_s, .. } = found;
                numbers = found.numbers;
                stamped(files, times_s, &mut warnings)
            }
            Err(fault) => Frames {
                images: stamped(files, Vec::new(), &mut warnings).images,
                times_s: Err(fault),
            },
        },
    };
    let first_s = frames.first_s();
    let calibration = root.join("calib.txt");
    let camera = given_camera(root, options, frames.size(), &mut warnings).unwrap_or_else(|| {
        warnings.push(Warning::new(
            "mount-unknown",
            "The calibration does not say where the camera sits on the car: it is taken as the body, looking forward \
             and level; the mount is given in a camera.toml.",
        ));
        let camera = foreign_camera(
            &calibration,
            Some(CameraFormat::Kitti),
            Some(number.to_string()),
            frames.size(),
            &mut Vec::new(),
        );
        Camera::of_layout(camera, "calib.txt")
    });
    let reference = poses(root).and_then(|poses| {
        let Some(poses) = poses else { return Ok(None) };
        let centre = match numbers_of(&calibration, &format!("P{number}"))? {
            Some(projection) => centre_in_camera_0(&projection),
            None => nalgebra::Vector3::zeros(),
        };
        let camera_0_from_body = Isometry3::from_parts(
            Translation3::from(centre),
            nalgebra::UnitQuaternion::identity(),
        ) * isometry_of(&camera.mount()).inverse();
        let times_s = frames.times_s.as_deref().unwrap_or_default();
        let bodies: Vec<(f64, Isometry3<f64>)> = numbers
            .iter()
            .zip(times_s)
            .filter_map(|(&number, &t_s)| Some((t_s, poses.get(number)? * camera_0_from_body)))
            .collect();
        Ok(Some(relative_to_first(&bodies, first_s)).filter(|path| !path.is_empty()))
    });
    survey_of(
        root,
        SequenceFormat::Kitti,
        frames,
        camera,
        reference,
        options,
        warnings,
    )
}

/// World from camera 0, one a frame, from `NN.txt` beside or above the sequence.
fn poses(root: &Path) -> Part<Option<Vec<Isometry3<f64>>>> {
    let resolved = root.canonicalize().unwrap_or_else(|_| root.to_path_buf());
    let Some(name) = resolved.file_name() else {
        return Ok(None);
    };
    let file = format!("{}.txt", name.to_string_lossy());
    let candidates = [
        Some(resolved.join("poses.txt")),
        Some(resolved.join("poses").join(&file)),
        resolved.parent().map(|above| above.join(&file)),
        resolved
            .parent()
            .map(|above| above.join("poses").join(&file)),
        resolved
            .parent()
            .and_then(Path::parent)
            .map(|above| above.join("poses").join(&file)),
    ];
    let Some(path) = candidates.into_iter().flatten().find(|path| path.is_file()) else {
        return Ok(None);
    };
    let text = read_text(&path)?;
    content_lines(&text)
        .map(|(line, content)| {
            let values = content
                .split_ascii_whitespace()
                .map(|cell| finite(&path, line, "a pose", cell))
                .collect::<Part<Vec<f64>>>()?;
            let &[a, b, c, x, d, e, f, y, g, h, i, z] = values.as_slice() else {
                return Err(line_fault(
                    &path,
                    line,
                    "12 numbers, the rows of a 3 x 4 pose",
                    values.len().to_string(),
                ));
            };
            Ok(rigid_motion(&[a, b, c, d, e, f, g, h, i], [x, y, z]))
        })
        .collect::<Part<Vec<_>>>()
        .map(Some)
}
