//! From a [`Plot`] to SVG text.

use std::fmt::Write as _;

use super::legend::legend_svg;
use super::{Colour, Ellipse, Layer, Plot, escape, nice_ticks, thin, tick_label};

/// Columns to which long lines are thinned.
const COLUMNS: usize = 600;
/// Limits of the height of a plot with equal aspect, as shares of its width.
const EQUAL_HEIGHTS: (f64, f64) = (0.36, 0.78);

/// Where the data goes: the inner rectangle and the ranges shown in it.
struct Frame {
    left: f64,
    top: f64,
    width: f64,
    height: f64,
    x: (f64, f64),
    y: (f64, f64),
}

impl Frame {
    fn px(&self, x: f64) -> f64 {
        self.left + (x - self.x.0) / (self.x.1 - self.x.0) * self.width
    }

    fn py(&self, y: f64) -> f64 {
        self.top + (self.y.1 - y) / (self.y.1 - self.y.0) * self.height
    }

    fn bottom(&self) -> f64 {
        self.top + self.height
    }

    fn right(&self) -> f64 {
        self.left + self.width
    }
}

/// The whole element. Writing into a `String` cannot fail, so results of `write!` are dropped.
pub(super) fn svg(plot: &Plot, own_file: bool) -> String {
    let (frame, total_height) = layout(plot, own_file);
    let mut out = String::new();
    let clip = format!("clip-{:x}", fingerprint(plot));
    let (width, font) = (plot.width, plot.font_size);
    let _ = write!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"plot\" viewBox=\"0 0 {width:.0} {total_height:.0}\" role=\"img\" \
         aria-label=\"{}\" font-family=\"system-ui,sans-serif\" font-size=\"{font}\">",
        escape(&plot.title)
    );
    if own_file {
        let _ = write!(
            out,
            "<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/><text x=\"{:.1}\" y=\"{:.1}\" font-weight=\"600\" fill=\"{}\">{}</text>",
            frame.left,
            1.5 * font,
            Colour::Ink,
            escape(&plot.title)
        );
        legend_svg(&mut out, plot, frame.left);
    }
    axes(&mut out, plot, &frame);
    let _ = write!(
        out,
        "<clipPath id=\"{clip}\"><rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\"/></clipPath><g clip-path=\"url(#{clip})\">",
        frame.left, frame.top, frame.width, frame.height
    );
    for layer in &plot.layers {
        draw_layer(&mut out, layer, &frame);
    }
    hints(&mut out, plot, &frame);
    out.push_str("</g></svg>");
    out
}

fn layout(plot: &Plot, own_file: bool) -> (Frame, f64) {
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
            Layer::Marks { .. } => {}
            // A level or a mark belongs to whatever x range the data has.
            Layer::Level { y, .. } => cover((f64::NAN, *y)),
            Layer::Arrow { at, .. } => cover(*at),
        }
    }
    range
}

fn axes(out: &mut String, plot: &Plot, frame: &Frame) {
    let font = plot.font_size;
    let x_ticks = nice_ticks(
        frame.x.0,
        frame.x.1,
        (frame.width / (6.5 * font)).round().max(2.0) as usize,
    );
    let y_ticks = nice_ticks(
        frame.y.0,
        frame.y.1,
        (frame.height / (3.6 * font)).round().max(2.0) as usize,
    );
    let step = |ticks: &[f64]| {
        if ticks.len() > 1 {
            ticks[1] - ticks[0]
        } else {
            1.0
        }
    };
    let grid = |out: &mut String, commands: &str| {
        let _ = write!(
            out,
            "<path class=\"grid\" d=\"{commands}\" stroke=\"var(--grid,#e6e9ee)\" fill=\"none\"/>"
        );
    };
    let mut lines = String::new();
    for &x in &x_ticks {
        let _ = write!(
            lines,
            "M{:.1} {:.1}v{:.1}",
            frame.px(x),
            frame.top,
            frame.height
        );
    }
    for &y in &y_ticks {
        let _ = write!(
            lines,
            "M{:.1} {:.1}h{:.1}",
            frame.left,
            frame.py(y),
            frame.width
        );
    }
    grid(out, &lines);
    let _ = write!(out, "<g class=\"ticks\" fill=\"var(--soft,#5b6675)\">");
    for &x in &x_ticks {
        let label = tick_label(x, step(&x_ticks));
        let _ = write!(
            out,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
            frame.px(x),
            frame.bottom() + 1.4 * font
        );
    }
    for &y in &y_ticks {
        let label = tick_label(y, step(&y_ticks));
        let _ = write!(
            out,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
            frame.left - 0.6 * font,
            frame.py(y) + 0.35 * font
        );
    }
    let _ = write!(
        out,
        "<text class=\"axis\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>\
         <text class=\"axis\" transform=\"translate({:.1} {:.1}) rotate(-90)\" text-anchor=\"end\">{}</text></g>",
        frame.right(),
        frame.bottom() + 2.9 * font,
        escape(&plot.x_label),
        1.1 * font,
        frame.top,
        escape(&plot.y_label)
    );
}

