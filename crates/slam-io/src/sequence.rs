//! Sequences: images, times, camera, odometry and, where there is one, a reference path.
//!
//! The native layout, which everything else is brought to:
//!
//! ```text
//! SEQ/images/NNNNNN.png       any image format, in the counting order of the names
//! SEQ/times.txt               one time stamp per image, seconds; or lines of a stamp and a name
//! SEQ/camera.toml             intrinsics, distortion, mount        (see [`CameraFile`])
//! SEQ/odometry.csv            header t_s,v_mps,omega_radps         (see [`OdometryRow`])
//! SEQ/groundtruth_planar.csv  optional: frame,t_s,x_m,y_m,phi_rad of the body
//! SEQ/groundtruth.txt         optional: TUM format, camera-to-world
//! ```
//!
//! [`Sequence::open`] finds the layout by looking, and reads and checks everything except the pixels, so that a run
//! with a bad input ends before it has written anything. Of the images the headers are read, the last bytes (was the
//! file cut?), and a few whole ones for the grey levels in use; [`Sequence::load_image`] decodes one when it is asked
//! for. [`Survey::of`] does the same without stopping at the first fault.
//!
//! Where both reference files exist the planar one is used: it already speaks of the body.

mod bag;
mod calibrations;
mod columns;
mod coverage;
mod euroc;
mod folder;
mod frames;
mod ground_truth;
mod gyro;
mod kitti;
mod kitti_raw;
mod kitti_text;
mod look;
mod motions;
mod native;
mod odometry;
mod options;
mod poses;
mod reference;
mod robot;
mod rows;
mod stamps;
mod stand_in;
mod steering;
mod survey;
mod times;
mod tum_rgbd;
mod wheels;

use std::path::{Path, PathBuf};

use mono_geometry::Se2;

use crate::camera::{CameraFile, CameraFormat, calibration_text, read_camera};
use crate::error::SequenceError;
use crate::images::{GreyImage, Images};
use crate::warning::Warning;
use calibrations::CAMERA;
use odometry::ODOMETRY;

pub use options::{OdometryChoice, OpenOptions, SequenceFormat};
pub use rows::{Odometry, OdometryRow, OdometrySource, odometry_csv};
pub use survey::{Part, Survey};

/// A checked sequence; pixels are read on demand.
#[derive(Debug, Clone)]
pub struct Sequence {
    /// Last part of the folder's path.
    pub name: String,
    /// The folder.
    pub root: PathBuf,
    /// Its layout.
    pub format: SequenceFormat,
    /// The images, in order.
    pub images: Images,
    /// One time stamp per image in seconds, strictly increasing.
    pub times_s: Vec<f64>,
    /// The calibration.
    pub camera: CameraFile,
    /// Rows of the odometry, times strictly increasing.
    pub odometry: Vec<OdometryRow>,
    /// Where the odometry came from.
    pub odometry_source: OdometrySource,
    /// Reference path of the body, (time in seconds, pose), relative to the body
    /// pose of the first frame; `None` when the sequence has none.
    pub reference: Option<Vec<(f64, Se2)>>,
    /// Remarks of the reading that do not hinder a run.
    pub warnings: Vec<Warning>,
    /// Name of the calibration's file, for messages.
    camera_name: String,
    /// Files that hold exactly the calibration and the odometry above, if there are any.
    camera_file: Option<PathBuf>,
    odometry_file: Option<PathBuf>,
}

impl Survey {
    /// Looks at everything that a sequence needs.
    ///
    /// # Errors
    /// [`SequenceError`] when there is no sequence at `path` at all; a fault of one piece is in that piece.
    pub fn of(path: &Path, options: &OpenOptions) -> Result<Survey, SequenceError> {
        let format = match options.format {
            Some(SequenceFormat::Log) => SequenceFormat::Log,
            Some(format) if path.is_dir() => format,
            _ => look::format_of(path)?,
        };
        let mut survey = match format {
            SequenceFormat::Log => bag::survey(path, options)?,
            SequenceFormat::Native | SequenceFormat::Images => {
                native::survey(path, format, options)
            }
            SequenceFormat::Euroc => euroc::survey(path, options),
            SequenceFormat::TumRgbd => tum_rgbd::survey(path, options),
            SequenceFormat::Kitti => kitti::survey(path, options),
            SequenceFormat::KittiRaw => kitti_raw::survey(path, options),
        };
        stand_in::fill_in(&mut survey, options);
        survey.name = folder_name(path);
        if let (Ok(images), Ok(camera)) = (&survey.images, &survey.camera) {
            survey.sizes = images.check_sizes(camera, &survey.camera_name);
        }
        if let Err(SequenceError::Missing { holds, .. }) = &mut survey.odometry {
            if let Ok(Some(_)) = &survey.reference {
                holds.push_str(
                    "; the ground truth stands in for it with --odometry-from-groundtruth 0.02,0.01,1",
                );
            }
            holds.push_str(
                "; without any, --odometry none finds the motion from the images, up to scale",
            );
        }
        Ok(survey)
    }
}

