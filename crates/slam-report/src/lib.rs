//! Report pages of SLAM runs and camera calibrations, and the small plots that they are made of.
//!
//! [`render_run_html`] and [`render_calibration_html`] give one HTML file each that stands alone:
//! style, drawings (SVG) and pictures (JPEG or PNG in base64) are inside it. It works without a network
//! and on paper, and follows the reader's choice of light or dark. The page of a run steps through its frames where
//! scripts run, and is complete without them. Text that came
//! from the input (names, notes, configuration) is escaped.
//!
//! [`Plot`] draws lines, bands, dots, ellipses and stacked areas over two axes, for a page or for
//! an SVG file of its own. Use it for figures that a program writes; use a plotting library for
//! anything interactive, logarithmic or three-dimensional.
//!
//! ```
//! use slam_report::{Colour, Layer, Plot};
//!
//! let parabola = (0..50).map(|k| (f64::from(k), f64::from(k * k))).collect();
//! let mut plot = Plot::new("Parabola", "x", "y");
//! plot.layers.push(Layer::line("square", Colour::Blue, parabola));
//! assert!(plot.to_svg_file().starts_with("<svg"));
//! ```
//!
//! The three types to know are [`Plot`], [`Layer`] and [`Colour`]; the pages take a
//! [`slam_io::RunRecord`] and a [`camera_calibration::CalibrationRun`].

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

/// Compiles and runs the code of the README.
#[doc = include_str!("../README.md")]
#[cfg(doctest)]
pub struct ReadmeDoctests;