fn draw_layer(out: &mut String, layer: &Layer, frame: &Frame) {
    match layer {
        Layer::Line {
            colour,
            width,
            dashed,
            points,
            ..
        } => {
            let dash = if *dashed {
                " stroke-dasharray=\"6 5\""
            } else {
                ""
            };
            let monotone = points.is_sorted_by(|a, b| a.0 <= b.0);
            let thinned = if monotone {
                thin(points, COLUMNS)
            } else {
                strided(points, 4 * COLUMNS)
            };
            let _ = write!(
                out,
                "<path d=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-linejoin=\"round\" stroke-linecap=\"round\"{dash}/>",
                polyline(&thinned, frame)
            );
        }
        Layer::Band { colour, points, .. } => {
            let points = strided(points, COLUMNS);
            let mut path = String::new();
            for (index, &(x, _, high)) in points.iter().enumerate() {
                command(&mut path, index == 0, x, high, frame);
            }
            for &(x, low, _) in points.iter().rev() {
                command(&mut path, false, x, low, frame);
            }
            let _ = write!(
                out,
                "<path d=\"{path}Z\" fill=\"{colour}\" fill-opacity=\".16\"/>"
            );
        }
        Layer::Dots {
            colour,
            radius,
            points,
            ..
        } => {
            // Zero-length strokes with round caps: the shortest way to write many discs.
            let mut path = String::new();
            for &(x, y) in points
                .iter()
                .filter(|point| point.0.is_finite() && point.1.is_finite())
            {
                let (px, py) = (frame.px(x), frame.py(y));
                if px.abs() < 1e6 && py.abs() < 1e6 {
                    let _ = write!(path, "M{px:.1} {py:.1}h0");
                }
            }
            let _ = write!(
                out,
                "<path d=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{}\" stroke-linecap=\"round\" stroke-opacity=\".8\"/>",
                2.0 * radius
            );
        }
        Layer::Ellipses {
            colour, ellipses, ..
        } => {
            let _ = write!(
                out,
                "<g fill=\"{colour}\" fill-opacity=\".10\" stroke=\"{colour}\" stroke-opacity=\".65\">"
            );
            for ellipse in ellipses {
                draw_ellipse(out, ellipse, frame);
            }
            out.push_str("</g>");
        }
        Layer::Stack { parts, points } => {
            let points = strided(points, COLUMNS);
            let sum = |values: &[f64], parts: usize| values.iter().take(parts).sum::<f64>();
            for (index, (_, colour)) in parts.iter().enumerate() {
                let mut path = String::new();
                for (position, (x, values)) in points.iter().enumerate() {
                    command(&mut path, position == 0, *x, sum(values, index + 1), frame);
                }
                for (x, values) in points.iter().rev() {
                    command(&mut path, false, *x, sum(values, index), frame);
                }
                let _ = write!(
                    out,
                    "<path d=\"{path}Z\" fill=\"{colour}\" fill-opacity=\".85\"/>"
                );
            }
        }
        Layer::Marks { colour, xs, .. } => {
            let mut path = String::new();
            for &x in xs {
                let _ = write!(path, "M{:.1} {:.1}v-8", frame.px(x), frame.bottom());
            }
            let _ = write!(
                out,
                "<path d=\"{path}\" stroke=\"{colour}\" stroke-width=\"1.5\" fill=\"none\"/>"
            );
        }
        Layer::Level { colour, y, .. } => {
            let _ = write!(
                out,
                "<path d=\"M{:.1} {:.1}h{:.1}\" stroke=\"{colour}\" stroke-width=\"1.3\" stroke-dasharray=\"3 4\" fill=\"none\"/>",
                frame.left,
                frame.py(*y),
                frame.width
            );
        }
        Layer::Arrow {
            colour,
            at,
            heading,
            ..
        } => {
            let _ = write!(
                out,
                "<path transform=\"translate({:.1} {:.1}) rotate({:.1})\" d=\"M11 0L-8 -7.5L-4 0L-8 7.5Z\" fill=\"{colour}\" stroke=\"var(--card,#fff)\" stroke-width=\"1.5\"/>",
                frame.px(at.0),
                frame.py(at.1),
                -heading.to_degrees()
            );
        }
    }
}

