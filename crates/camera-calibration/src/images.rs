//! The settings of a calibration, the images that were searched, and the outcome of each of them.

use mono_geometry::calibration::{Calibration, LensModel};

use crate::board::{BoardSize, FoundBoard, NotFound};
use crate::detect::find_board;
use crate::image::GreyView;

/// The board that was photographed, and the lens model to estimate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationSettings {
    /// Inner corners of the board.
    pub board: BoardSize,
    /// Side of a square, metres.
    pub square_m: f64,
    /// Lens model.
    pub model: LensModel,
}

/// An image after the search for the board, or an image that could not be read.
#[derive(Debug, Clone, PartialEq)]
pub struct SearchedImage {
    pub(crate) name: String,
    pub(crate) search: Search,
}

/// Outcome of the search in one image.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Search {
    /// The image could not be read, with the reason.
    Unreadable(String),
    /// The image was searched.
    Searched {
        /// Columns and rows.
        size: (usize, usize),
        /// The board, or why there is none.
        board: Result<FoundBoard, NotFound>,
    },
}

impl SearchedImage {
    /// Searches `image` for the board; `name` stands for the image in messages. About 20 ms for 640 x 480 pixels.
    pub fn search(name: String, image: GreyView<'_>, board: BoardSize) -> SearchedImage {
        SearchedImage {
            name,
            search: Search::Searched {
                size: (image.width, image.height),
                board: find_board(image, board),
            },
        }
    }

    /// An image that the caller could not read, so that the result can name it with the reason.
    pub fn unreadable(name: String, reason: String) -> SearchedImage {
        SearchedImage {
            name,
            search: Search::Unreadable(reason),
        }
    }

    /// Columns and rows of an image that was read.
    pub(crate) fn size(&self) -> Option<(usize, usize)> {
        match self.search {
            Search::Unreadable(_) => None,
            Search::Searched { size, .. } => Some(size),
        }
    }

    /// Whether the board was found.
    pub(crate) fn has_board(&self) -> bool {
        matches!(self.search, Search::Searched { board: Ok(_), .. })
    }
}

/// The use that the calibration made of an image.
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

/// An image and its outcome.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationImage {
    /// Its name, as the caller gave it.
    pub name: String,
    /// The board, when it was found in an image of the right size.
    pub board: Option<FoundBoard>,
    /// The use that the calibration made of it.
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
}

/// A finished calibration and the images behind it.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationRun {
    /// The settings that were given.
    pub settings: CalibrationSettings,
    /// Number of image columns.
    pub width: usize,
    /// Number of image rows.
    pub height: usize,
    /// Every image in the order given.
    pub images: Vec<CalibrationImage>,
    /// The result; its views are the used images in order.
    pub calibration: Calibration,
}

impl CalibrationRun {
    /// For every view of the calibration its index in `images` and its board.
    pub fn used(&self) -> impl Iterator<Item = (usize, &FoundBoard)> {
        let with_index = self.images.iter().enumerate();
        with_index.filter_map(|(index, image)| match image.outcome {
            Outcome::Used(_) => Some((index, image.board.as_ref()?)),
            _ => None,
        })
    }
}
