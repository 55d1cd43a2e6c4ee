//! The page of a run: key figures, frame by frame beside the map from above, errors where there is a reference, the
//! health of the filter, frames with their keypoints, all figures, the configuration.

use std::fmt::Write as _;

use slam_io::{RunRecord, run_figures};

use crate::card::STYLE;
use crate::escape::escape;
use crate::{birdseye, charts, figures, pictures, player};

/// Bytes that the frames may fill the page to.
const MOST_BYTES: usize = 999_000;

/// Draws the page of a run.
///
/// Size: at most a megabyte, whatever the run, unless its notes and configuration alone have more; pictures, rows and
/// lines are thinned to that. Time O(frames + landmarks).
/// Points that are not finite are left out.
pub fn render_run_html(run: &RunRecord) -> String {
    let figures = run_figures(run);
    let name = escape(&run.sequence);
    let mut page = String::with_capacity(1 << 20);
    let mut view = None;
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
    page.push_str(&warnings(run));
    page.push_str(&figures::cards(run, &figures));
    if run.frames.is_empty() {
        page.push_str("<p class=\"empty\">The run has no frames.</p>\n");
    } else {
        let (map, map_view) = birdseye::section(run);
        let _ = write!(
            page,
            "<div class=\"watch\">\n{}{map}</div>\n",
            player::elements()
        );
        view = Some(map_view);
        page.push_str(&charts::error_section(run));
        page.push_str(&charts::health_section(run));
        page.push_str(&pictures::section(run));
    }
    page.push_str(&figures::tables(run, &figures));
    page.push_str("</main>\n");
    if let Some(view) = view {
        let room = MOST_BYTES.saturating_sub(page.len());
        page.push_str(&player::script(run, &view, room));
    }
    page.push_str("</body>\n</html>\n");
    page
}

/// The banner that names every warning; nothing when there is none.
fn warnings(run: &RunRecord) -> String {
    if run.warnings.is_empty() {
        return String::new();
    }
    let mut list = String::from(
        "<section class=\"warnings\" role=\"alert\">\n<h2>Before you believe this run</h2>\n<ul>\n",
    );
    for warning in &run.warnings {
        let _ = writeln!(
            list,
            "<li>{} <code>{}</code></li>",
            escape(&warning.message),
            escape(&warning.name)
        );
    }
    list.push_str("</ul>\n</section>\n");
    list
}
