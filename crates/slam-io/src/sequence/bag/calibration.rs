//! The calibration of a log: the `CameraInfo` that belongs to the images.

use std::path::Path;

use robot_logs::{CameraInfo, Message, MessageKind, RobotLog};

use crate::camera::{CameraFile, camera_of_info};
use crate::error::SequenceError;
use crate::warning::Warning;

/// The calibration for the images on a topic and the name of its own topic, for messages.
pub(super) fn of_log(
    path: &Path,
    log: &RobotLog,
    image_topic: Option<usize>,
    warnings: &mut Vec<Warning>,
) -> (Result<CameraFile, SequenceError>, String) {
    let images = image_topic.map_or("", |index| log.topics()[index].name.as_str());
    let missing = |found: String| SequenceError::File {
        path: path.to_path_buf(),
        expected: format!(
            "the calibration of the camera (sensor_msgs/CameraInfo) beside {}",
            if images.is_empty() {
                "the images"
            } else {
                images
            }
        ),
        found: format!(
            "{found}; give it with --camera camera.toml (or a file of Kalibr, OpenCV or ROS); `mono-slam calibrate` makes \
             it from pictures of a checkerboard"
        ),
    };
    let candidates: Vec<usize> = (0..log.topics().len())
        .filter(|&index| {
            let topic = &log.topics()[index];
            topic.kind == Some(MessageKind::CameraInfo) && topic.messages > 0
        })
        .collect();
    // Of one camera's namespace; a single calibration belongs to a single camera.
    let best = candidates
        .iter()
        .copied()
        .max_by_key(|&index| common_parts(images, &log.topics()[index].name));
    let others = log
        .topics()
        .iter()
        .filter(|topic| {
            topic.messages > 0
                && matches!(
                    topic.kind,
                    Some(MessageKind::Image | MessageKind::CompressedImage)
                )
        })
        .count();
    let Some(index) = best.filter(|&index| {
        common_parts(images, &log.topics()[index].name) > 0 || candidates.len() == 1 && others <= 1
    }) else {
        let found = if candidates.is_empty() {
            "none".into()
        } else {
            let names: Vec<&str> = candidates
                .iter()
                .map(|&index| log.topics()[index].name.as_str())
                .collect();
            format!("only that of other cameras ({})", names.join(", "))
        };
        return (Err(missing(found)), String::new());
    };
    let name = log.topics()[index].name.clone();
    let message = log
        .handles(&[index])
        .next()
        .map(|handle| log.message(&handle));
    let camera = match message {
        Some(Ok(Message::CameraInfo(info))) if info.k.iter().all(|&value| value == 0.0) => {
            Err(missing(format!(
                "on {name} that of a camera that is not calibrated (K is zero)"
            )))
        }
        Some(Ok(Message::CameraInfo(info))) => {
            let rectified = images
                .split('/')
                .any(|part| part.starts_with("image_rect") || part == "rect");
            if rectified {
                warnings.push(Warning::new(
                    "rectified-images",
                    format!(
                        "The images on {images} are rectified: the projection matrix P of {name} is taken, without lens."
                    ),
                ));
            }
            of_info(path, &info, rectified)
        }
        Some(Err(error)) => Err(error.into()),
        _ => Err(missing("none".into())),
    };
    (camera, name)
}

/// The calibration of the pixels as they are sent: of rectified images the projection, of a part of the image or of merged
/// pixels the part's.
fn of_info(path: &Path, info: &CameraInfo, rectified: bool) -> Result<CameraFile, SequenceError> {
    let [x_offset, y_offset, roi_height, roi_width] = info.roi.map(f64::from);
    let [binning_x, binning_y] = info.binning.map(|count| f64::from(count.max(1)));
    let (fx, fy, cx, cy) = if rectified {
        (info.p[0], info.p[5], info.p[2], info.p[6])
    } else {
        (info.k[0], info.k[4], info.k[2], info.k[5])
    };
    let part = |whole: u32, part: f64, binning: f64| {
        let size = if part > 0.0 { part } else { f64::from(whole) };
        (size / binning).floor() as u32
    };
    // The centre of the first merged pixel lies half a merged pixel behind the first one's corner.
    let merged = |centre: f64, offset: f64, binning: f64| {
        if offset == 0.0 && binning == 1.0 {
            centre
        } else {
            (centre - offset + 0.5) / binning - 0.5
        }
    };
    let (model, d) = if rectified {
        ("plumb_bob", &[][..])
    } else {
        (info.distortion_model.as_str(), info.d.as_slice())
    };
    camera_of_info(
        path,
        [
            part(info.width, roi_width, binning_x),
            part(info.height, roi_height, binning_y),
        ],
        [
            fx / binning_x,
            fy / binning_y,
            merged(cx, x_offset, binning_x),
            merged(cy, y_offset, binning_y),
        ],
        model,
        d,
    )
}

/// Parts at the beginning of two topic names that are the same.
fn common_parts(a: &str, b: &str) -> usize {
    a.split('/')
        .filter(|part| !part.is_empty())
        .zip(b.split('/').filter(|part| !part.is_empty()))
        .take_while(|(a, b)| a == b)
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use mono_geometry::Distortion;

    fn info() -> CameraInfo {
        CameraInfo {
            header: robot_logs::Header::default(),
            height: 480,
            width: 640,
            distortion_model: "plumb_bob".into(),
            d: vec![-0.3, 0.1, 0.0, 0.0, 0.0],
            k: [500.0, 0.0, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0],
            r: [0.0; 9],
            p: [
                450.0, 0.0, 310.0, 0.0, 0.0, 460.0, 230.0, 0.0, 0.0, 0.0, 1.0, 0.0,
            ],
            binning: [0; 2],
            roi: [0; 4],
        }
    }

    #[test]
    fn merged_pixels_and_parts_of_the_image_move_the_numbers() {
        let path = Path::new("x.bag");
        let plain = of_info(path, &info(), false).unwrap();
        assert_eq!((plain.width, plain.fx, plain.cy), (640, 500.0, 240.0));
        let mut merged = info();
        merged.binning = [2, 2];
        let camera = of_info(path, &merged, false).unwrap();
        assert_eq!((camera.width, camera.height, camera.fx), (320, 240, 250.0));
        assert_eq!((camera.cx, camera.cy), (159.75, 119.75));
        let mut part = info();
        part.roi = [100, 50, 200, 300];
        let camera = of_info(path, &part, false).unwrap();
        assert_eq!((camera.width, camera.height), (300, 200));
        assert_eq!((camera.cx, camera.cy), (220.0, 190.0));
    }

    #[test]
    fn rectified_images_have_the_projection_and_no_lens() {
        let camera = of_info(Path::new("x.bag"), &info(), true).unwrap();
        assert_eq!((camera.fx, camera.cx), (450.0, 310.0));
        assert_eq!(camera.distortion, Distortion::None);
    }

    #[test]
    fn the_namespace_counts_in_whole_parts() {
        assert_eq!(common_parts("/camera/image_raw", "/camera/camera_info"), 1);
        assert_eq!(common_parts("/camera2/image_raw", "/camera/camera_info"), 0);
        assert_eq!(common_parts("/a/left/image", "/a/left/camera_info"), 2);
    }
}
