//! A small plot in SVG: lines, bands, dots, ellipses and stacked areas over two axes.
//!
//! No dependency, no script, no font: the text is drawn in the page's own font and the
//! colours are CSS variables with fallbacks, so one drawing serves light pages, dark pages
//! and files of its own. Long lines are thinned to what a screen can show
//! (`thinning`), so that a page with thousands of frames stays small.
//!
//! ```
//! use slam_report::{Colour, Layer, Plot};
//!
//! let parabola = (0..50).map(|k| (f64::from(k), f64::from(k * k))).collect();
//! let mut plot = Plot::new("Parabola", "x", "y");
//! plot.layers.push(Layer::line("square", Colour::Blue, parabola));
//! assert!(plot.to_svg().starts_with("<svg"));
//! ```

mod axis;
mod colour;
mod draw;
mod frame;
mod layers;
mod legend;
mod model;
mod thinning;

pub use colour::Colour;
pub(crate) use draw::Placement;
pub use model::{Ellipse, Layer, Plot};
