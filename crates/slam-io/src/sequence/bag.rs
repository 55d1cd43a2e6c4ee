//! Recorded logs: ROS 1 bags, MCAP files and ROS 2 sqlite3 bags as a sequence.
//!
//! A log does not say which of its topics is meant, so they are chosen: of the image topics and of the odometry topics the
//! best one ([`choice`]), the calibration of the same namespace, the mount from the static transforms between the body and
//! the camera's optical frame ([`mount`]). Everything that was chosen among several, or is missing, is a warning or a
//! fault with the option that answers it.
//!
//! Times are those of the message headers where they can be used, otherwise those of the recorder ([`clock`]).

mod calibration;
mod choice;
mod clock;
mod images;
mod joints;
mod motion;
mod mount;

use std::path::Path;
use std::sync::Arc;

use robot_logs::{MessageHandle, RobotLog};

use super::calibrations::{CAMERA, Camera, given_camera};
use super::coverage::check_coverage;
use super::options::{OdometryChoice, OpenOptions, SequenceFormat};
use super::rows::{Odometry, OdometrySource};
use super::survey::{Part, Survey};
use crate::camera::CameraFile;
use crate::error::SequenceError;
use crate::images::Images;
use crate::warning::Warning;
use choice::{Chosen, choose_images, choose_odometry};
use clock::{Stamped, common_clock};
use images::LogImages;
use joints::JointWheels;
use motion::{Motion, Reading};

/// Looks at a log.
///
/// # Errors
/// [`SequenceError`] when it cannot be opened at all.
pub(super) fn survey(path: &Path, options: &OpenOptions) -> Result<Survey, SequenceError> {
    let log = Arc::new(RobotLog::open(path)?);
    let mut warnings: Vec<Warning> = log
        .notes()
        .iter()
        .map(|note| Warning::new("log-not-whole", note.clone()))
        .collect();
    let wheels = JointWheels::beside(path)?;
    let image_topic = choose_images(path, &log, options.image_topic.as_deref(), &mut warnings);
    let odometry_topic = choose_odometry(
        path,
        &log,
        options.odometry_topic.as_deref(),
        wheels.is_some(),
        &mut warnings,
    );
    let wanted = options.odometry == OdometryChoice::Found;
    let looked = look(
        path,
        &log,
        image_topic,
        odometry_topic,
        wheels,
        wanted,
        options.odometry_offset_s,
        &mut warnings,
    );
    let body_frame = looked.body_frame;
    let (image_topic, optical_frame) = (looked.image_topic, looked.optical_frame);
    let size = looked
        .images
        .as_ref()
        .ok()
        .and_then(|images| images.size(0).ok())
        .map(<[u32; 2]>::from);
    let camera = camera(
        path,
        &log,
        image_topic,
        [body_frame.as_deref(), optical_frame.as_deref()],
        size,
        options,
        &mut warnings,
    );
    Ok(Survey {
        name: String::new(),
        root: path.to_path_buf(),
        format: SequenceFormat::Log,
        images: looked.images,
        times_s: looked.times_s,
        camera: camera.camera,
        camera_name: camera.name,
        sizes: Ok(()),
        odometry: looked.odometry,
        reference: Ok(None),
        warnings,
        camera_file: None,
    })
}

/// The parts of a survey that come from the messages in time.
struct Looked {
    images: Part<Images>,
    times_s: Part<Vec<f64>>,
    odometry: Part<Odometry>,
    /// The image topic, where there is one.
    image_topic: Option<usize>,
    optical_frame: Option<String>,
    body_frame: Option<String>,
}

