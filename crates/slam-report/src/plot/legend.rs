//! The legend of a plot, as HTML beside it or as SVG inside it.

use std::fmt::Write as _;

use super::colour::Colour;
use super::model::{Layer, Plot};
use crate::escape::escape;

impl Plot {
    /// The legend as HTML: one `<span>` an entry.
    pub(crate) fn legend_html(&self) -> String {
        let mut out = String::new();
        for (label, colour, class) in entries(self) {
            let _ = write!(
                out,
                "<span class=\"key\"><i class=\"{class}\" style=\"--c:{colour}\"></i>{}</span>",
                escape(&label)
            );
        }
        out
    }
}

/// Legend in one row inside the drawing, from `left` on.
pub(super) fn legend_svg(out: &mut String, plot: &Plot, left: f64) {
    let font = plot.font_size;
    let mut x = left;
    for (label, colour, _) in entries(plot) {
        let y = 3.1 * font;
        let _ = write!(
            out,
            "<rect x=\"{x:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"4\" rx=\"2\" fill=\"{colour}\"/><text x=\"{:.1}\" y=\"{y:.1}\" fill=\"{}\">{}</text>",
            y - 0.5 * font,
            1.4 * font,
            x + 1.8 * font,
            Colour::Ink,
            escape(&label)
        );
        // Text is about 0.55 of its size wide a letter.
        x += (2.8 + 0.55 * label.chars().count() as f64) * font;
    }
}

/// (label, colour, shape) of every layer with a name.
fn entries(plot: &Plot) -> Vec<(String, Colour, &'static str)> {
    let mut entries = Vec::new();
    for layer in &plot.layers {
        match layer {
            Layer::Line {
                label,
                colour,
                dashed,
                ..
            } => {
                entries.push((
                    label.clone(),
                    *colour,
                    if *dashed { "dash" } else { "line" },
                ));
            }
            Layer::Band { label, colour, .. } => entries.push((label.clone(), *colour, "band")),
            Layer::Dots { label, colour, .. } => entries.push((label.clone(), *colour, "dot")),
            Layer::Ellipses { label, colour, .. } => entries.push((label.clone(), *colour, "ring")),
            Layer::Stack { parts, .. } => {
                entries.extend(
                    parts
                        .iter()
                        .map(|(label, colour)| (label.clone(), *colour, "area")),
                );
            }
            Layer::Marks { label, colour, .. } => entries.push((label.clone(), *colour, "mark")),
            Layer::Spans { label, colour, .. } => entries.push((label.clone(), *colour, "band")),
            Layer::Level { label, colour, .. } => entries.push((label.clone(), *colour, "dash")),
            Layer::Arrow { label, colour, .. } => entries.push((label.clone(), *colour, "dot")),
        }
    }
    entries.retain(|(label, _, _)| !label.is_empty());
    entries
}
