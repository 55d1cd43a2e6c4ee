//! From a grid to the board: which corner is the first.
//!
//! Problem: find a window of `columns` x `rows` corners in the grid, and number it the same way every time.
//!
//! Corners are counted row by row, `index = row * columns + column`; seen from the front, columns run clockwise into
//! rows as x into y in the image, so that the board's z axis points away from the camera and no numbering is mirrored.
//! Turned boards are left, and the colours decide: **the square before the first corner (up and left of it on the
//! board) is dark.** When `columns + rows` is odd, as for 9x6, this leaves one numbering. When it is even (both odd or
//! both even) a half turn changes no colour; of what is left the numbering is taken whose first corner has the smallest x + y in
//! the image, then the smallest x. That choice can change from image to image. It does not matter for the calibration
//! of one camera: a half turn of the board about its centre is another pose of the same board. It does matter
//! for two cameras that look at the same board, or for a board that carries a frame of its own: use an odd sum there.
//!
//! Degenerate: a grid that has no full window is incomplete, one with several windows or with another row that is two
//! thirds full belongs to a larger board; both are refused with what was seen.

use super::grid::{Cell, Grid};
use super::star::Star;
use crate::board::{BoardSize, NotFound};

/// Share of a further row or column that makes the board larger; clutter beside the board rarely fills so much.
const FURTHER_SHARE: f64 = 0.67;

/// Stars in board order.
pub(super) fn numbered(
    size: BoardSize,
    stars: &[Star],
    grid: &Grid,
) -> Result<Vec<usize>, NotFound> {
    let window = window(size, grid)?;
    let mut best: Option<(bool, f64, f64, Vec<usize>)> = None;
    for turned in 0..4 {
        let Some(cells) = window.cells(size, turned) else {
            continue;
        };
        let entries: Vec<(usize, usize)> = cells.iter().map(|cell| grid[cell]).collect();
        let (first, first_turned) = entries[0];
        // The square before the first corner follows the edge of the board's direction 2 (-column).
        let edge = (turned + 2 + 4 - first_turned) % 4;
        let bright = stars[first].bright_after(edge);
        let [x, y] = stars[first].position;
        let order = entries.into_iter().map(|entry| entry.0).collect();
        let key = (bright, x + y, x);
        if best
            .as_ref()
            .is_none_or(|(b, sum, column, _)| key < (*b, *sum, *column))
        {
            best = Some((key.0, key.1, key.2, order));
        }
    }
    best.map(|entry| entry.3).ok_or(NotFound::NoCorners)
}

/// A full rectangle of the grid.
struct Window {
    low: Cell,
    width: i32,
    height: i32,
}

impl Window {
    /// Cells in board order when the board's column direction is grid direction `turned`.
    fn cells(&self, size: BoardSize, turned: usize) -> Option<Vec<Cell>> {
        let (columns, rows) = (size.columns as i32, size.rows as i32);
        let fitting = if turned.is_multiple_of(2) {
            (columns, rows)
        } else {
            (rows, columns)
        };
        if (self.width, self.height) != fitting {
            return None;
        }
        let (right, bottom) = (self.low.0 + self.width - 1, self.low.1 + self.height - 1);
        let cell = |column: i32, row: i32| match turned {
            0 => (self.low.0 + column, self.low.1 + row),
            1 => (right - row, self.low.1 + column),
            2 => (right - column, bottom - row),
            _ => (self.low.0 + row, bottom - column),
        };
        Some(
            (0..rows)
                .flat_map(|row| (0..columns).map(move |column| (column, row)))
                .map(|(column, row)| cell(column, row))
                .collect(),
        )
    }
}

fn window(size: BoardSize, grid: &Grid) -> Result<Window, NotFound> {
    let us = grid.keys().map(|cell| cell.0);
    let vs = grid.keys().map(|cell| cell.1);
    let (Some(u0), Some(u1)) = (us.clone().min(), us.max()) else {
        return Err(NotFound::NoCorners);
    };
    let (Some(v0), Some(v1)) = (vs.clone().min(), vs.max()) else {
        return Err(NotFound::NoCorners);
    };
    let (columns, rows) = (size.columns as i32, size.rows as i32);
    let mut shapes = vec![(columns, rows)];
    if columns != rows {
        shapes.push((rows, columns));
    }
    let mut windows = Vec::new();
    for (width, height) in shapes {
        for low_u in u0..=u1 - width + 1 {
            for low_v in v0..=v1 - height + 1 {
                let full = (low_v..low_v + height)
                    .all(|v| (low_u..low_u + width).all(|u| grid.contains_key(&(u, v))));
                if full {
                    windows.push(Window {
                        low: (low_u, low_v),
                        width,
                        height,
                    });
                }
            }
        }
    }
    let (seen_u, seen_v) = ((u1 - u0 + 1) as usize, (v1 - v0 + 1) as usize);
    let (across, down) = (seen_u.max(seen_v), seen_u.min(seen_v));
    let larger = NotFound::Larger {
        columns: across,
        rows: down,
    };
    let mut windows = windows.into_iter();
    match (windows.next(), windows.next()) {
        (None, _) => Err(NotFound::Incomplete {
            found: grid.len(),
            columns: across,
            rows: down,
        }),
        (Some(_), Some(_)) => Err(larger),
        (Some(window), None) if has_neighbour_row(&window, grid) => Err(larger),
        (Some(window), None) => Ok(window),
    }
}

/// Whether a row or column just outside the window is more than accidentally filled.
fn has_neighbour_row(window: &Window, grid: &Grid) -> bool {
    let (u, v, width, height) = (window.low.0, window.low.1, window.width, window.height);
    let filled = |cells: &mut dyn Iterator<Item = Cell>| {
        cells.filter(|cell| grid.contains_key(cell)).count() as f64
    };
    let rows = [v - 1, v + height];
    let columns = [u - 1, u + width];
    rows.iter().any(|&row| {
        filled(&mut (u..u + width).map(|column| (column, row))) >= FURTHER_SHARE * f64::from(width)
    }) || columns.iter().any(|&column| {
        filled(&mut (v..v + height).map(|row| (column, row))) >= FURTHER_SHARE * f64::from(height)
    })
}
