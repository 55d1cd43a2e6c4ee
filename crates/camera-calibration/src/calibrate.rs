//! From boards to a camera: the choice of images, the weights of their corners, and the outcome of each image.
//!
//! Images of another size than most, images that could not be read and images without a whole board are kept by name
//! with the reason ([`Outcome`]); the corners of the others go to [`mono_geometry::calibration`].
//!
//! A corner weighs by the standard deviation of its own fit and a floor of 0.01 px together, because corners of small
//! or blurred squares are several times worse than those of large sharp ones. Only the ratios count: the scale of the
//! standard deviations of the result comes from the residuals.

use std::collections::BTreeMap;

use mono_geometry::calibration::{
    CalibrationError, CalibrationOptions, CalibrationView, Corner, calibrate,
};
use nalgebra::Vector2;

use crate::board::FoundBoard;
use crate::images::{
    CalibrationImage, CalibrationRun, CalibrationSettings, Outcome, Search, SearchedImage,
};

/// Fewest boards that a calibration needs: two leave the centre or the lens open in most cases.
const LEAST_BOARDS: usize = 3;

/// Error of a corner that its fit does not know, pixels: RMS against the truth in rendered images without noise.
const FLOOR_PX: f64 = 0.01;

/// Why there is no calibration.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrateError {
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

/// Calibrates a camera from the boards of `images`. The order of the images is kept.
///
/// # Errors
/// [`CalibrateError`]: fewer than three boards in images of one size, or boards that fix no camera.
pub fn calibrate_boards(
    images: Vec<SearchedImage>,
    settings: &CalibrationSettings,
) -> Result<CalibrationRun, CalibrateError> {
    let (width, height) = usual_size(&images);
    let mut images: Vec<CalibrationImage> = images
        .into_iter()
        .map(|image| sorted(image, (width, height)))
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

/// The image with its board if its size is the usual one, otherwise the reason why it cannot be used.
fn sorted(image: SearchedImage, usual: (usize, usize)) -> CalibrationImage {
    let (board, outcome) = match image.search {
        Search::Unreadable(reason) => (None, Outcome::Unreadable(reason)),
        Search::Searched { size, .. } if size != usual => {
            (None, Outcome::OtherSize(size.0, size.1))
        }
        Search::Searched {
            board: Ok(board), ..
        } => (
            Some(board),
            Outcome::LeftOut("its corners do not fix a pose".into()),
        ),
        Search::Searched {
            board: Err(reason), ..
        } => (None, Outcome::NoBoard(reason)),
    };
    CalibrationImage {
        name: image.name,
        board,
        outcome,
    }
}

/// The size of most boards, of most images when there is no board; of equally frequent ones the smaller.
fn usual_size(images: &[SearchedImage]) -> (usize, usize) {
    let mut counts: BTreeMap<(usize, usize), (usize, usize)> = BTreeMap::new();
    for image in images {
        if let Some(size) = image.size() {
            let count = counts.entry(size).or_default();
            count.0 += usize::from(image.has_board());
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
    for image in images.iter().filter(|image| image.board.is_none()) {
        let Some(reason) = image.reason() else {
            continue;
        };
        match counted.iter_mut().find(|entry| entry.0 == reason) {
            Some(entry) => entry.1 += 1,
            None => counted.push((reason, 1, image.name.clone())),
        }
    }
    counted.sort_by_key(|entry| std::cmp::Reverse(entry.1));
    counted
}
