//! A camera from photographs of a checkerboard: files in, [`CalibrationRun`] out.
//!
//! Steps: every image is decoded and searched ([`crate::checkerboard`]), in parallel; images of another size than most, images that
//! cannot be read and images without a whole board are kept by name with the reason ([`Outcome`]); the corners of the
//! others go to [`mono_geometry::calibration`]; [`camera_toml`] writes the result for a sequence folder.
//!
//! A corner weighs by the standard deviation of its own fit and a floor of 0.01 px together: corners of small or blurred squares are
//! several times worse than those of large sharp ones. Only the ratios count; the scale of the standard deviations of the
//! result comes from the residuals.
//!
//! Same result for any number of threads: each image is alone, and results keep the order of the files.

mod camera_file;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mono_geometry::calibration::{
    Calibration, CalibrationError, CalibrationOptions, CalibrationView, Corner, LensModel,
    calibrate,
};
use nalgebra::Vector2;
use rayon::prelude::*;

use crate::checkerboard::{BoardSize, FoundBoard, NotFound, find_board};
use crate::sequence::{GreyImage, SequenceError, list_images, read_grey};
pub use camera_file::camera_toml;

/// Fewest boards that are calibrated from: two leave the centre or the lens open in most cases.
pub const LEAST_BOARDS: usize = 3;

/// Error of a corner that its fit does not know, pixels: RMS against the truth in rendered images without noise.
const FLOOR_PX: f64 = 0.01;

/// What was photographed, and which camera is wanted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationSettings {
    /// Inner corners of the board.
    pub board: BoardSize,
    /// Side of a square, metres.
    pub square_m: f64,
    /// Lens model.
    pub model: LensModel,
}

/// What became of an image.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// The board was found and used: index into [`Calibration::views`].
    Used(usize),
    /// The calibration left the view out.
    LeftOut(String),
    /// It cannot be read.
    Unreadable(String),
    /// It has another size than most: width, height.
    OtherSize(usize, usize),
    /// No board in it.
    NoBoard(NotFound),
}

/// An image and what became of it.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationImage {
    /// The file.
    pub path: PathBuf,
    /// The board, when it was found in an image of the right size.
    pub board: Option<FoundBoard>,
    /// What became of it.
    pub outcome: Outcome,
}

impl CalibrationImage {
    /// Why the image was not used, in words; `None` when it was.
    pub fn reason(&self) -> Option<String> {
        match &self.outcome {
            Outcome::Used(_) => None,
            Outcome::LeftOut(reason) | Outcome::Unreadable(reason) => Some(reason.clone()),
            Outcome::OtherSize(width, height) => {
                Some(format!("{width}x{height} pixels, unlike the others"))
            }
            Outcome::NoBoard(reason) => Some(reason.to_string()),
        }
    }

    /// The file's name without its folders.
    pub fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or(self.path.as_os_str());
        name.to_string_lossy().into_owned()
    }
}

/// A finished calibration and the images behind it.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationRun {
    /// What was asked for.
    pub settings: CalibrationSettings,
    /// Image columns.
    pub width: usize,
    /// Image rows.
    pub height: usize,
    /// Every image in the order given.
    pub images: Vec<CalibrationImage>,
    /// The result; its views are the used images in order.
    pub calibration: Calibration,
}

impl CalibrationRun {
    /// Image of every view of the calibration.
    pub fn used(&self) -> impl Iterator<Item = (&CalibrationImage, &FoundBoard)> {
        self.images.iter().filter_map(|image| match image.outcome {
            Outcome::Used(_) => Some((image, image.board.as_ref()?)),
            _ => None,
        })
    }
}

