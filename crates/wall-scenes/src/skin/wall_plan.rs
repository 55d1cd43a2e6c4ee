//! A whole wall as one skin: materials by stretch, soft shadows, sheets, cables.

use super::canvas::Canvas;
use super::draw::{between, chance, pick};
use super::sheet::sheet_canvas;
use super::surface::{Material, wall};
use rand_chacha::ChaCha8Rng;

/// The things on a wall's own surface; rectangles are [left, low, right, high] in s and h, metres.
#[derive(Debug, Clone, Default)]
pub(crate) struct WallPlan {
    pub(crate) stretches: Vec<(f64, f64, Material)>,
    covered: Vec<([f64; 4], f64)>,
    sheets: Vec<([f64; 4], f64)>,
    cables: Vec<Vec<[f64; 2]>>,
}

impl WallPlan {
    /// Something stands before the wall here and throws a shadow `reach` metres beyond.
    pub(crate) fn cover(&mut self, bounds: [f64; 4], reach: f64) {
        self.covered.push((bounds, reach));
    }

    /// Whether nothing covers this rectangle yet.
    pub(crate) fn is_free(&self, [left, low, right, high]: [f64; 4]) -> bool {
        let apart = |b: &[f64; 4]| right < b[0] || left > b[2] || high < b[1] || low > b[3];
        self.covered.iter().all(|(b, _)| apart(b)) && self.sheets.iter().all(|(b, _)| apart(b))
    }

    /// Hangs sheets in the free places of a stretch, large ones first.
    pub(crate) fn hang_sheets(&mut self, [s0, s1]: [f64; 2], height: f64, rng: &mut ChaCha8Rng) {
        for attempt in 0..40_u32 {
            let largest = match attempt {
                0..10 => 0.75,
                10..25 => 0.42,
                _ => 0.2,
            };
            let w = between(rng, 0.35 * largest, largest);
            let h = (w * between(rng, 0.6, 1.45)).min(1.0);
            if s0 + w + 0.04 > s1 {
                continue;
            }
            let left = between(rng, s0 + 0.02, s1 - w - 0.02);
            let low = between(rng, 0.05, (height - 0.4 - h).max(0.06));
            let bounds = [left, low, left + w, low + h];
            if self.is_free(bounds) {
                let angle = if chance(rng, 0.6) {
                    0.0
                } else {
                    between(rng, -0.05, 0.05)
                };
                self.sheets.push((bounds, angle));
            }
        }
    }

    /// Cables that sag along the wall.
    pub(crate) fn lay_cables(&mut self, length: f64, rng: &mut ChaCha8Rng) {
        for _ in 0..(length * 0.8).ceil() as usize {
            let start = between(rng, 0.0, length);
            let span = between(rng, 0.5, 1.6) * if chance(rng, 0.5) { 1.0 } else { -1.0 };
            let from = between(rng, 0.2, 1.7);
            let to = between(rng, 0.2, 1.7);
            let sag = between(rng, 0.05, 0.35);
            let points = (0..=24)
                .map(|k| {
                    let t = f64::from(k) / 24.0;
                    let h = from + (to - from) * t - 4.0 * sag * t * (1.0 - t);
                    [start + span * t, h]
                })
                .collect();
            self.cables.push(points);
        }
    }

    /// Paints the wall.
    pub(super) fn canvas(&self, width_m: f64, height_m: f64, rng: &mut ChaCha8Rng) -> Canvas {
        let mut canvas = Canvas::new(width_m, height_m, 0.6);
        for &(s0, s1, material) in &self.stretches {
            let mut part = Canvas::new(s1 - s0, height_m, 0.5);
            wall(&mut part, rng, material);
            canvas.paste(&part, s0, 0.0, 0.0);
        }
        for &([left, low, right, high], angle) in &self.sheets {
            let shade = [
                left + 0.006,
                height_m - high + 0.008,
                right + 0.008,
                height_m - low + 0.01,
            ];
            canvas.paint(shade, |_, _, old| Some(old * 0.7));
            let sheet = sheet_canvas(right - left, high - low, rng);
            canvas.paste(&sheet, left, height_m - high, angle);
        }
        for cable in &self.cables {
            let tone = if pick(rng, 3) == 0 {
                between(rng, 0.7, 0.9)
            } else {
                between(rng, 0.05, 0.3)
            };
            let thickness = between(rng, 0.007, 0.014);
            for pair in cable.windows(2) {
                let [a, b] = [pair[0], pair[1]].map(|[s, h]| [s, height_m - h]);
                canvas.stroke(a, b, thickness, tone);
            }
        }
        for &([left, low, right, high], reach) in &self.covered {
            // Light comes from above and the left.
            let (x0, x1) = (left + 0.2 * reach, right + 0.5 * reach);
            let (y0, y1) = (height_m - high + 0.3 * reach, height_m - low + 0.9 * reach);
            canvas.paint(
                [x0 - reach, y0 - reach, x1 + reach, y1 + reach],
                |x, y, old| {
                    let outside_x = (x0 - x).max(x - x1).max(0.0);
                    let outside_y = (y0 - y).max(y - y1).max(0.0);
                    let away = outside_x.hypot(outside_y) / reach;
                    (away < 1.0).then_some(old * (1.0 - 0.35 * (1.0 - away)))
                },
            );
        }
        canvas
    }
}