impl Sequence {
    /// Reads and checks the sequence at `path`, whose layout is found by looking.
    ///
    /// Cost: every text file once, both ends of every image file, the pixels of a few images.
    ///
    /// # Errors
    /// [`SequenceError`] with the file, the line where there is one, what was
    /// expected and what was found: a missing or unreadable file, no image, an image
    /// that is broken or has another size than the calibration says, a count of times
    /// other than the count of images, numbers that are not finite, times that do
    /// not increase, an unknown key, a matrix that is not a rotation, a speed that no
    /// wheeled robot has, odometry that starts after the first frame.
    pub fn open(path: &Path) -> Result<Sequence, SequenceError> {
        Self::open_with(path, &OpenOptions::default())
    }

    /// As [`Self::open`], with the layout, the calibration and so on as the options say.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_with(path: &Path, options: &OpenOptions) -> Result<Sequence, SequenceError> {
        let survey = Survey::of(path, options)?;
        let (images, times_s, camera) = (survey.images?, survey.times_s?, survey.camera?);
        survey.sizes?;
        let mut odometry = survey.odometry?;
        if options.odometry_offset_s != 0.0 {
            odometry = odometry.later(options.odometry_offset_s, times_s[0]);
        }
        Ok(Sequence {
            name: survey.name,
            root: survey.root,
            format: survey.format,
            images,
            times_s,
            camera,
            odometry: odometry.rows,
            odometry_source: odometry.source,
            reference: survey.reference?,
            warnings: survey.warnings,
            camera_name: survey.camera_name,
            camera_file: survey.camera_file,
            odometry_file: odometry.file,
        })
    }

    /// Camera and odometry as a batch over a finished run needs them, (name, contents), to be written beside its
    /// results; [`read_run_inputs`] reads them back.
    ///
    /// Files of the native layout are taken byte for byte, everything else is written in its form.
    ///
    /// # Errors
    /// [`SequenceError`] when they cannot be read again.
    pub fn input_files(&self) -> Result<Vec<(&'static str, Vec<u8>)>, SequenceError> {
        let bytes = |path: &Path| {
            std::fs::read(path).map_err(|source| SequenceError::Read {
                path: path.to_path_buf(),
                source,
            })
        };
        let camera = match &self.camera_file {
            Some(path) => bytes(path)?,
            None => calibration_text(&self.camera, CameraFormat::Toml)?.into_bytes(),
        };
        let odometry = match &self.odometry_file {
            Some(path) => bytes(path)?,
            None => odometry_csv(&self.odometry).into_bytes(),
        };
        Ok(vec![(CAMERA, camera), (ODOMETRY, odometry)])
    }

    /// Decodes image `index` to 8-bit grey; colour becomes luma.
    ///
    /// # Errors
    /// [`SequenceError`] naming the file when it cannot be decoded or has another
    /// size than the calibration says, and when there is no image `index`.
    pub fn load_image(&self, index: usize) -> Result<GreyImage, SequenceError> {
        let image = self.images.load(index)?;
        let (width, height) = (image.width as u32, image.height as u32);
        self.images
            .check_size(index, width, height, &self.camera, &self.camera_name)?;
        Ok(image)
    }

    /// Stretches within the time of the images, (from, to) in seconds, in which a speed of the odometry is held for more
    /// than five of its usual intervals: where rows are missing, and after the last one. O(rows).
    pub fn odometry_holes(&self) -> Vec<(f64, f64)> {
        coverage::holes(&self.odometry, &self.times_s)
    }

    /// Odometry between two times as (duration in s, v in m/s, omega in rad/s), in order.
    ///
    /// A row holds from its time to the next row's, the last one for ever; the pieces are
    /// clipped to `[from_s, to_s]`, so their durations sum to `to_s - from_s` unless
    /// `from_s` lies before the first row (nothing is known there). Empty when
    /// `to_s <= from_s`. Time O(log rows + pieces).
    pub fn odometry_between(&self, from_s: f64, to_s: f64) -> Vec<(f64, f64, f64)> {
        let start = self
            .odometry
            .partition_point(|row| row.t_s <= from_s)
            .saturating_sub(1);
        let mut pieces = Vec::new();
        for (offset, row) in self.odometry[start.min(self.odometry.len())..]
            .iter()
            .enumerate()
        {
            if row.t_s >= to_s {
                break;
            }
            let end_s = self
                .odometry
                .get(start + offset + 1)
                .map_or(to_s, |next| next.t_s.min(to_s));
            let duration_s = end_s - row.t_s.max(from_s);
            if duration_s > 0.0 {
                pieces.push((duration_s, row.v_mps, row.omega_radps));
            }
        }
        pieces
    }
}

/// Camera and odometry that [`Sequence::input_files`] put beside the results of a run whose first frame is at
/// `first_frame_s`.
///
/// # Errors
/// As [`Sequence::open`].
pub fn read_run_inputs(
    dir: &Path,
    first_frame_s: f64,
) -> Result<(CameraFile, Vec<OdometryRow>), SequenceError> {
    Ok((
        read_camera(&dir.join(CAMERA))?,
        odometry::read_odometry(&dir.join(ODOMETRY), first_frame_s)?,
    ))
}

/// Last part of a path as text, for names in results.
fn folder_name(path: &Path) -> String {
    let resolved = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
    resolved.file_name().map_or_else(
        || "sequence".to_string(),
        |name| name.to_string_lossy().into_owned(),
    )
}