/// Why there is no calibration.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// A folder cannot be listed.
    #[error(transparent)]
    Images(#[from] SequenceError),
    /// Too few boards were found.
    #[error("{found} board{} in {images} image{}, required: at least {LEAST_BOARDS}{}", plural(*.found), plural(*.images), first_reasons(.reasons))]
    TooFewBoards {
        /// Boards found in images of one size.
        found: usize,
        /// Images given.
        images: usize,
        /// (reason, count, an example), most frequent first.
        reasons: Vec<(String, usize, String)>,
    },
    /// The corners do not make a camera.
    #[error("no camera fits the boards: {0}")]
    Calibration(#[from] CalibrationError),
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

fn first_reasons(reasons: &[(String, usize, String)]) -> String {
    let shown: Vec<String> = reasons
        .iter()
        .take(3)
        .map(|(reason, count, example)| match count {
            1 => format!("{example}: {reason}"),
            _ => format!("{example} and {} more: {reason}", count - 1),
        })
        .collect();
    if shown.is_empty() {
        String::new()
    } else {
        format!(" ({})", shown.join("; "))
    }
}

/// The images behind a list of files and folders; a folder stands for its images in lexical order.
///
/// # Errors
/// [`SequenceError`] when a folder cannot be listed or holds no image.
pub fn image_files(inputs: &[PathBuf]) -> Result<Vec<PathBuf>, SequenceError> {
    let mut files = Vec::new();
    for input in inputs {
        if input.is_dir() {
            files.extend(list_images(input)?);
        } else {
            files.push(input.clone());
        }
    }
    Ok(files)
}

/// Finds the boards and calibrates. `progress` is called once for every image done, from any thread.
///
/// # Errors
/// [`CalibrateError`]: fewer than [`LEAST_BOARDS`] boards, or boards that fix no camera.
pub fn calibrate_images(
    files: &[PathBuf],
    settings: &CalibrationSettings,
    progress: &(dyn Fn() + Sync),
) -> Result<CalibrationRun, CalibrateError> {
    let looked: Vec<(CalibrationImage, (usize, usize))> = files
        .par_iter()
        .map(|path| {
            let seen = look(path, settings.board);
            progress();
            seen
        })
        .collect();
    let (width, height) = usual_size(&looked);
    let mut images: Vec<CalibrationImage> = looked
        .into_iter()
        .map(|(image, size)| {
            if matches!(image.outcome, Outcome::Unreadable(_)) || size == (width, height) {
                image
            } else {
                CalibrationImage {
                    board: None,
                    outcome: Outcome::OtherSize(size.0, size.1),
                    ..image
                }
            }
        })
        .collect();
    let with_board: Vec<usize> = (0..images.len())
        .filter(|&k| images[k].board.is_some())
        .collect();
    if with_board.len() < LEAST_BOARDS {
        return Err(CalibrateError::TooFewBoards {
            found: with_board.len(),
            images: images.len(),
            reasons: counted_reasons(&images),
        });
    }
    let views: Vec<CalibrationView> = with_board
        .iter()
        .filter_map(|&k| images[k].board.as_ref())
        .map(|board| view(board, settings))
        .collect();
    let options = CalibrationOptions {
        model: settings.model,
        ..CalibrationOptions::default()
    };
    let calibration = calibrate(width, height, &views, &options)?;
    for &image in &with_board {
        images[image].outcome = Outcome::LeftOut("its corners do not fix a pose".into());
    }
    for (index, report) in calibration.views.iter().enumerate() {
        images[with_board[report.view]].outcome = Outcome::Used(index);
    }
    Ok(CalibrationRun {
        settings: *settings,
        width,
        height,
        images,
        calibration,
    })
}

/// One image, and its size when it could be read.
fn look(path: &Path, size: BoardSize) -> (CalibrationImage, (usize, usize)) {
    let image = |board, outcome| CalibrationImage {
        path: path.to_path_buf(),
        board,
        outcome,
    };
    match read_grey(path) {
        Err(error) => {
            // The path is known already.
            let text = error.to_string();
            let prefix = format!("{}: ", path.display());
            let reason = text.strip_prefix(&prefix).unwrap_or(&text).to_string();
            (image(None, Outcome::Unreadable(reason)), (0, 0))
        }
        Ok(grey) => {
            let GreyImage { width, height, .. } = grey;
            let seen = match find_board(&grey, size) {
                Ok(board) => image(Some(board), Outcome::Used(0)),
                Err(reason) => image(None, Outcome::NoBoard(reason)),
            };
            (seen, (width, height))
        }
    }
}

/// The size of most boards, of most images when there is no board; of equally frequent ones the smaller.
fn usual_size(looked: &[(CalibrationImage, (usize, usize))]) -> (usize, usize) {
    let mut counts: BTreeMap<(usize, usize), (usize, usize)> = BTreeMap::new();
    for (image, size) in looked {
        if *size != (0, 0) {
            let count = counts.entry(*size).or_default();
            count.0 += usize::from(image.board.is_some());
            count.1 += 1;
        }
    }
    let mut best = ((0, 0), (0, 0));
    for (size, count) in counts {
        if count > best.1 {
            best = (size, count);
        }
    }
    best.0
}

fn view(board: &FoundBoard, settings: &CalibrationSettings) -> CalibrationView {
    let columns = settings.board.columns;
    let on_board: Vec<Vector2<f64>> = (0..board.corners.len())
        .map(|k| Vector2::new((k % columns) as f64, (k / columns) as f64) * settings.square_m)
        .collect();
    let found = board.corners.iter().zip(&board.sigmas_px);
    CalibrationView {
        corners: on_board
            .into_iter()
            .zip(found)
            .map(|(board_m, (corner, sigma_px))| Corner {
                board_m,
                pixel: Vector2::new(corner[0], corner[1]),
                sigma_px: sigma_px.hypot(FLOOR_PX),
            })
            .collect(),
    }
}

/// (reason, count, first file), most frequent first.
fn counted_reasons(images: &[CalibrationImage]) -> Vec<(String, usize, String)> {
    let mut counted: Vec<(String, usize, String)> = Vec::new();
    for image in images {
        let Some(reason) = image.reason() else {
            continue;
        };
        match counted.iter_mut().find(|entry| entry.0 == reason) {
            Some(entry) => entry.1 += 1,
            None => counted.push((reason, 1, image.name())),
        }
    }
    counted.sort_by_key(|entry| std::cmp::Reverse(entry.1));
    counted
}
