//! Selection of the strongest of many points, everywhere or cell by cell.

/// Keeps the `limit` items of strongest response and leaves them sorted by `key`, which also decides between equal
/// responses: the lower key stays. O(n + limit log limit).
pub(crate) fn keep_strongest<T, K: Ord>(
    items: &mut Vec<T>,
    limit: usize,
    response: impl Fn(&T) -> f32,
    key: impl Fn(&T) -> K,
) {
    if items.len() <= limit {
        return;
    }
    items.select_nth_unstable_by(limit, |a, b| {
        response(b)
            .total_cmp(&response(a))
            .then_with(|| key(a).cmp(&key(b)))
    });
    items.truncate(limit);
    items.sort_unstable_by_key(key);
}

/// Features that a cell of the grid should have.
const FEATURES_A_CELL: usize = 4;
/// Most columns or rows of the grid.
const MOST_CELLS: usize = 512;

/// A grid of cells, nearly square, over an image.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grid {
    columns: usize,
    rows: usize,
    columns_per_pixel: f32,
    rows_per_pixel: f32,
}

impl Grid {
    /// Cells of which each has its share of `limit` features.
    pub(crate) fn new(width: usize, height: usize, limit: usize) -> Self {
        let cells = limit.div_ceil(FEATURES_A_CELL) as f64;
        let side = (width as f64 * height as f64 / cells).sqrt();
        let along = |pixels: usize| ((pixels as f64 / side).round() as usize).clamp(1, MOST_CELLS);
        let (columns, rows) = (along(width), along(height));
        Self {
            columns,
            rows,
            columns_per_pixel: columns as f32 / width as f32,
            rows_per_pixel: rows as f32 / height as f32,
        }
    }

    /// The cell of a position in input pixels.
    pub(crate) fn cell(&self, x: f32, y: f32) -> u32 {
        // Negative numbers become 0.
        let column = (((x + 0.5) * self.columns_per_pixel) as usize).min(self.columns - 1);
        let row = (((y + 0.5) * self.rows_per_pixel) as usize).min(self.rows - 1);
        (row * self.columns + column) as u32
    }
}

/// Keeps `limit` items of which each cell gives its strongest first, the cells in turn, and leaves them sorted by `key`, which
/// also decides between equal responses: the lower key stays. O(n log n).
pub(crate) fn keep_spread<T: Copy, K: Ord>(
    items: &mut Vec<T>,
    limit: usize,
    response: impl Fn(&T) -> f32,
    key: impl Fn(&T) -> K,
    cell: impl Fn(&T) -> u32,
) {
    if items.len() <= limit {
        return;
    }
    let stronger = |a: &T, b: &T| {
        response(b)
            .total_cmp(&response(a))
            .then_with(|| key(a).cmp(&key(b)))
    };
    items.sort_unstable_by(|a, b| cell(a).cmp(&cell(b)).then_with(|| stronger(a, b)));
    // The place of each item among those of its cell.
    let mut placed: Vec<(u32, T)> = Vec::with_capacity(items.len());
    let mut before = None;
    let mut turn = 0;
    for item in items.iter() {
        let here = cell(item);
        turn = if before == Some(here) { turn + 1 } else { 0 };
        before = Some(here);
        placed.push((turn, *item));
    }
    placed.sort_unstable_by(|(i, a), (j, b)| i.cmp(j).then_with(|| stronger(a, b)));
    items.clear();
    items.extend(placed[..limit].iter().map(|(_, item)| *item));
    items.sort_unstable_by_key(key);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_take_turns_by_the_strength_of_what_they_offer() {
        // (cell, response, key)
        let mut items = vec![
            (0, 9.0_f32, 0),
            (0, 8.0, 1),
            (0, 7.0, 2),
            (1, 1.0, 3),
            (2, 2.0, 4),
            (2, 1.5, 5),
        ];
        let keep = |items: &mut Vec<(u32, f32, i32)>, limit| {
            keep_spread(items, limit, |i| i.1, |i| i.2, |i| i.0);
            items.iter().map(|i| i.2).collect::<Vec<_>>()
        };
        assert_eq!(keep(&mut items.clone(), 2), [0, 4]);
        assert_eq!(keep(&mut items.clone(), 4), [0, 1, 3, 4]);
        assert_eq!(keep(&mut items, 5), [0, 1, 3, 4, 5]);
        let grid = Grid::new(320, 240, 48);
        assert_eq!((grid.columns, grid.rows), (4, 3));
        assert_eq!(grid.cell(-3.0, -3.0), 0);
        assert_eq!(grid.cell(1e9, 1e9), 11);
        assert_eq!((grid.cell(79.4, 0.0), grid.cell(79.6, 0.0)), (0, 1));
        let whole = Grid::new(16, 32_767, usize::MAX);
        assert!(whole.cell(8.0, 1e4) < (MOST_CELLS * MOST_CELLS) as u32);
    }

    #[test]
    fn the_strongest_stay_in_order_and_ties_go_to_the_lower_key() {
        let mut items = vec![(4, 1.0_f32), (1, 3.0), (3, 2.0), (0, 2.0), (2, 5.0)];
        keep_strongest(&mut items, 3, |item| item.1, |item| item.0);
        assert_eq!(items, [(0, 2.0), (1, 3.0), (2, 5.0)]);
        // A limit that nothing exceeds leaves the order as it was.
        let mut few = vec![(7, 1.0_f32), (5, 2.0)];
        keep_strongest(&mut few, 2, |item| item.1, |item| item.0);
        assert_eq!(few, [(7, 1.0), (5, 2.0)]);
    }
}
