//! Sequence folders: images, times, camera, odometry and, where there is one, a reference path.
//!
//! ```text
//! SEQ/images/NNNNNN.png|jpg   8-bit grey or colour, taken in lexical order
//! SEQ/times.txt               one time stamp per image, seconds
//! SEQ/camera.toml             intrinsics, distortion, mount        (see [`CameraFile`])
//! SEQ/odometry.csv            header t_s,v_mps,omega_radps         (see [`OdometryRow`])
//! SEQ/groundtruth_planar.csv  optional: frame,t_s,x_m,y_m,phi_rad of the body
//! SEQ/groundtruth.txt         optional: TUM format, camera-to-world
//! ```
//!
//! [`Sequence::open`] reads and checks everything except the pixels, so that a run
//! with a bad input ends before it has written anything. Image files are opened for
//! their headers only; [`Sequence::load_image`] decodes one when it is asked for.
//! Where both reference files exist the planar one is used: it already speaks of
//! the body.

mod odometry;
mod reference;
mod times;

use std::path::{Path, PathBuf};

use mono_geometry::Se2;

use crate::camera::{CameraFile, read_camera};
use crate::error::SequenceError;
use crate::images::{self, GreyImage};
use crate::warning::Warning;

pub use odometry::OdometryRow;

/// Names of the text files that a run keeps.
const CAMERA: &str = "camera.toml";
const ODOMETRY: &str = "odometry.csv";

/// A checked sequence folder; pixels are read on demand.
#[derive(Debug, Clone, PartialEq)]
pub struct Sequence {
    /// Last part of the folder's path.
    pub name: String,
    /// The folder.
    pub root: PathBuf,
    /// Image files in lexical order.
    pub images: Vec<PathBuf>,
    /// One time stamp per image in seconds, strictly increasing.
    pub times_s: Vec<f64>,
    /// Contents of `camera.toml`.
    pub camera: CameraFile,
    /// Rows of `odometry.csv`, times strictly increasing.
    pub odometry: Vec<OdometryRow>,
    /// Reference path of the body, (time in seconds, pose), relative to the body
    /// pose of the first frame; `None` when the folder has none.
    pub reference: Option<Vec<(f64, Se2)>>,
    /// Remarks on the files, in the order in which they were read.
    pub warnings: Vec<Warning>,
}

impl Sequence {
    /// Reads and checks the folder `path`.
    ///
    /// Cost: every text file once and the header of every image; no pixel is decoded.
    ///
    /// # Errors
    /// [`SequenceError`] with the file, the line where there is one, what was
    /// expected and what was found: a missing or unreadable file, no image, an image
    /// that cannot be decoded or has another size than `camera.toml` says, a count of times
    /// other than the count of images, numbers that are not finite, times that do
    /// not increase, an unknown key, a matrix that is not a rotation, a speed that no
    /// wheeled robot has, odometry that starts after the first frame.
    pub fn open(path: &Path) -> Result<Sequence, SequenceError> {
        if !path.is_dir() {
            return Err(SequenceError::File {
                path: path.to_path_buf(),
                expected: "a sequence folder".into(),
                found: if path.exists() { "a file" } else { "nothing" }.into(),
            });
        }
        let images = images::list_images(&path.join("images"))?;
        let times_s = times::read_times(&path.join("times.txt"), images.len())?;
        let camera = read_camera(&path.join(CAMERA))?;
        images::check_sizes(&images, &camera)?;
        let first_s = times_s[0];
        let odometry = odometry::read_odometry(&path.join(ODOMETRY), first_s)?;
        let reference = reference::read_reference(path, &camera.mount, first_s)?;
        Ok(Sequence {
            name: folder_name(path),
            root: path.to_path_buf(),
            images,
            times_s,
            camera,
            odometry,
            reference,
            warnings: Vec::new(),
        })
    }

    /// The text files of the sequence that a batch over a finished run needs, (name, contents), to be written beside its
    /// results; [`read_run_inputs`] reads them back.
    ///
    /// # Errors
    /// [`SequenceError`] when they cannot be read again.
    pub fn input_files(&self) -> Result<Vec<(&'static str, Vec<u8>)>, SequenceError> {
        [CAMERA, ODOMETRY]
            .into_iter()
            .map(|name| {
                let path = self.root.join(name);
                match std::fs::read(&path) {
                    Ok(bytes) => Ok((name, bytes)),
                    Err(source) => Err(SequenceError::Read { path, source }),
                }
            })
            .collect()
    }

    /// Decodes image `index` to 8-bit grey; colour becomes luma.
    ///
    /// # Errors
    /// [`SequenceError`] naming the file when it cannot be decoded or has another
    /// size than `camera.toml` says, and when there is no image `index`.
    pub fn load_image(&self, index: usize) -> Result<GreyImage, SequenceError> {
        let path = self.images.get(index).ok_or(SequenceError::NoSuchFrame {
            index,
            frames: self.images.len(),
        })?;
        images::load_grey(path, &self.camera)
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
