//! From a [`Plot`] to SVG text.

use std::fmt::Write as _;

use super::axis::{nice_ticks, tick_label};
use super::colour::Colour;
use super::frame::{Frame, layout};
use super::layers::draw_layer;
use super::legend::legend_svg;
use super::model::Plot;
use super::thinning::strided;
use crate::escape::escape;

/// Columns with a tooltip at most.
const HINTS: usize = 120;

impl Plot {
    /// The drawing as one `<svg>` element for a page that shows the legend itself.
    pub fn to_svg(&self) -> String {
        svg(self, false)
    }

    /// Where points lie in the drawing of [`Plot::to_svg`].
    pub(crate) fn placement(&self) -> Placement {
        Placement(layout(self, false).0)
    }

    /// The drawing as a file of its own: white ground, title and legend included.
    pub fn to_svg_file(&self) -> String {
        svg(self, true)
    }
}

/// From the units of the axes to those of the drawing.
pub(crate) struct Placement(Frame);

impl Placement {
    /// Where a point lies.
    pub(crate) fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.0.px(x), self.0.py(y))
    }

    /// How long a unit of x is.
    pub(crate) fn per_unit(&self) -> f64 {
        self.0.width / (self.0.x.1 - self.0.x.0)
    }
}

/// The whole element. Writing into a `String` cannot fail, so results of `write!` are dropped.
fn svg(plot: &Plot, own_file: bool) -> String {
    let (frame, total_height) = layout(plot, own_file);
    let mut out = String::new();
    let clip = format!("clip-{:x}", fingerprint(plot));
    let (width, font) = (plot.width, plot.font_size);
    let _ = write!(
        out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"plot\" viewBox=\"0 0 {width:.0} {total_height:.0}\" role=\"img\" \
         aria-label=\"{}\" data-x=\"{} {} {:.1} {:.1} {:.1} {:.1}\" font-family=\"system-ui,sans-serif\" font-size=\"{font}\">",
        escape(&plot.title),
        frame.x.0,
        frame.x.1,
        frame.left,
        frame.width,
        frame.top,
        frame.height
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

fn hints(out: &mut String, plot: &Plot, frame: &Frame) {
    if plot.hints.is_empty() {
        return;
    }
    let hints = strided(&plot.hints, HINTS);
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
    use super::super::layers::polyline;
    use super::super::model::Layer;
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
        assert!(square("A & B").legend_html().contains("way</span>"));
    }
}
