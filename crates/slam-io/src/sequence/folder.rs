//! A folder of image files as a survey: its odometry is sought in the files of the native layout, whatever the layout.

use std::path::Path;

use mono_geometry::Se2;

use super::calibrations::Camera;
use super::frames::{Frames, known};
use super::odometry::find_odometry;
use super::options::{OpenOptions, SequenceFormat};
use super::survey::{Part, Survey};
use crate::warning::Warning;

/// The survey of the pieces that a layout has found in `root`.
pub(super) fn survey_of(
    root: &Path,
    format: SequenceFormat,
    frames: Frames,
    camera: Camera,
    reference: Part<Option<Vec<(f64, Se2)>>>,
    options: &OpenOptions,
    mut warnings: Vec<Warning>,
) -> Survey {
    let by_odometry = by_clock_of_odometry(&frames.times_s, options);
    let odometry = find_odometry(root, by_odometry.as_deref(), &mut warnings);
    Survey {
        name: String::new(),
        root: root.to_path_buf(),
        format,
        images: frames.images,
        times_s: frames.times_s,
        camera: camera.camera,
        camera_name: camera.name,
        sizes: Ok(()),
        odometry,
        reference,
        warnings,
        camera_file: camera.file,
    }
}

/// The times of the frames by the clock of the odometry, against which its rows are held; `None` where there are none.
pub(super) fn by_clock_of_odometry(
    times_s: &Part<Vec<f64>>,
    options: &OpenOptions,
) -> Option<Vec<f64>> {
    known(times_s).map(|times| {
        times
            .iter()
            .map(|t_s| t_s - options.odometry_offset_s)
            .collect()
    })
}
