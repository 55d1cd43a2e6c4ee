//! The page of a calibration, which stands alone as that of a run does.
//!
//! Order of the page: key figures, doubts, parameters with their standard deviations, reprojection errors, lens and
//! coverage, the views that fit best and worst, all images.

mod coverage_grid;
mod drawings;
mod lens;
mod pictures;
mod tables;

use std::fmt::Write as _;

use camera_calibration::CalibrationRun;
use slam_io::GreyImage;

use crate::card::STYLE;

/// The style that only this page uses.
const MORE_STYLE: &str = include_str!("calibration/page.css");

/// Draws the page. `load` reads an image again for the pictures, given its index in the run; `None` leaves the picture out.
///
/// Size: a few hundred kilobytes. Time O(corners).
pub fn render_calibration_html(
    run: &CalibrationRun,
    load: &dyn Fn(usize) -> Option<GreyImage>,
) -> String {
    let mut page = String::with_capacity(1 << 19);
    // Writing into a String cannot fail.
    let _ = write!(
        page,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>Camera calibration: mono-slam report</title>\n\
         <style>\n{STYLE}{MORE_STYLE}</style>\n</head>\n<body>\n<main>\n<header>\n<p class=\"brand\">mono-slam {}</p>\n\
         <h1>Camera calibration</h1>\n<p class=\"lead\">{}</p>\n</header>\n",
        env!("CARGO_PKG_VERSION"),
        tables::lead(run)
    );
    page.push_str(&tables::cards(run));
    page.push_str(&tables::doubts(run));
    page.push_str(&tables::parameters(run));
    page.push_str(&drawings::errors(run));
    page.push_str(&lens::lens(run));
    page.push_str(&pictures::section(run, load));
    page.push_str(&tables::images(run));
    page.push_str("</main>\n</body>\n</html>\n");
    page
}
