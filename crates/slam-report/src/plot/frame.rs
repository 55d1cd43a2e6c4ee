//! The frame of a plot: the inner rectangle and the ranges of the data shown in it.

use super::model::{Layer, Plot};

/// Limits of the height of a plot with equal aspect, as shares of its width.
const EQUAL_HEIGHTS: (f64, f64) = (0.36, 0.78);

/// Where the data goes: the inner rectangle and the ranges shown in it.
pub(super) struct Frame {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) x: (f64, f64),
    pub(super) y: (f64, f64),
}

impl Frame {
    pub(super) fn px(&self, x: f64) -> f64 {
        self.left + (x - self.x.0) / (self.x.1 - self.x.0) * self.width
    }

    pub(super) fn py(&self, y: f64) -> f64 {
        self.top + (self.y.1 - y) / (self.y.1 - self.y.0) * self.height
    }

    pub(super) fn bottom(&self) -> f64 {
        self.top + self.height
    }

    pub(super) fn right(&self) -> f64 {
        self.left + self.width
    }
}

pub(super) fn layout(plot: &Plot, own_file: bool) -> (Frame, f64) {
    let font = plot.font_size;
    let left = 4.6 * font;
    let top = if own_file { 4.2 * font } else { 0.8 * font };
    let (right_margin, bottom_margin) = (1.2 * font, 3.4 * font);
    let width = (plot.width - left - right_margin).max(1.0);
    let mut x = opened(
        plot.x_range.unwrap_or_else(|| range(plot, |point| point.0)),
        plot.x_range.is_none() && plot.equal_aspect,
    );
    let mut y = opened(
        plot.y_range.unwrap_or_else(|| range(plot, |point| point.1)),
        plot.y_range.is_none(),
    );
    let height = if plot.equal_aspect {
        let wanted = width * (y.1 - y.0) / (x.1 - x.0);
        let height = wanted.clamp(EQUAL_HEIGHTS.0 * width, EQUAL_HEIGHTS.1 * width);
        // Widen the axis that has room to spare until a metre is as long on both.
        let per_unit = (width / (x.1 - x.0)).min(height / (y.1 - y.0));
        x = widened(x, width / per_unit);
        y = widened(y, height / per_unit);
        height
    } else {
        (plot.height - top - bottom_margin).max(1.0)
    };
    let frame = Frame {
        left,
        top,
        width,
        height,
        x,
        y,
    };
    let total = top + height + bottom_margin;
    (frame, total)
}

fn widened(range: (f64, f64), length: f64) -> (f64, f64) {
    let middle = 0.5 * (range.0 + range.1);
    (middle - 0.5 * length, middle + 0.5 * length)
}

/// A range of positive length, with a little air when it came from data.
fn opened((low, high): (f64, f64), air: bool) -> (f64, f64) {
    let span = high - low;
    if !span.is_finite() {
        return (0.0, 1.0);
    }
    // So narrow that rounding would show: open it by hand.
    let floor = 1e-9 * low.abs().max(high.abs()).max(1e-3);
    if span <= floor {
        let half = 0.05 * low.abs().max(high.abs()).max(1.0);
        return (low - half, high + half);
    }
    if !air {
        return (low, high);
    }
    // A quantity that starts at zero keeps zero on the axis.
    let below = if low == 0.0 { 0.0 } else { 0.06 * span };
    (low - below, high + 0.06 * span)
}

/// Smallest range holding the finite values of every layer.
fn range(plot: &Plot, pick: impl Fn((f64, f64)) -> f64) -> (f64, f64) {
    let mut range = (f64::INFINITY, f64::NEG_INFINITY);
    let mut cover = |point: (f64, f64)| {
        let value = pick(point);
        if value.is_finite() {
            range = (range.0.min(value), range.1.max(value));
        }
    };
    for layer in &plot.layers {
        match layer {
            Layer::Line { points, .. } | Layer::Dots { points, .. } => {
                points.iter().copied().for_each(&mut cover);
            }
            Layer::Band { points, .. } => {
                for &(x, low, high) in points {
                    cover((x, low));
                    cover((x, high));
                }
            }
            Layer::Ellipses { ellipses, .. } => {
                ellipses.iter().for_each(|ellipse| cover(ellipse.centre));
            }
            Layer::Stack { points, .. } => {
                for (x, values) in points {
                    cover((*x, 0.0));
                    cover((*x, values.iter().sum()));
                }
            }
            Layer::Marks { .. } | Layer::Spans { .. } => {}
            // A level or a mark belongs to whatever x range the data has.
            Layer::Level { y, .. } => cover((f64::NAN, *y)),
            Layer::Arrow { at, .. } => cover(*at),
        }
    }
    range
}
