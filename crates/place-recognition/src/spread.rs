//! How far points are spread over an image.
//!
//! The measure is the number of cells of a grid of 8 x 6 cells over the image that hold a point. A blob smaller than a cell
//! (an eighth of the width, a sixth of the height) lies in at most four cells wherever it is, however many points it has,
//! and one more point elsewhere adds one: neither a variance nor a bounding box says that.

use nalgebra::Vector2;

const COLUMNS: usize = 8;
const ROWS: usize = 6;

/// Number of cells that hold at least one of the pixels, at most 48; pixels outside the image count at its border.
pub(crate) fn occupied_cells<'a>(
    pixels: impl Iterator<Item = &'a Vector2<f64>>,
    width: usize,
    height: usize,
) -> usize {
    let cell = |value: f64, size: usize, cells: usize| {
        // A cast takes NaN to zero and what is too large to the largest.
        let at = ((value + 0.5) / size.max(1) as f64 * cells as f64).max(0.0) as usize;
        at.min(cells - 1)
    };
    let mut occupied = [false; COLUMNS * ROWS];
    for pixel in pixels {
        occupied[cell(pixel.y, height, ROWS) * COLUMNS + cell(pixel.x, width, COLUMNS)] = true;
    }
    occupied.iter().filter(|cell| **cell).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blob_below_the_size_of_a_cell_lies_in_four_cells_at_most() {
        for i in 0..40 {
            let corner = Vector2::new(f64::from(i) * 13.0, f64::from(i) * 9.0);
            let blob: Vec<Vector2<f64>> = (0..100)
                .map(|k| corner + Vector2::new(f64::from(k % 10) * 8.0, f64::from(k / 10) * 8.0))
                .collect();
            let cells = occupied_cells(blob.iter(), 640, 480);
            assert!((1..=4).contains(&cells), "{cells}");
        }
    }

    #[test]
    fn any_pixel_has_a_cell() {
        for pixel in [
            [f64::NAN; 2],
            [f64::INFINITY; 2],
            [-1e300, 1e300],
            [0.0, 0.0],
        ] {
            let pixels = [Vector2::from(pixel)];
            assert_eq!(occupied_cells(pixels.iter(), 640, 480), 1);
            assert_eq!(occupied_cells(pixels.iter(), 0, 0), 1);
        }
    }
}
