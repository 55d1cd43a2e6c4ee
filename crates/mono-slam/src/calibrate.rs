//! A camera from image files: every image is decoded and searched in parallel.
//!
//! The result is the same for any number of threads: each image is alone, and results keep the
//! order of the files.

use std::path::{Path, PathBuf};

use camera_calibration::{
    BoardSize, CalibrateError, CalibrationRun, CalibrationSettings, SearchedImage, calibrate_boards,
};
use rayon::prelude::*;
use slam_io::read_grey;

/// Finds the boards in `files` and calibrates. `progress` is called once for every image done, from any thread.
///
/// # Errors
/// [`CalibrateError`]: too few boards, or boards that fix no camera. A file that cannot be read is
/// no error; the result names it with the reason.
pub fn calibrate_files(
    files: &[PathBuf],
    settings: &CalibrationSettings,
    progress: &(dyn Fn() + Sync),
) -> Result<CalibrationRun, CalibrateError> {
    let searched = files
        .par_iter()
        .map(|path| {
            let seen = search(path, settings.board);
            progress();
            seen
        })
        .collect();
    calibrate_boards(searched, settings)
}

/// One image, searched when it can be read.
fn search(path: &Path, board: BoardSize) -> SearchedImage {
    let name = path.file_name().unwrap_or(path.as_os_str());
    let name = name.to_string_lossy().into_owned();
    match read_grey(path) {
        Err(error) => {
            // The name says already which file it is.
            let text = error.to_string();
            let prefix = format!("{}: ", path.display());
            let reason = text.strip_prefix(&prefix).unwrap_or(&text);
            SearchedImage::unreadable(name, reason.to_string())
        }
        Ok(image) => SearchedImage::search(name, image.view(), board),
    }
}
