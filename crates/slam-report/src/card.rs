//! The pieces that every page is made of: its style, and a plot in its card.

use crate::escape::escape;
use crate::plot::Plot;

/// The style of every page.
pub(crate) const STYLE: &str = include_str!("page.css");

/// A plot in its card: heading, legend, drawing, and a line of explanation.
pub(crate) fn card(plot: &Plot, note: &str, class: &str) -> String {
    format!(
        "<figure class=\"card {class}\"><figcaption><h3>{}</h3><p class=\"keys\">{}</p></figcaption>{}<p class=\"note\">{note}</p></figure>\n",
        escape(&plot.title),
        plot.legend_html(),
        plot.to_svg()
    )
}
