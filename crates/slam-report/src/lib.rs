#![doc = include_str!("../README.md")]
//!
//! ## Where to begin
//!
//! [`render_run_html`], [`render_comparison_html`] and [`render_calibration_html`] give one HTML file each that stands alone:
//! style, drawings (SVG) and pictures (JPEG or PNG in base64) are inside it. It works without a network and on paper, and
//! follows the reader's choice of light or dark. Text that came from the input (names, notes, configuration) is escaped. The
//! pages take a [`slam_io::RunRecord`] and a [`camera_calibration::CalibrationRun`]; [`Plot`], [`Layer`] and [`Colour`] draw.

mod birdseye;
mod calibration;
mod card;
mod charts;
mod comparison_page;
mod escape;
mod events;
mod figures;
mod keypoint_marks;
mod pictures;
mod player;
mod plot;
mod run_page;
mod units;

pub use calibration::render_calibration_html;
pub use comparison_page::render_comparison_html;
pub use plot::{Colour, Ellipse, Layer, Plot};
pub use run_page::render_run_html;