fn draw_ellipse(out: &mut String, ellipse: &Ellipse, frame: &Frame) {
    // The axes may have different scales, so the contour is drawn point by point.
    const CORNERS: usize = 36;
    let (sin, cos) = ellipse.angle.sin_cos();
    let contour: Vec<(f64, f64)> = (0..CORNERS)
        .map(|corner| {
            let (s, c) = (std::f64::consts::TAU * corner as f64 / CORNERS as f64).sin_cos();
            let (a, b) = (ellipse.half_axes.0 * c, ellipse.half_axes.1 * s);
            (
                ellipse.centre.0 + a * cos - b * sin,
                ellipse.centre.1 + a * sin + b * cos,
            )
        })
        .collect();
    let _ = write!(out, "<path d=\"{}Z\"/>", polyline(&contour, frame));
}

/// Every k-th element so that at most about `most` remain, the last one always.
fn strided<T: Clone>(items: &[T], most: usize) -> Vec<T> {
    let stride = items.len().div_ceil(most).max(1);
    let mut kept: Vec<T> = items.iter().step_by(stride).cloned().collect();
    if stride > 1 && !(items.len() - 1).is_multiple_of(stride) {
        kept.extend(items.last().cloned());
    }
    kept
}

fn polyline(points: &[(f64, f64)], frame: &Frame) -> String {
    let mut path = String::new();
    let mut pen_up = true;
    for &(x, y) in points {
        if x.is_finite() && y.is_finite() {
            command(&mut path, pen_up, x, y, frame);
            pen_up = false;
        } else {
            pen_up = true;
        }
    }
    path
}

/// One path command; points far outside are pulled to just outside so that numbers stay short.
fn command(path: &mut String, start: bool, x: f64, y: f64, frame: &Frame) {
    let near = |value: f64| value.clamp(-1e5, 1e5);
    let letter = if start { 'M' } else { 'L' };
    let _ = write!(
        path,
        "{letter}{:.1} {:.1}",
        near(frame.px(x)),
        near(frame.py(y))
    );
}

fn hints(out: &mut String, plot: &Plot, frame: &Frame) {
    if plot.hints.is_empty() {
        return;
    }
    let hints = strided(&plot.hints, 240);
    out.push_str("<g class=\"hits\" fill=\"transparent\">");
    for (index, (x, text)) in hints.iter().enumerate() {
        let here = frame.px(*x);
        let left = index.checked_sub(1).map_or(frame.left, |before| {
            0.5 * (here + frame.px(hints[before].0))
        });
        let right = hints
            .get(index + 1)
            .map_or(frame.right(), |next| 0.5 * (here + frame.px(next.0)));
        let _ = write!(
            out,
            "<rect x=\"{left:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\"><title>{}</title></rect>",
            frame.top,
            (right - left).max(0.0),
            frame.height,
            escape(text)
        );
    }
    out.push_str("</g>");
}

