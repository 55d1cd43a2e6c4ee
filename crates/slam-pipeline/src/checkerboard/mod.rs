//! Checkerboards in grey images: inner corners in board order, to a few hundredths of a pixel.
//!
//! Problem: given an image and the number of inner corners of the board, find the board or say why not.
//!
//! Steps, one a file:
//! 1. `plane`: grey plane, blurred and, level by level, halved.
//! 2. `saddle`: response sqrt(-det Hessian) and its maxima.
//! 3. `star`: the four edges that leave a corner, and its bright squares.
//! 4. `grid`: neighbours along edges, whole coordinates, holes filled.
//! 5. `numbering`: the window of the board's size, and which corner comes first.
//! 6. `measure`, `refine`: a model of the corner fitted to the pixels.
//!
//! Levels are tried from the one whose longer side is at most 1280 pixels, first towards finer ones (small squares),
//! then towards coarser ones (blurred images). The fit starts at the level where the board was found and moves to finer
//! levels as long as they show more.
//!
//! Deterministic: no randomness, ties broken by position. Time about 20 ms for an image of 640 x 480, a third of it the fit.
//!
//! Degenerate: boards seen at more than about 65 degrees from their normal, squares below about 7 px, boards that are cut or
//! covered in part, two boards in one image: each has its own reason in [`NotFound`].
//!
//! Sources: Geiger, Moosmann, Car, Schuster, "Automatic camera and range sensor calibration using a single shot", ICRA
//! 2012; Bennett, Lasenby, "ChESS: quick and robust detection of chess-board features", CVIU 118, 2014.

mod grid;
mod measure;
mod numbering;
mod plane;
mod refine;
mod saddle;
mod star;

use std::fmt;
use std::str::FromStr;

use crate::sequence::GreyImage;
use grid::Grid;
use plane::Plane;
use star::Star;

/// Longer side of the level that is looked at first, pixels: saddles are narrow there, and noise is averaged.
const FIRST_SIDE_PX: usize = 1280;
/// Shorter side below which no level goes, pixels.
const LEAST_SIDE_PX: usize = 60;
/// Inner corners of a board: a board of 10 x 7 squares has 9 x 6.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoardSize {
    /// Corners in a row.
    pub columns: usize,
    /// Rows of corners.
    pub rows: usize,
}

impl BoardSize {
    /// Number of corners.
    pub fn corners(&self) -> usize {
        self.columns * self.rows
    }
}

impl fmt::Display for BoardSize {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}x{}", self.columns, self.rows)
    }
}

impl FromStr for BoardSize {
    type Err = String;

    /// Reads `9x6`: two whole numbers from 3 to 60.
    fn from_str(text: &str) -> Result<Self, String> {
        let side = |part: &str| {
            part.parse::<usize>()
                .ok()
                .filter(|side| (3..=60).contains(side))
        };
        let parsed = text
            .split_once('x')
            .and_then(|(columns, rows)| Some((side(columns)?, side(rows)?)));
        let (columns, rows) = parsed.ok_or_else(|| {
            format!("expected inner corners as 9x6, each from 3 to 60, found {text:?}")
        })?;
        Ok(BoardSize { columns, rows })
    }
}

/// A board that was found.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundBoard {
    /// Corners row by row, `index = row * columns + column`, pixels; pixel (0, 0) is the centre of the top-left pixel.
    pub corners: Vec<[f64; 2]>,
    /// Standard deviation of each corner by its own fit, for one coordinate, pixels.
    pub sigmas_px: Vec<f64>,
    /// Median blur of the edges as a standard deviation, pixels.
    pub blur_px: f64,
    /// Halvings of the image at which the board was found.
    pub level: u32,
}

/// Why no board was found; an ordinary outcome.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NotFound {
    /// The image is too small, or its pixels do not fill its size.
    NoImage,
    /// Nothing looks like the corner of a checkerboard.
    NoCorners,
    /// Too few corners that hang together.
    FewCorners {
        /// Corners in the largest grid.
        found: usize,
        /// Corners of the board.
        needed: usize,
    },
    /// A part of the board is missing: outside the image, covered, or too dark or blurred.
    Incomplete {
        /// Corners in the grid.
        found: usize,
        /// Extent of the grid, the longer side first.
        columns: usize,
        /// Extent of the grid, the shorter side.
        rows: usize,
    },
    /// The board seen is larger than asked for.
    Larger {
        /// Extent of the grid, the longer side first.
        columns: usize,
        /// Extent of the grid, the shorter side.
        rows: usize,
    },
    /// More than one board of this size.
    Several {
        /// How many.
        boards: usize,
    },
    /// The board is there, but corners are too blurred or disturbed to be measured.
    Unmeasurable {
        /// Corners whose fit failed.
        corners: usize,
    },
}

impl NotFound {
    /// How far the search came; of several levels the furthest gives the reason.
    fn progress(&self) -> usize {
        match self {
            NotFound::NoImage => 0,
            NotFound::NoCorners => 1,
            NotFound::FewCorners { found, .. } => 1 + found,
            NotFound::Incomplete { found, .. } => 10_000 + found,
            NotFound::Larger { .. } => 100_000,
            NotFound::Unmeasurable { .. } => 100_001,
            NotFound::Several { .. } => 100_002,
        }
    }
}

