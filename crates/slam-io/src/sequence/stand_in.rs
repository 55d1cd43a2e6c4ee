//! Pieces that a sequence does not have and that the user asks to do without.
//!
//! Without odometry the images tell the path up to its scale, and then a guessed lens and an even frame rate do less harm
//! than no result at all: the map shows the shape of the path, and a warning says what was guessed.

use std::path::Path;

use mono_geometry::Distortion;

use super::coverage::check_coverage;
use super::ground_truth::rows_with_noise;
use super::options::{OdometryChoice, OpenOptions};
use super::rows::{Odometry, OdometrySource};
use super::survey::Survey;
use crate::camera::{CameraFile, MountFile, SigmaFile};
use crate::error::SequenceError;
use crate::warning::Warning;

/// Frame rate where nobody tells it, hertz.
const USUAL_RATE_HZ: f64 = 10.0;
/// Field of view along the longer side of an image where nobody tells it, degrees.
const USUAL_VIEW_DEG: f64 = 60.0;

/// Fills in what `options` allow to be missing.
pub(super) fn fill_in(survey: &mut Survey, options: &OpenOptions) {
    let choice = options.odometry;
    if choice == OdometryChoice::Without {
        guess_camera(survey);
    }
    if choice == OdometryChoice::Without || options.frames_per_second.is_some() {
        assume_rate(survey, options.frames_per_second);
    }
    match choice {
        OdometryChoice::Found => {}
        OdometryChoice::Without => {
            forget_odometry(survey);
            survey.warnings.push(Warning::new(
                "scale-unknown",
                "There is no odometry, so nothing tells a length: the first step counts as 0.1 units, path and map are right \
                 up to one factor at best, and the factor may drift along the way",
            ));
            survey.odometry = Ok(Odometry {
                rows: Vec::new(),
                source: OdometrySource::None,
                file: None,
            });
        }
        OdometryChoice::GroundTruth {
            sigma_v,
            sigma_w,
            seed,
        } => {
            forget_odometry(survey);
            survey.odometry = from_ground_truth(survey, sigma_v, sigma_w, seed);
        }
    }
}

/// Remarks on odometry that is not used are none of the user's concern.
fn forget_odometry(survey: &mut Survey) {
    survey
        .warnings
        .retain(|w| !w.name.starts_with("odometry-") && !w.name.starts_with("turn-rate-"));
}

fn from_ground_truth(
    survey: &mut Survey,
    sigma_v: f64,
    sigma_w: f64,
    seed: u64,
) -> Result<Odometry, SequenceError> {
    let reference = match &survey.reference {
        Ok(Some(reference)) if reference.len() > 1 => reference,
        _ => {
            return Err(SequenceError::File {
                path: survey.root.clone(),
                expected: "a reference path, such as groundtruth.txt, to make odometry from".into(),
                found: "none".into(),
            });
        }
    };
    let mut rows = rows_with_noise(reference, sigma_v, sigma_w, seed);
    survey.warnings.push(Warning::new(
        "odometry-from-ground-truth",
        format!(
            "The odometry is made from the ground truth with noise of {sigma_v} m and {sigma_w} rad per square root of a \
             second, seed {seed}: errors of this run say nothing about a robot's own wheels"
        ),
    ));
    if let Ok(times_s) = &survey.times_s {
        let path = Path::new("the ground truth");
        survey
            .warnings
            .extend(check_coverage(path, None, &mut rows, times_s)?);
    }
    Ok(Odometry {
        rows,
        source: OdometrySource::GroundTruth {
            sigma_v,
            sigma_w,
            seed,
        },
        file: None,
    })
}

/// A lens of the usual field of view where there is no calibration file at all.
fn guess_camera(survey: &mut Survey) {
    let (Err(SequenceError::Missing { .. }), Ok(images)) = (&survey.camera, &survey.images) else {
        return;
    };
    let Ok((width, height)) = images.size(0) else {
        return;
    };
    let (w, h) = (f64::from(width), f64::from(height));
    let focal = 0.5 * w.max(h) / (0.5 * USUAL_VIEW_DEG.to_radians()).tan();
    survey.camera = Ok(CameraFile {
        width,
        height,
        fx: focal,
        fy: focal,
        cx: 0.5 * (w - 1.0),
        cy: 0.5 * (h - 1.0),
        distortion: Distortion::None,
        mount: MountFile::default(),
        sigma: SigmaFile::default(),
    });
    survey.camera_name = "the guessed camera".into();
    survey.camera_file = None;
    survey.warnings.push(Warning::new(
        "camera-guessed",
        format!(
            "There is no calibration: a lens without distortion of {USUAL_VIEW_DEG:.0} degrees, looking straight ahead, is \
             guessed (fx = fy = {focal:.0} px), and every angle of the result is only as good as that; `mono-slam calibrate` \
             makes a camera.toml, --camera names one"
        ),
    ));
}

/// Even times where there are none.
fn assume_rate(survey: &mut Survey, rate_hz: Option<f64>) {
    let (Err(SequenceError::Missing { .. }), Ok(images)) = (&survey.times_s, &survey.images) else {
        return;
    };
    let rate = rate_hz.unwrap_or(USUAL_RATE_HZ);
    let times_s: Vec<f64> = (0..images.len()).map(|index| index as f64 / rate).collect();
    survey.warnings.push(Warning::new(
        "frame-rate-assumed",
        format!(
            "There is no times.txt: {rate} images a second are {}",
            if rate_hz.is_some() {
                "what --fps says"
            } else {
                "assumed; --fps states another rate"
            }
        ),
    ));
    if let Ok(odometry) = &mut survey.odometry {
        let path = odometry.file.clone().unwrap_or_else(|| survey.root.clone());
        match check_coverage(&path, None, &mut odometry.rows, &times_s) {
            Ok(warnings) => survey.warnings.extend(warnings),
            Err(fault) => survey.odometry = Err(fault),
        }
    }
    survey.times_s = Ok(times_s);
}
