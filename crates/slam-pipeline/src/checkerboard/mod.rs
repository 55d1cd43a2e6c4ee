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
//! 6. `refine`: a model of the corner fitted to the pixels.
//!
//! Levels are tried from the one whose longer side is at most [`FIRST_SIDE_PX`], first towards finer ones (small squares),
//! then towards coarser ones (blurred images). The fit starts at the level where the board was found and moves to finer
//! levels as long as they show more.
//!
//! Deterministic: no randomness, ties broken by position. Time about 15 ns a pixel, and a millisecond a board for the fit.
//!
//! Degenerate: boards seen at more than about 75 degrees from their normal, squares below about 6 px, boards that are cut or
//! covered in part, two boards in one image: each has its own reason in [`NotFound`].
//!
//! Sources: Geiger, Moosmann, Car, Schuster, "Automatic camera and range sensor calibration using a single shot", ICRA
//! 2012; Bennett, Lasenby, "ChESS: quick and robust detection of chess-board features", CVIU 118, 2014.

mod grid;
mod numbering;
mod plane;
mod refine;
mod saddle;
mod star;

use std::fmt;
use std::str::FromStr;

use crate::sequence::GreyImage;
use grid::Grid;
use plane::{Plane, from_finest, to_finest};
use refine::{Freedom, Window};
use star::Star;

/// Longer side of the level that is looked at first, pixels: saddles are narrow there, and noise is averaged.
const FIRST_SIDE_PX: usize = 1280;
/// Shorter side below which no level goes, pixels.
const LEAST_SIDE_PX: usize = 60;
/// Half the narrow way across the smallest window a corner is fitted in, pixels of its level.
const LEAST_WINDOW_PX: f64 = 2.0;
/// Pixels below which blur and ground are not fitted corner by corner: eight a parameter.
const FEW_PIXELS: usize = 80;
/// Share of the contrast seen around a corner that its fit must find.
const CONTRAST_SHARE: f64 = 0.4;
/// Edge blur above which a finer level shows nothing more, pixels.
const SHARP_PX: f64 = 1.2;

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
            measured(levels, &corners, size)
        }
        several => Err(NotFound::Several {
            boards: several.len(),
        }),
    }
}

/// Corners fitted at the last of `levels`, then at finer ones while their edges look sharp.
fn measured(levels: &[Plane], corners: &[Star], size: BoardSize) -> Result<FoundBoard, NotFound> {
    let found_at = levels.len() as u32 - 1;
    let mut positions: Vec<[f64; 2]> = corners
        .iter()
        .map(|corner| to_finest(corner.position, found_at))
        .collect();
    let mut directions: Vec<[f64; 2]> = corners
        .iter()
        .map(|corner| {
            // Edges 0 and 2 are one line, 1 and 3 the other.
            [0, 1].map(|line| {
                corner.rays[line]
                    + 0.5 * star::turn(corner.rays[line + 2] - std::f64::consts::PI - corner.rays[line])
            })
        })
        .collect();
    let mut best = None;
    let mut width = 0.8;
    for level in (0..=found_at).rev() {
        let factor = f64::from(1_u32 << level);
        let Some(windows) = windows(&positions, size, factor) else {
            return best.ok_or(NotFound::Unmeasurable {
                corners: positions.len(),
            });
        };
        let narrow = |window: &Window| window.narrowest() < LEAST_WINDOW_PX;
        if level > 0 && windows.iter().any(narrow) {
            // Squares too small to be measured here; the next level has twice the pixels.
            continue;
        }
        let fit = |k: usize, width: f64, freedom: Freedom| {
            let place = from_finest(positions[k], level);
            let plane = &levels[level as usize];
            refine::fit(plane, place, directions[k], width, &windows[k], freedom)
                .filter(|fit| fit.contrast >= CONTRAST_SHARE * corners[k].contrast)
        };
        let free: Vec<Option<refine::Fit>> = (0..positions.len())
            .map(|k| fit(k, width, Freedom::Full))
            .collect();
        // Corners with few pixels, and those that got lost, take the blur from the others.
        let usual = median(free.iter().flatten().flat_map(|fit| fit.widths).collect());
        let usual = if usual.is_finite() { usual } else { width };
        let fits: Vec<Option<refine::Fit>> = free
            .into_iter()
            .enumerate()
            .map(|(k, found)| match found {
                Some(found) if found.pixels >= FEW_PIXELS => Some(found),
                _ => fit(k, usual, Freedom::Stiff),
            })
            .collect();
        let failed = fits.iter().filter(|fit| fit.is_none()).count();
        if failed > 0 {
            // The coarser level stands, when there is one.
            return best.ok_or(NotFound::Unmeasurable { corners: failed });
        }
        let fits: Vec<refine::Fit> = fits.into_iter().flatten().collect();
        for (k, fit) in fits.iter().enumerate() {
            positions[k] = to_finest(fit.position, level);
            directions[k] = fit.directions;
        }
        let blur = median(fits.iter().flat_map(|fit| fit.widths).collect());
        best = Some(FoundBoard {
            corners: positions.clone(),
            sigmas_px: fits.iter().map(|fit| factor * fit.sigma_px).collect(),
            blur_px: factor * blur,
            level: found_at,
        });
        if blur > SHARP_PX {
            break;
        }
        width = 2.0 * blur;
    }
    best.ok_or(NotFound::Unmeasurable {
        corners: positions.len(),
    })
}

/// Window each corner is fitted in, at a level `factor` times smaller; `None` when its squares have no area.
fn windows(positions: &[[f64; 2]], size: BoardSize, factor: f64) -> Option<Vec<Window>> {
    let side = |k: usize, place: usize, count: usize, stride: usize| {
        let (before, after) = (place > 0, place + 1 < count);
        let (from, to) = (
            if before { k - stride } else { k },
            if after { k + stride } else { k },
        );
        let steps = if before && after { 2.0 } else { 1.0 };
        [0, 1].map(|axis| (positions[to][axis] - positions[from][axis]) / (steps * factor))
    };
    (0..positions.len())
        .map(|k| {
            let (column, row) = (k % size.columns, k / size.columns);
            Window::new(
                side(k, column, size.columns, 1),
                side(k, row, size.rows, size.columns),
            )
        })
        .collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
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
