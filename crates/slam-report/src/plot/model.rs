//! A plot as plain values: its frame, its layers, its hints.

use super::colour::Colour;

/// One plot: its frame and what is drawn in it, first layer at the bottom.
///
/// ```
/// use slam_report::{Colour, Layer, Plot};
///
/// let parabola = (0..50).map(|k| (f64::from(k), f64::from(k * k))).collect();
/// let mut plot = Plot::new("Parabola", "x", "y");
/// plot.layers.push(Layer::line("square", Colour::Blue, parabola));
/// assert!(plot.to_svg_file().starts_with("<svg"));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Plot {
    /// Subject of the plot, for screen readers and for a file of its own.
    pub title: String,
    /// Label of the horizontal axis with its unit.
    pub x_label: String,
    /// Label of the vertical axis with its unit.
    pub y_label: String,
    /// Width of the drawing in its own units (pixels at full size).
    pub width: f64,
    /// Height; ignored when `equal_aspect` computes it.
    pub height: f64,
    /// Whether a unit is as long along y as along x; the height then follows from the data.
    pub equal_aspect: bool,
    /// Range of x; `None` takes the range of the layers.
    pub x_range: Option<(f64, f64)>,
    /// Range of y; `None` takes the range of the layers.
    pub y_range: Option<(f64, f64)>,
    /// Size of the text in the drawing's units.
    pub font_size: f64,
    /// The layers, drawn in this order.
    pub layers: Vec<Layer>,
    /// Invisible columns that show a text when the pointer rests on them: (x, text), x increasing.
    pub hints: Vec<(f64, String)>,
}

/// Something drawn between the axes. Points that are not finite interrupt a line.
#[derive(Debug, Clone, PartialEq)]
pub enum Layer {
    /// A line through points.
    Line {
        /// Name in the legend; empty for none.
        label: String,
        /// Its colour.
        colour: Colour,
        /// Width in pixels.
        width: f64,
        /// Drawn in dashes.
        dashed: bool,
        /// (x, y), in order of drawing.
        points: Vec<(f64, f64)>,
    },
    /// The area between two curves.
    Band {
        /// Name in the legend; empty for none.
        label: String,
        /// Its colour, drawn translucent.
        colour: Colour,
        /// (x, low, high), x increasing.
        points: Vec<(f64, f64, f64)>,
    },
    /// Round marks.
    Dots {
        /// Name in the legend; empty for none.
        label: String,
        /// Their colour.
        colour: Colour,
        /// Radius in pixels.
        radius: f64,
        /// (x, y).
        points: Vec<(f64, f64)>,
    },
    /// Outlines in the units of the axes.
    Ellipses {
        /// Name in the legend; empty for none.
        label: String,
        /// Their colour.
        colour: Colour,
        /// The ellipses.
        ellipses: Vec<Ellipse>,
    },
    /// Areas on top of each other.
    Stack {
        /// (name, colour) from the bottom up.
        parts: Vec<(String, Colour)>,
        /// (x, one value per part), x increasing.
        points: Vec<(f64, Vec<f64>)>,
    },
    /// Short ticks along the lower edge.
    Marks {
        /// Name in the legend; empty for none.
        label: String,
        /// Their colour.
        colour: Colour,
        /// Positions along x.
        xs: Vec<f64>,
    },
    /// Stretches of x, over the whole height; one without length is a line.
    Spans {
        /// Name in the legend; empty for none.
        label: String,
        /// Their colour, drawn translucent.
        colour: Colour,
        /// (from, to), in order.
        spans: Vec<(f64, f64)>,
    },
    /// A horizontal line across the whole width.
    Level {
        /// Name in the legend; empty for none.
        label: String,
        /// Its colour.
        colour: Colour,
        /// Position along y.
        y: f64,
    },
    /// An arrowhead at a pose.
    Arrow {
        /// Name in the legend; empty for none.
        label: String,
        /// Its colour.
        colour: Colour,
        /// Position.
        at: (f64, f64),
        /// Heading in radians, from x towards y.
        heading: f64,
    },
}

/// An ellipse by its centre, half axes and the direction of the first one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipse {
    /// Centre.
    pub centre: (f64, f64),
    /// Half axes in the units of the axes.
    pub half_axes: (f64, f64),
    /// Direction of the first half axis, radians from x towards y.
    pub angle: f64,
}

impl Ellipse {
    /// The contour `d^T C^-1 d = sigmas^2` of a planar Gaussian with covariance entries `xx, xy, yy`.
    ///
    /// Eigenvalues in closed form; a covariance that rounding made slightly indefinite gives a flat ellipse.
    pub fn of_covariance(centre: (f64, f64), xx: f64, xy: f64, yy: f64, sigmas: f64) -> Ellipse {
        let mean = 0.5 * (xx + yy);
        let half_difference = (0.5 * (xx - yy)).hypot(xy);
        Ellipse {
            centre,
            half_axes: (
                sigmas * (mean + half_difference).max(0.0).sqrt(),
                sigmas * (mean - half_difference).max(0.0).sqrt(),
            ),
            angle: 0.5 * (2.0 * xy).atan2(xx - yy),
        }
    }
}

impl Layer {
    /// A plain line.
    pub fn line(label: &str, colour: Colour, points: Vec<(f64, f64)>) -> Layer {
        Layer::Line {
            label: label.into(),
            colour,
            width: 1.8,
            dashed: false,
            points,
        }
    }

    /// A dashed line.
    pub fn dashed(label: &str, colour: Colour, points: Vec<(f64, f64)>) -> Layer {
        Layer::Line {
            label: label.into(),
            colour,
            width: 1.6,
            dashed: true,
            points,
        }
    }
}

impl Plot {
    /// An empty plot of 520 by 260 units.
    pub fn new(title: &str, x_label: &str, y_label: &str) -> Plot {
        Plot {
            title: title.into(),
            x_label: x_label.into(),
            y_label: y_label.into(),
            width: 520.0,
            height: 260.0,
            equal_aspect: false,
            x_range: None,
            y_range: None,
            font_size: 12.0,
            layers: Vec::new(),
            hints: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ellipses_of_known_covariances() {
        let upright = Ellipse::of_covariance((1.0, 2.0), 4.0, 0.0, 9.0, 1.0);
        assert!(
            (upright.half_axes.0 - 3.0).abs() < 1e-15 && (upright.half_axes.1 - 2.0).abs() < 1e-15
        );
        assert!((upright.angle.abs() - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
        // Axes 3 and 1 turned by 30 degrees.
        let (sin, cos) = (0.5, 0.75_f64.sqrt());
        let (xx, yy, xy) = (
            9.0 * cos * cos + sin * sin,
            9.0 * sin * sin + cos * cos,
            8.0 * sin * cos,
        );
        let turned = Ellipse::of_covariance((0.0, 0.0), xx, xy, yy, 2.0);
        assert!(
            (turned.half_axes.0 - 6.0).abs() < 1e-12 && (turned.half_axes.1 - 2.0).abs() < 1e-12
        );
        assert!((turned.angle - std::f64::consts::FRAC_PI_6).abs() < 1e-12);
        let indefinite = Ellipse::of_covariance((0.0, 0.0), 1.0, 1.0 + 1e-15, 1.0, 1.0);
        assert!(indefinite.half_axes.1 >= 0.0);
    }
}
