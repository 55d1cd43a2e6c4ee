//! The keypoints around a place.
//!
//! They are kept in order of their rows. A search takes the rows it reaches by bisection and compares the columns; most
//! searches are a few pixels high, and a frame has some hundred keypoints, which a tree does not serve faster.

use nalgebra::Vector2;

/// Keypoints in order of their rows.
#[derive(Debug)]
pub(crate) struct Nearby {
    rows: Vec<f64>,
    columns: Vec<f64>,
    keypoints: Vec<usize>,
}

impl Nearby {
    /// The pixels that are there, by index. O(n log n).
    #[must_use]
    pub(crate) fn new(pixels: &[Option<Vector2<f64>>]) -> Self {
        let mut order: Vec<(f64, usize)> = pixels
            .iter()
            .enumerate()
            .filter_map(|(k, p)| Some((p.as_ref()?.y, k)))
            .collect();
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Self {
            rows: order.iter().map(|(row, _)| *row).collect(),
            columns: order
                .iter()
                .filter_map(|(_, k)| pixels[*k].map(|p| p.x))
                .collect(),
            keypoints: order.into_iter().map(|(_, k)| k).collect(),
        }
    }

    /// The keypoints in the square around `pixel` that reaches as far as `radius_px`, with their pixels, in no particular
    /// order. O(log n + keypoints in the rows it reaches).
    pub(crate) fn around(
        &self,
        pixel: Vector2<f64>,
        radius_px: f64,
    ) -> impl Iterator<Item = (usize, Vector2<f64>)> {
        let first = self.rows.partition_point(|y| *y < pixel.y - radius_px);
        let last = self.rows.partition_point(|y| *y <= pixel.y + radius_px);
        (first..last.max(first)).filter_map(move |i| {
            let near = (self.columns[i] - pixel.x).abs() <= radius_px;
            near.then(|| {
                (
                    self.keypoints[i],
                    Vector2::new(self.columns[i], self.rows[i]),
                )
            })
        })
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
    }
}
