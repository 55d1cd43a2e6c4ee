//! The turned square that a descriptor covers: the part of each row of samples that lies inside.

use crate::constants::{DESCRIPTOR_CELLS, MAX_WINDOW_COLUMNS};

/// Half the side of the square in which a sample touches a cell, cells.
pub(super) const REACH_CELLS: f32 = (DESCRIPTOR_CELLS + 1) as f32 / 2.0;

/// Below this slope, in cells for each pixel, a side of the square counts as level: over a whole row it moves by less than
/// a hundred-thousandth of a cell.
const MIN_SLOPE: f32 = 1e-9;

/// The first and the last sample within `reach` of `centre` that have neighbours on both sides.
pub(super) fn inside(centre: f32, reach: f32, length: usize) -> (usize, usize) {
    let first = ((centre - reach).ceil().max(1.0) as usize).min(length - 2);
    let last = ((centre + reach).floor().max(1.0) as usize).min(length - 2);
    (first, last.min(first + MAX_WINDOW_COLUMNS - 1))
}

/// One coordinate of the turned frame along a row of samples, `slope dx + rise dy`, in cells.
#[derive(Debug, Clone, Copy)]
pub(super) struct Side {
    rise: f32,
    /// Zero where the coordinate hardly changes along a row.
    pixels_per_cell: f32,
}

impl Side {
    #[inline(always)]
    pub(super) fn new(slope: f32, rise: f32) -> Self {
        let level = slope.abs() < MIN_SLOPE;
        let pixels_per_cell = if level { 0.0 } else { 1.0 / slope };
        Self {
            rise,
            pixels_per_cell,
        }
    }
}

/// The first and the last column of `left..=right` inside the turned square on the row at `dy`; `None` where the row
/// misses the square.
#[inline(always)]
pub(super) fn interval(
    sides: &[Side; 2],
    x: f32,
    dy: f32,
    left: usize,
    right: usize,
) -> Option<(usize, usize)> {
    let (mut low, mut high) = (left as f32 - x, right as f32 - x);
    for side in sides {
        // |slope dx + base| < REACH
        let base = side.rise * dy;
        if side.pixels_per_cell != 0.0 {
            let a = (-REACH_CELLS - base) * side.pixels_per_cell;
            let b = (REACH_CELLS - base) * side.pixels_per_cell;
            low = low.max(a.min(b));
            high = high.min(a.max(b));
        } else if base.abs() >= REACH_CELLS {
            return None;
        }
    }
    let (first, last) = (
        (x + low).ceil().max(left as f32),
        (x + high).floor().min(right as f32),
    );
    (first <= last).then_some((first as usize, last as usize))
}
