//! Checkerboards in grey images: inner corners in board order, to a few hundredths of a pixel.
//!
//! Problem: given an image and the number of inner corners of the board, find the board or say why it is not found.
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

use crate::board::{BoardSize, FoundBoard, NotFound};
use crate::image::GreyView;
use grid::Grid;
use plane::Plane;
use star::Star;

/// Longer side of the level that is looked at first, pixels: saddles are narrow there, and noise is averaged.
const FIRST_SIDE_PX: usize = 1280;
/// Shorter side below which no level goes, pixels.
const LEAST_SIDE_PX: usize = 60;

/// Finds the one board of `size` in an image.
///
/// # Errors
/// The reason as [`NotFound`]; an image without a board is an ordinary outcome.
///
/// ```
/// use camera_calibration::{BoardSize, GreyView, NotFound, find_board};
///
/// // A grey wall has no board on it, which is an ordinary outcome with its reason.
/// let pixels = vec![128; 320 * 240];
/// let wall = GreyView { width: 320, height: 240, pixels: &pixels };
/// let size: BoardSize = "9x6".parse()?;
/// assert_eq!(find_board(wall, size), Err(NotFound::NoCorners));
/// # Ok::<(), String>(())
/// ```
pub fn find_board(image: GreyView<'_>, size: BoardSize) -> Result<FoundBoard, NotFound> {
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
    // Filling can at most double the connected corners, so smaller grids cannot become a board.
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
        // This part of a board was absorbed by an earlier, larger part.
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
    fn nothing_to_see_has_a_reason() {
        let size = BoardSize {
            columns: 9,
            rows: 6,
        };
        let find = |width: usize, height: usize, pixels: &[u8]| {
            let view = GreyView {
                width,
                height,
                pixels,
            };
            find_board(view, size)
        };
        assert_eq!(find(20, 300, &[9; 20 * 300]), Err(NotFound::NoImage));
        assert_eq!(find(320, 240, &[9; 320 * 240]), Err(NotFound::NoCorners));
        assert_eq!(find(320, 240, &[0; 5]), Err(NotFound::NoImage));
    }
}
