//! The size of a checkerboard, a board that was found, and the reasons why none was.

use std::fmt;
use std::str::FromStr;

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
#[non_exhaustive]
pub enum NotFound {
    /// The image is too small, or its pixels do not fill its size.
    NoImage,
    /// Nothing looks like the corner of a checkerboard.
    NoCorners,
    /// Too few corners are connected to each other.
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
        /// Number of boards.
        boards: usize,
    },
    /// The board is there, but corners are too blurred or disturbed to be measured.
    Unmeasurable {
        /// Corners whose fit failed.
        corners: usize,
    },
}

impl NotFound {
    /// How far the search came: of several pyramid levels, the one that came furthest gives the reason.
    pub(crate) fn progress(&self) -> usize {
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
}
