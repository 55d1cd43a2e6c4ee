//! Lines with no more points than a screen has columns.

/// At most about `2 * columns` of the points, the lowest and the highest of every column kept.
///
/// Peaks survive, which plain decimation loses. Points must be in order of x; O(points).
pub(super) fn thin(points: &[(f64, f64)], columns: usize) -> Vec<(f64, f64)> {
    if columns == 0 || points.len() <= 2 * columns {
        return points.to_vec();
    }
    let mut kept = Vec::with_capacity(2 * columns + 2);
    for column in 0..columns {
        let from = column * points.len() / columns;
        let to = (column + 1) * points.len() / columns;
        let bucket = &points[from..to];
        let by_height = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        if let (Some(low), Some(high)) = (
            bucket.iter().min_by(by_height),
            bucket.iter().max_by(by_height),
        ) {
            let (first, second) = if low.0 <= high.0 {
                (low, high)
            } else {
                (high, low)
            };
            kept.push(*first);
            if first != second {
                kept.push(*second);
            }
        }
    }
    kept
}

/// Every k-th element so that at most about `most` remain, the last one always.
pub(super) fn strided<T: Clone>(items: &[T], most: usize) -> Vec<T> {
    let stride = items.len().div_ceil(most).max(1);
    let mut kept: Vec<T> = items.iter().step_by(stride).cloned().collect();
    if stride > 1 && !(items.len() - 1).is_multiple_of(stride) {
        kept.extend(items.last().cloned());
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lonely_peak_survives() {
        let mut points: Vec<_> = (0..10_000).map(|k| (f64::from(k), 0.0)).collect();
        points[4321].1 = 5.0;
        points[8765].1 = -3.0;
        let thinned = thin(&points, 100);
        assert!(thinned.len() <= 200);
        assert!(thinned.contains(&(4321.0, 5.0)) && thinned.contains(&(8765.0, -3.0)));
        assert!(thinned.is_sorted_by(|a, b| a.0 <= b.0));
        assert_eq!(thin(&points[..150], 100), points[..150]);
    }
}