impl fmt::Display for NotFound {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            NotFound::NoImage => formatter.write_str("the image is too small"),
            NotFound::NoCorners => formatter.write_str("no corner of a checkerboard"),
            NotFound::FewCorners { found, needed } => write!(
                formatter,
                "at most {found} corners hang together, the board has {needed}"
            ),
            NotFound::Incomplete {
                found,
                columns,
                rows,
            } => write!(
                formatter,
                "the board is incomplete: {found} corners within {columns}x{rows}"
            ),
            NotFound::Larger { columns, rows } => write!(
                formatter,
                "the board has more corners than asked for: {columns}x{rows}"
            ),
            NotFound::Several { boards } => {
                write!(formatter, "{boards} boards of this size in one image")
            }
            NotFound::Unmeasurable { corners } => write!(
                formatter,
                "{corners} corners are too blurred or disturbed to be measured"
            ),
        }
    }
}

/// Finds the one board of `size` in an image.
///
/// # Errors
/// The reason as [`NotFound`]; an image without a board is an ordinary outcome.
pub fn find_board(image: &GreyImage, size: BoardSize) -> Result<FoundBoard, NotFound> {
    let finest = Plane::of(image).ok_or(NotFound::NoImage)?;
    if finest.width.min(finest.height) < LEAST_SIDE_PX {
        return Err(NotFound::NoImage);
    }
    let mut pyramid = vec![finest];
    while let Some(last) = pyramid.last()
        && last.width.min(last.height) >= 2 * LEAST_SIDE_PX
    {
        pyramid.push(last.halved());
    }
    let longer = |plane: &Plane| plane.width.max(plane.height);
    let first = pyramid
        .iter()
        .position(|plane| longer(plane) <= FIRST_SIDE_PX)
        .unwrap_or(pyramid.len() - 1);
    let mut reason = NotFound::NoCorners;
    for level in (0..=first).rev().chain(first + 1..pyramid.len()) {
        match at_level(&pyramid[..=level], size) {
            Ok(board) => return Ok(board),
            Err(why) if why.progress() > reason.progress() => reason = why,
            Err(_) => {}
        }
    }
    Err(reason)
}

/// Searches the last of `levels`, measures in the finest that shows more.
fn at_level(levels: &[Plane], size: BoardSize) -> Result<FoundBoard, NotFound> {
    let level = levels.len() - 1;
    let blurred = levels[level].blurred();
    let response = saddle::response(&blurred);
    let mut stars: Vec<Star> = saddle::maxima(&response, size.corners())
        .into_iter()
        .filter_map(|(x, y)| star::star(&blurred, saddle::saddle_point(&blurred, x, y)))
        .collect();
    if stars.is_empty() {
        return Err(NotFound::NoCorners);
    }
    let grids = grid::grids(&blurred, &stars);
    let largest = grids.first().map_or(1, Grid::len);
    // Filling can at most double what hangs together; less is no board.
    let mut promising: Vec<Grid> = grids
        .into_iter()
        .filter(|grid| 2 * grid.len() >= size.corners())
        .collect();
    if promising.is_empty() {
        return Err(NotFound::FewCorners {
            found: largest,
            needed: size.corners(),
        });
    }
    let mut boards = Vec::new();
    let mut reason = NotFound::NoCorners;
    let mut taken: Vec<usize> = Vec::new();
    for grid in &mut promising {
        // A part of a board that an earlier, larger part has grown over.
        if grid.values().any(|entry| taken.contains(&entry.0)) {
            continue;
        }
        grid::prune(&stars, grid);
        grid::complete(&blurred, &response, &mut stars, grid);
        grid::prune(&stars, grid);
        taken.extend(grid.values().map(|entry| entry.0));
        match numbering::numbered(size, &stars, grid) {
            Ok(order) => boards.push(order),
            Err(why) if why.progress() > reason.progress() => reason = why,
            Err(_) => {}
        }
    }
    match boards.as_slice() {
        [] => Err(reason),
        [order] => {
            let corners: Vec<Star> = order.iter().map(|&star| stars[star]).collect();
            measure::measured(levels, &corners, size)
        }
        several => Err(NotFound::Several {
            boards: several.len(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_and_written() {
        let size: BoardSize = "9x6".parse().unwrap();
        assert_eq!((size.columns, size.rows, size.corners()), (9, 6, 54));
        assert_eq!(size.to_string(), "9x6");
        for wrong in ["9", "9x", "x6", "2x6", "9x61", "-9x6", "9X6", "9x6x2", ""] {
            assert!(wrong.parse::<BoardSize>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn nothing_to_see_has_a_reason() {
        let size = BoardSize {
            columns: 9,
            rows: 6,
        };
        let image = |width: usize, height: usize, level: u8| GreyImage {
            width,
            height,
            pixels: vec![level; width * height],
        };
        assert_eq!(find_board(&image(20, 300, 9), size), Err(NotFound::NoImage));
        assert_eq!(
            find_board(&image(320, 240, 9), size),
            Err(NotFound::NoCorners)
        );
        let broken = GreyImage {
            pixels: vec![0; 5],
            ..image(320, 240, 0)
        };
        assert_eq!(find_board(&broken, size), Err(NotFound::NoImage));
    }
}