/// Reads all stamps of the images and all messages of the odometry, in one pass through the log.
fn look(
    path: &Path,
    log: &Arc<RobotLog>,
    image_topic: Part<Chosen>,
    odometry_topic: Part<Chosen>,
    wheels: Option<JointWheels>,
    odometry_wanted: bool,
    offset_s: f64,
    warnings: &mut Vec<Warning>,
) -> Looked {
    let mut frames: Vec<Stamped<MessageHandle>> = Vec::new();
    let mut readings: Vec<Stamped<Reading>> = Vec::new();
    let mut fault = None;
    let topics: Vec<usize> = [&image_topic, &odometry_topic]
        .into_iter()
        .filter_map(|chosen| Some(chosen.as_ref().ok()?.topic))
        .collect();
    let of = |chosen: &Part<Chosen>| chosen.as_ref().ok().map(|chosen| chosen.topic);
    let mut motion = Motion::new(wheels);
    for handle in log.handles(&topics) {
        let log_ns = handle.log_time_ns();
        let result = if Some(handle.topic()) == of(&image_topic) {
            log.stamp_ns(&handle).map(|header_ns| {
                frames.push(Stamped {
                    log_ns,
                    header_ns,
                    value: handle,
                });
            })
        } else {
            log.message(&handle).map(|message| {
                if let Some((header_ns, value)) = motion.take(message) {
                    readings.push(Stamped {
                        log_ns,
                        header_ns,
                        value,
                    });
                }
            })
        };
        if let Err(error) = result {
            fault = Some(error);
            break;
        }
    }
    if let Some(error) = fault {
        warnings.push(Warning::new(
            "log-not-whole",
            format!(
                "{error}: the {} images and {} odometry messages before it are used.",
                frames.len(),
                readings.len()
            ),
        ));
    }
    let (mut frames, readings) = common_clock(frames, readings, warnings);
    let odometry = odometry_topic.and_then(|chosen| {
        let name = log.topics()[chosen.topic].name.clone();
        let mut rows = motion.rows(path, &name, &readings, warnings)?;
        // Images without odometry are of use where none is wanted.
        if let Some(first) = rows.first().filter(|_| odometry_wanted) {
            let before = frames.partition_point(|(t_s, _)| *t_s < first.t_s + offset_s);
            if before > 0 && before < frames.len() {
                warnings.push(Warning::new(
                    "images-before-odometry",
                    format!(
                        "{before} of {} images were taken before the first odometry message, up to {:.2} s, and are \
                         left out.",
                        frames.len(),
                        first.t_s + offset_s - frames[0].0
                    ),
                ));
                frames.drain(..before);
            }
        }
        if odometry_wanted {
            let times_s: Vec<f64> = frames.iter().map(|(t_s, _)| t_s - offset_s).collect();
            warnings.extend(check_coverage(path, None, &mut rows, &times_s)?);
        }
        Ok(Odometry {
            rows,
            source: OdometrySource::Topic(name),
            file: None,
        })
    });
    let (images, times_s, topic, optical_frame) = match image_topic {
        Err(fault) => (Err(fault), Ok(Vec::new()), None, None),
        Ok(chosen) => {
            let times_s = frames.iter().map(|(t_s, _)| *t_s).collect();
            let handles = frames.into_iter().map(|(_, handle)| handle).collect();
            match LogImages::new(path, Arc::clone(log), handles) {
                Ok((source, frame)) => {
                    let images = Images::new(Arc::new(source));
                    warnings.extend(images.warning());
                    (Ok(images), Ok(times_s), Some(chosen.topic), Some(frame))
                }
                Err(fault) => (Err(fault), Ok(times_s), Some(chosen.topic), None),
            }
        }
    };
    Looked {
        images,
        times_s,
        odometry,
        image_topic: topic,
        optical_frame,
        body_frame: motion.body_frame().map(str::to_string),
    }
}

/// The calibration of the options or of the log, with the mount of whichever has one.
fn camera(
    path: &Path,
    log: &RobotLog,
    image_topic: Option<usize>,
    [body, optical]: [Option<&str>; 2],
    size: Option<[u32; 2]>,
    options: &OpenOptions,
    warnings: &mut Vec<Warning>,
) -> Camera {
    let (camera, name, has_mount) = if let Some(given) = given_camera(path, options, size, warnings)
    {
        let own = path.join(CAMERA);
        let file = options.camera.as_deref().unwrap_or(&own);
        (given.camera, given.name, mount::stated_in(file))
    } else {
        let (camera, name) = calibration::of_log(path, log, image_topic, warnings);
        (camera, name, false)
    };
    let camera = match camera {
        Ok(camera) if !has_mount => mounted(log, camera, body, optical, warnings),
        other => other,
    };
    Camera {
        camera,
        name,
        file: None,
    }
}

/// The calibration with the mount that the transforms of the log tell.
fn mounted(
    log: &RobotLog,
    mut camera: CameraFile,
    body: Option<&str>,
    optical: Option<&str>,
    warnings: &mut Vec<Warning>,
) -> Part<CameraFile> {
    let Some(optical) = optical else {
        return Ok(camera);
    };
    match mount::of_log(log, body, optical, warnings)? {
        Ok(mount) => camera.mount = mount,
        Err(missing) => warnings.push(Warning::new(
            "no-mount",
            format!(
                "{missing}: the camera is taken to look forwards from the body's origin; if it does not, add [mount] with \
                 position_in_body and rotation_body_from_camera to a camera.toml (a run writes one into its folder) and \
                 give it with --camera."
            ),
        )),
    }
    Ok(camera)
}
