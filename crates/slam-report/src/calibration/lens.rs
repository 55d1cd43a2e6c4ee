//! The coverage of the image by corners, and the curve of the lens, drawn.

use std::fmt::Write as _;

use camera_calibration::CalibrationRun;
use mono_geometry::Distortion;
use nalgebra::Vector2;

use super::coverage_grid::{cells, counts, coverage_share, image_svg};
use crate::card::card;
use crate::plot::{Colour, Layer, Plot};

/// Coverage and distortion curve.
pub(super) fn lens(run: &CalibrationRun) -> String {
    format!(
        "<section>\n<h2>Lens and coverage</h2>\n<div class=\"grid\">\n{}{}</div>\n</section>\n",
        coverage(run),
        distortion(run)
    )
}

fn coverage(run: &CalibrationRun) -> String {
    let (columns, _, side) = cells(run);
    let counts = counts(run);
    let most = counts.iter().copied().max().unwrap_or(1).max(1);
    let mut body = String::new();
    for (k, &count) in counts.iter().enumerate() {
        let (x, y) = (
            (k % columns) as f64 * side - 0.5,
            (k / columns) as f64 * side - 0.5,
        );
        let (width, height) = (
            side.min(run.width as f64 - 0.5 - x),
            side.min(run.height as f64 - 0.5 - y),
        );
        let (class, opacity) = if count == 0 {
            ("cell none", 0.14)
        } else {
            ("cell", 0.08 + 0.42 * (count as f64 / most as f64).sqrt())
        };
        let _ = write!(
            body,
            "<rect class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill-opacity=\"{opacity:.3}\"><title>{count} corners</title></rect>"
        );
    }
    let mut dots = String::new();
    for (_, board) in run.used() {
        for [x, y] in &board.corners {
            let _ = write!(dots, "M{x:.1} {y:.1}h0");
        }
    }
    let pinhole = run.calibration.camera.pinhole();
    let cross = 0.012 * run.width as f64;
    let _ = write!(
        body,
        "<path class=\"corner\" d=\"{dots}\"/><path class=\"centre\" d=\"M{:.1} {:.1}h{d:.1}M{:.1} {:.1}v{d:.1}\"/>",
        pinhole.cx - cross,
        pinhole.cy,
        pinhole.cx,
        pinhole.cy - cross,
        d = 2.0 * cross
    );
    let svg = image_svg(run, "Coverage of the image by corners", &body);
    format!(
        "<figure class=\"card\"><figcaption><h3>Where the corners were</h3><p class=\"keys\"><span class=\"key\"><i class=\"area\" style=\"--c:var(--blue)\"></i>seen</span>\
         <span class=\"key\"><i class=\"area\" style=\"--c:var(--red)\"></i>never</span><span class=\"key\"><i style=\"--c:var(--orange)\"></i>principal point</span></p></figcaption>{svg}\
         <p class=\"note\">{:.0} % of the cells hold a corner. Where none was, the lens is extrapolated.</p></figure>\n",
        100.0 * coverage_share(run)
    )
}

/// How far the lens moves a point, over its distance from the centre in an image without lens.
fn distortion(run: &CalibrationRun) -> String {
    let camera = &run.calibration.camera;
    let pinhole = camera.pinhole();
    let mut plot = Plot::new(
        "What the lens does",
        "distance from the centre without lens (px)",
        "moved outwards (px)",
    );
    let focal = 0.5 * (pinhole.fx + pinhole.fy);
    let corners: Vec<Option<f64>> = [0, 1, 2, 3]
        .iter()
        .map(|k| {
            let x = if k % 2 == 0 {
                -0.5
            } else {
                run.width as f64 - 0.5
            };
            let y = if k / 2 == 0 {
                -0.5
            } else {
                run.height as f64 - 0.5
            };
            Some(camera.undistort(&Vector2::new(x, y)).ok()?.norm())
        })
        .collect();
    let folded = corners.iter().any(Option::is_none);
    let furthest = if folded {
        f64::INFINITY
    } else {
        let reach = run.calibration.max_corner_radius;
        corners.into_iter().flatten().fold(reach, f64::max)
    };
    // Tangential terms differ by direction: the mean over directions is the radial part.
    let moved = |radius: f64| {
        (0..16)
            .map(|k| {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / 16.0).sin_cos();
                let point = Vector2::new(radius * cos, radius * sin);
                let distorted = camera.distortion().distort(&point);
                distorted.dot(&Vector2::new(cos, sin)) - radius
            })
            .sum::<f64>()
            / 16.0
            * focal
    };
    let limit = furthest.min(0.98 * camera.field_radius()).min(6.0);
    let curve = |from: f64, to: f64| -> Vec<(f64, f64)> {
        (0..=100)
            .map(|k| {
                let radius = from + (to - from) * f64::from(k) / 100.0;
                (radius * focal, moved(radius))
            })
            .collect()
    };
    let known = run.calibration.max_corner_radius.min(limit);
    plot.layers.push(Layer::Level {
        label: String::new(),
        colour: Colour::Grey,
        y: 0.0,
    });
    plot.layers.push(Layer::line(
        "seen by corners",
        Colour::Blue,
        curve(0.0, known),
    ));
    if known < limit {
        plot.layers.push(Layer::dashed(
            "extrapolated",
            Colour::Orange,
            curve(known, limit),
        ));
    }
    let note = match camera.distortion() {
        Distortion::None => "The model has no lens.".to_string(),
        _ => format!(
            "Radial part. At the outermost corner the lens moves a point by {} px; negative is towards the centre (barrel).{}",
            format!("{:.1}", moved(known)).replace('-', "\u{2212}"),
            if folded {
                " The model folds over before the corners of the image: pixels there have no ray. Corners of the board closer to them would help."
            } else {
                ""
            }
        ),
    };
    card(&plot, &note, "")
}