/// A number that differs between the plots of one page, for the id of the clip path (FNV-1a).
fn fingerprint(plot: &Plot) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for byte in plot
        .title
        .bytes()
        .chain(plot.y_label.bytes())
        .chain(plot.layers.len().to_le_bytes())
    {
        hash = (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    }
    hash
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(title: &str) -> Plot {
        let mut plot = Plot::new(title, "x", "y");
        plot.layers.push(Layer::line(
            "way",
            Colour::Blue,
            vec![(0.0, 0.0), (4.0, 1.0), (2.0, 3.0)],
        ));
        plot
    }

    #[test]
    fn equal_aspect_gives_both_axes_the_same_scale() {
        for (x_range, y_range) in [
            ((0.0, 4.0), (0.0, 3.0)),
            ((0.0, 100.0), (0.0, 1.0)),
            ((0.0, 1.0), (0.0, 100.0)),
        ] {
            let mut plot = square("map");
            plot.equal_aspect = true;
            plot.x_range = Some(x_range);
            plot.y_range = Some(y_range);
            let (frame, total) = layout(&plot, false);
            let per_x = frame.width / (frame.x.1 - frame.x.0);
            let per_y = frame.height / (frame.y.1 - frame.y.0);
            assert!((per_x / per_y - 1.0).abs() < 1e-12, "{per_x} {per_y}");
            assert!(
                frame.x.0 <= x_range.0 && frame.x.1 >= x_range.1,
                "{:?}",
                frame.x
            );
            assert!(
                frame.y.0 <= y_range.0 && frame.y.1 >= y_range.1,
                "{:?}",
                frame.y
            );
            assert!(total < plot.width);
        }
    }

    #[test]
    fn corners_of_the_range_are_corners_of_the_frame() {
        let mut plot = square("corners");
        plot.x_range = Some((-1.0, 3.0));
        plot.y_range = Some((10.0, 20.0));
        let (frame, _) = layout(&plot, false);
        assert_eq!(
            (frame.px(-1.0), frame.py(10.0)),
            (frame.left, frame.bottom())
        );
        assert_eq!((frame.px(3.0), frame.py(20.0)), (frame.right(), frame.top));
    }

    #[test]
    fn a_constant_and_an_empty_plot_have_a_range() {
        let mut plot = Plot::new("constant", "x", "y");
        assert!(svg(&plot, false).ends_with("</svg>"));
        for value in [0.0, 1.0, -1e9, 1e300] {
            plot.layers = vec![Layer::line(
                "level",
                Colour::Ink,
                vec![(0.0, value), (1.0, value)],
            )];
            let text = svg(&plot, true);
            assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
        }
    }

    #[test]
    fn points_that_are_not_finite_interrupt_the_line() {
        let (frame, _) = layout(&square("gap"), false);
        let path = polyline(
            &[
                (0.0, 0.0),
                (1.0, f64::NAN),
                (2.0, 1.0),
                (f64::INFINITY, 1.0),
                (3.0, 1.0),
                (4.0, 2.0),
            ],
            &frame,
        );
        assert_eq!(
            (path.matches('M').count(), path.matches('L').count()),
            (3, 1)
        );
    }

    #[test]
    fn thinning_keeps_the_last_element() {
        let items: Vec<usize> = (0..1001).collect();
        let kept = strided(&items, 100);
        assert!(kept.len() <= 102 && kept.last() == Some(&1000));
        assert_eq!(strided(&items, 2000), items);
        assert!(strided::<usize>(&[], 5).is_empty());
    }

    #[test]
    fn a_file_of_its_own_has_title_and_legend() {
        let text = svg(&square("A & B"), true);
        assert!(text.contains(">A &amp; B</text>") && text.contains(">way</text>"));
        let inside = svg(&square("A & B"), false);
        assert!(!inside.contains(">way</text>"));
        assert!(super::super::legend::legend_html(&square("A & B")).contains("way</span>"));
    }
}
