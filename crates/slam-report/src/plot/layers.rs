//! The layers of a plot as SVG.

use std::fmt::Write as _;

use super::frame::Frame;
use super::model::{Ellipse, Layer};
use super::thinning::{strided, thin};

/// Columns to which long lines are thinned.
const COLUMNS: usize = 600;
pub(super) fn draw_layer(out: &mut String, layer: &Layer, frame: &Frame) {
    match layer {
        Layer::Line {
            colour,
            width,
            dashed,
            points,
            ..
        } => {
            let dash = if *dashed {
                " stroke-dasharray=\"6 5\""
            } else {
                ""
            };
            let monotone = points.is_sorted_by(|a, b| a.0 <= b.0);
            let thinned = if monotone {
                thin(points, COLUMNS)
            } else {
                strided(points, 4 * COLUMNS)
            };
            let _ = write!(
                out,
                "<path d=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" stroke-linejoin=\"round\" stroke-linecap=\"round\"{dash}/>",
                polyline(&thinned, frame)
            );
        }
        Layer::Band { colour, points, .. } => {
            let points = strided(points, COLUMNS);
            let mut path = String::new();
            for (index, &(x, _, high)) in points.iter().enumerate() {
                command(&mut path, index == 0, x, high, frame);
            }
            for &(x, low, _) in points.iter().rev() {
                command(&mut path, false, x, low, frame);
            }
            let _ = write!(
                out,
                "<path d=\"{path}Z\" fill=\"{colour}\" fill-opacity=\".16\"/>"
            );
        }
        Layer::Dots {
            colour,
            radius,
            points,
            ..
        } => {
            // Zero-length strokes with round caps: the shortest way to write many discs.
            let mut path = String::new();
            for &(x, y) in points
                .iter()
                .filter(|point| point.0.is_finite() && point.1.is_finite())
            {
                let (px, py) = (frame.px(x), frame.py(y));
                if px.abs() < 1e6 && py.abs() < 1e6 {
                    let _ = write!(path, "M{px:.1} {py:.1}h0");
                }
            }
            let _ = write!(
                out,
                "<path d=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{}\" stroke-linecap=\"round\" stroke-opacity=\".8\"/>",
                2.0 * radius
            );
        }
        Layer::Ellipses {
            colour, ellipses, ..
        } => {
            let _ = write!(
                out,
                "<g fill=\"{colour}\" fill-opacity=\".10\" stroke=\"{colour}\" stroke-opacity=\".65\">"
            );
            for ellipse in ellipses {
                draw_ellipse(out, ellipse, frame);
            }
            out.push_str("</g>");
        }
        Layer::Stack { parts, points } => {
            let points = strided(points, COLUMNS);
            let sum = |values: &[f64], parts: usize| values.iter().take(parts).sum::<f64>();
            for (index, (_, colour)) in parts.iter().enumerate() {
                let mut path = String::new();
                for (position, (x, values)) in points.iter().enumerate() {
                    command(&mut path, position == 0, *x, sum(values, index + 1), frame);
                }
                for (x, values) in points.iter().rev() {
                    command(&mut path, false, *x, sum(values, index), frame);
                }
                let _ = write!(
                    out,
                    "<path d=\"{path}Z\" fill=\"{colour}\" fill-opacity=\".85\"/>"
                );
            }
        }
        Layer::Marks { colour, xs, .. } => {
            let mut path = String::new();
            for &x in xs {
                let _ = write!(path, "M{:.1} {:.1}v-8", frame.px(x), frame.bottom());
            }
            let _ = write!(
                out,
                "<path d=\"{path}\" stroke=\"{colour}\" stroke-width=\"1.5\" fill=\"none\"/>"
            );
        }
        Layer::Spans { colour, spans, .. } => {
            let mut path = String::new();
            let mut before = f64::NEG_INFINITY;
            for &(from, to) in spans {
                let left = frame.px(from).clamp(frame.left, frame.right());
                let right = frame.px(to).clamp(left, frame.right()).max(left + 1.5);
                // What shares a pixel with the last one cannot be seen beside it.
                if right > before + 1.0 {
                    let _ = write!(
                        path,
                        "M{left:.1} {:.1}h{:.1}v{:.1}h-{:.1}Z",
                        frame.top,
                        right - left,
                        frame.height,
                        right - left
                    );
                    before = right;
                }
            }
            let _ = write!(
                out,
                "<path d=\"{path}\" fill=\"{colour}\" fill-opacity=\".3\"/>"
            );
        }
        Layer::Level { colour, y, .. } => {
            let _ = write!(
                out,
                "<path d=\"M{:.1} {:.1}h{:.1}\" stroke=\"{colour}\" stroke-width=\"1.3\" stroke-dasharray=\"3 4\" fill=\"none\"/>",
                frame.left,
                frame.py(*y),
                frame.width
            );
        }
        Layer::Arrow {
            colour,
            at,
            heading,
            ..
        } => {
            let _ = write!(
                out,
                "<path transform=\"translate({:.1} {:.1}) rotate({:.1})\" d=\"M11 0L-8 -7.5L-4 0L-8 7.5Z\" fill=\"{colour}\" stroke=\"var(--card,#fff)\" stroke-width=\"1.5\"/>",
                frame.px(at.0),
                frame.py(at.1),
                -heading.to_degrees()
            );
        }
    }
}

fn draw_ellipse(out: &mut String, ellipse: &Ellipse, frame: &Frame) {
    // The axes may have different scales, so the contour is drawn point by point.
    const CORNERS: usize = 36;
    let (sin, cos) = ellipse.angle.sin_cos();
    let contour: Vec<(f64, f64)> = (0..CORNERS)
        .map(|corner| {
            let (s, c) = (std::f64::consts::TAU * corner as f64 / CORNERS as f64).sin_cos();
            let (a, b) = (ellipse.half_axes.0 * c, ellipse.half_axes.1 * s);
            (
                ellipse.centre.0 + a * cos - b * sin,
                ellipse.centre.1 + a * sin + b * cos,
            )
        })
        .collect();
    let _ = write!(out, "<path d=\"{}Z\"/>", polyline(&contour, frame));
}

pub(super) fn polyline(points: &[(f64, f64)], frame: &Frame) -> String {
    let mut path = String::new();
    let mut pen_up = true;
    for &(x, y) in points {
        if x.is_finite() && y.is_finite() {
            command(&mut path, pen_up, x, y, frame);
            pen_up = false;
        } else {
            pen_up = true;
        }
    }
    path
}

/// One path command; points far outside are pulled to just outside so that numbers stay short.
fn command(path: &mut String, start: bool, x: f64, y: f64, frame: &Frame) {
    let near = |value: f64| value.clamp(-1e5, 1e5);
    let letter = if start { 'M' } else { 'L' };
    let _ = write!(
        path,
        "{letter}{:.1} {:.1}",
        near(frame.px(x)),
        near(frame.py(y))
    );
}
