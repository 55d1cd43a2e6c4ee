//! A printed checkerboard.

use nalgebra::Vector3;

/// A printed board of dark and bright squares; the square before its first corner is dark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Board {
    /// Inner corners in a row.
    pub columns: usize,
    /// Rows of inner corners.
    pub rows: usize,
    /// Side of a square, metres.
    pub square_m: f64,
}

impl Board {
    /// Inner corners in the board's own axes, metres: row by row, x along a row, z = 0.
    pub fn corners_m(&self) -> impl Iterator<Item = Vector3<f64>> {
        let (columns, square_m) = (self.columns, self.square_m);
        (0..self.columns * self.rows).map(move |k| {
            Vector3::new(
                square_m * (k % columns) as f64,
                square_m * (k / columns) as f64,
                0.0,
            )
        })
    }
}
