//! The keypoints around a place.
//!
//! A grid over the smallest rectangle that holds them, with about one keypoint a cell and the keypoints in order of the
//! cells: a search takes one run of neighbours from each row of cells that it reaches.

use nalgebra::Vector2;

/// Cells of equal size over a rectangle.
#[derive(Debug)]
struct Grid {
    corner: Vector2<f64>,
    cells_per_px: Vector2<f64>,
    columns: usize,
    rows: usize,
}

impl Grid {
    /// About as many cells as `pixels` over the rectangle that holds them, as square as it allows.
    fn around(pixels: &[(usize, Vector2<f64>)]) -> Self {
        let first = pixels.first().map_or_else(Vector2::zeros, |(_, p)| *p);
        let (low, high) = pixels.iter().fold((first, first), |(low, high), (_, p)| {
            (low.inf(p), high.sup(p))
        });
        let extent = (high - low).map(|v| v.max(1.0));
        let count = pixels.len().max(1) as f64;
        let columns = (count * extent.x / extent.y)
            .sqrt()
            .ceil()
            .clamp(1.0, count);
        let rows = (count / columns).ceil();
        Self {
            corner: low,
            cells_per_px: Vector2::new(columns / extent.x, rows / extent.y),
            columns: columns as usize,
            rows: rows as usize,
        }
    }

    /// Column and row of the cell of a place, of the nearest cell for a place outside.
    fn cell(&self, p: &Vector2<f64>) -> [usize; 2] {
        let at = (p - self.corner).component_mul(&self.cells_per_px);
        // A cast of a float keeps to the range of the integer.
        [
            (at.x as usize).min(self.columns - 1),
            (at.y as usize).min(self.rows - 1),
        ]
    }
}

/// Keypoints in order of their cells.
#[derive(Debug)]
pub(crate) struct Nearby {
    grid: Grid,
    /// Where each cell begins in `keypoints`, row by row, and the end.
    starts: Vec<usize>,
    keypoints: Vec<(usize, Vector2<f64>)>,
}

impl Nearby {
    /// The pixels that are there, by index. O(n log n).
    #[must_use]
    pub(crate) fn new(pixels: &[Option<Vector2<f64>>]) -> Self {
        let mut keypoints: Vec<_> = pixels
            .iter()
            .enumerate()
            .filter_map(|(k, p)| Some((k, p.filter(|p| p.iter().all(|v| v.is_finite()))?)))
            .collect();
        let grid = Grid::around(&keypoints);
        let cell_of = |p: &Vector2<f64>| {
            let [column, row] = grid.cell(p);
            row * grid.columns + column
        };
        keypoints.sort_by_cached_key(|(_, p)| cell_of(p));
        let mut starts = vec![0; grid.columns * grid.rows + 1];
        for (_, p) in &keypoints {
            starts[cell_of(p) + 1] += 1;
        }
        for cell in 1..starts.len() {
            starts[cell] += starts[cell - 1];
        }
        Self {
            grid,
            starts,
            keypoints,
        }
    }

    /// The keypoints in the square around `pixel` that reaches as far as `radius_px`, with their pixels, in no particular
    /// order. O(rows of cells that it reaches + keypoints in them).
    pub(crate) fn around(
        &self,
        pixel: Vector2<f64>,
        radius_px: f64,
    ) -> impl Iterator<Item = (usize, Vector2<f64>)> {
        let reach = Vector2::repeat(radius_px);
        let [left, top] = self.grid.cell(&(pixel - reach));
        let [right, bottom] = self.grid.cell(&(pixel + reach));
        (top..=bottom)
            .flat_map(move |row| {
                let row = row * self.grid.columns;
                &self.keypoints[self.starts[row + left]..self.starts[row + right + 1]]
            })
            .filter(move |(_, p)| (p - pixel).amax() <= radius_px)
            .copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_in_the_square_are_found_and_no_others() {
        let mut state = 1_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 40) as f64 / f64::from(1 << 24)
        };
        let pixels: Vec<Option<Vector2<f64>>> = (0..500)
            .map(|k| (k % 7 != 0).then(|| Vector2::new(320.0 * uniform(), 240.0 * uniform())))
            .collect();
        let nearby = Nearby::new(&pixels);
        for radius in [0.0, 3.0, 40.0, 1e3, f64::INFINITY] {
            let centre = Vector2::new(320.0 * uniform(), 240.0 * uniform());
            let mut found: Vec<_> = nearby.around(centre, radius).collect();
            found.sort_unstable_by_key(|f| f.0);
            let expected: Vec<_> = pixels
                .iter()
                .enumerate()
                .filter_map(|(k, p)| Some((k, (*p)?)))
                .filter(|(_, p)| (p - centre).amax() <= radius)
                .collect();
            assert_eq!(found, expected, "{radius}");
        }
        assert_eq!(nearby.around(Vector2::zeros(), f64::NAN).count(), 0);
        let nothing = Nearby::new(&[None, Some(Vector2::repeat(f64::NAN))]);
        assert_eq!(nothing.around(Vector2::zeros(), f64::INFINITY).count(), 0);
        let one = Nearby::new(&[None, Some(Vector2::new(1e300, -3.0))]);
        assert_eq!(one.around(Vector2::zeros(), f64::INFINITY).count(), 1);
    }
}
