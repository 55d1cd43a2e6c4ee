//! The report of a run: one HTML page that stands alone.
//!
//! Everything is inside the file: style, drawings (SVG) and pictures (PNG as base64). It
//! works without a network, without scripts and on paper; values under the pointer are
//! shown by the browser's own tooltips. It follows the reader's choice of light or dark.
//!
//! Order of the page: key figures, bird's-eye view, errors (when there is a reference),
//! filter health, frames with their keypoints, all figures, configuration. What came from
//! the input (names, notes, configuration) is escaped.

mod birdseye;
mod calibration;
mod charts;
mod figures;
mod pictures;
pub mod plot;
mod units;

use std::fmt::Write as _;

pub use calibration::render_calibration_html;

use crate::output::run_figures;
use crate::record::RunRecord;
use plot::{Plot, escape};

const STYLE: &str = include_str!("page.css");

/// The whole page.
///
/// Size: a few hundred kilobytes, mostly the pictures; long runs are thinned. Time O(frames + landmarks).
/// A record with NaN in it still gives a page: such points are left out.
pub fn render_html(run: &RunRecord) -> String {
    let figures = run_figures(run);
    let name = escape(&run.sequence);
    let mut page = String::with_capacity(1 << 20);
    // Writing into a String cannot fail.
    let _ = write!(
        page,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{name}: mono-slam report</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n<header>\n<p class=\"brand\">mono-slam {}</p>\n<h1>{name}</h1>\n\
         <p class=\"lead\">{}</p>\n</header>\n",
        env!("CARGO_PKG_VERSION"),
        figures::lead(run, &figures)
    );
    page.push_str(&figures::cards(run, &figures));
    if run.frames.is_empty() {
        page.push_str("<p class=\"empty\">The run has no frames.</p>\n");
    } else {
        page.push_str(&birdseye::section(run));
        page.push_str(&charts::error_section(run));
        page.push_str(&charts::health_section(run));
        page.push_str(&pictures::section(run));
    }
    page.push_str(&figures::tables(run, &figures));
    page.push_str("</main>\n</body>\n</html>\n");
    page
}

/// A plot in its card: heading, legend, drawing, and a line of explanation.
fn card(plot: &Plot, note: &str, class: &str) -> String {
    format!(
        "<figure class=\"card {class}\"><figcaption><h3>{}</h3><p class=\"keys\">{}</p></figcaption>{}<p class=\"note\">{note}</p></figure>\n",
        escape(&plot.title),
        plot.legend_html(),
        plot.to_svg()
    )
}
