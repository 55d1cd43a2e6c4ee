//! Reprojection errors, coverage and lens, drawn.

use std::fmt::Write as _;

use camera_calibration::CalibrationRun;
use mono_geometry::Distortion;
use nalgebra::Vector2;

use crate::card::card;
use crate::plot::{Colour, Ellipse, Layer, Plot};

/// Cells of the coverage and of the mean residuals, along the longer side.
const CELLS: usize = 12;
/// Length of the longest mean residual in the drawing, in cells.
const LONGEST_ARROW: f64 = 0.9;

/// Scatter, bars per view, field over the image.
pub(super) fn errors(run: &CalibrationRun) -> String {
    format!(
        "<section>\n<h2>Reprojection errors</h2>\n<p class=\"intro\">Corner found in the image minus corner projected by the camera.</p>\n\
         <div class=\"grid\">\n{}{}{}{}</div>\n</section>\n",
        scatter(run),
        bars(run),
        field(run),
        histogram(run)
    )
}

fn residuals(run: &CalibrationRun) -> impl Iterator<Item = Vector2<f64>> + Clone + '_ {
    run.calibration
        .views
        .iter()
        .flat_map(|view| view.residuals_px.iter().copied())
}

fn scatter(run: &CalibrationRun) -> String {
    let mut plot = Plot::new("Every corner", "x error (px)", "y error (px)");
    plot.equal_aspect = true;
    let reach = residuals(run)
        .map(|r| r.amax())
        .filter(|value| value.is_finite())
        .fold(0.05, f64::max)
        * 1.08;
    plot.x_range = Some((-reach, reach));
    plot.y_range = Some((-reach, reach));
    let sigma = run.calibration.rms_px / std::f64::consts::SQRT_2;
    plot.layers.push(Layer::Dots {
        label: "corner".into(),
        colour: Colour::Blue,
        radius: 1.6,
        // Image rows grow downwards.
        points: residuals(run).map(|r| (r.x, -r.y)).collect(),
    });
    let ring = |sigmas: f64| Ellipse {
        centre: (0.0, 0.0),
        half_axes: (sigmas * sigma, sigmas * sigma),
        angle: 0.0,
    };
    plot.layers.push(Layer::Ellipses {
        label: "1, 2, 3 standard deviations".into(),
        colour: Colour::Orange,
        ellipses: vec![ring(1.0), ring(2.0), ring(3.0)],
    });
    card(
        &plot,
        &format!(
            "Standard deviation {sigma:.3} px a coordinate. A round cloud is noise; a stretched or split one is motion blur or a bent board. Up is up in the image."
        ),
        "",
    )
}

fn bars(run: &CalibrationRun) -> String {
    let mut plot = Plot::new("Every view", "view", "RMS error (px)");
    let views = &run.calibration.views;
    let width = (0.62 * plot.width / views.len().max(1) as f64).clamp(1.5, 18.0);
    let mut points = Vec::new();
    for (k, view) in views.iter().enumerate() {
        let x = (k + 1) as f64;
        points.extend([(x, 0.0), (x, view.rms_px), (f64::NAN, f64::NAN)]);
    }
    plot.x_range = Some((0.0, (views.len() + 1) as f64));
    let top = views.iter().map(|view| view.rms_px).fold(0.0, f64::max);
    plot.y_range = Some((0.0, 1.12 * top.max(1e-6)));
    plot.hints = run
        .used()
        .zip(views)
        .enumerate()
        .map(|(k, ((image, _), view))| {
            let text = format!(
                "{}\nRMS {:.3} px, mean {:.3} px",
                run.images[image].name, view.rms_px, view.mean_error_px
            );
            ((k + 1) as f64, text)
        })
        .collect();
    plot.layers.push(Layer::Line {
        label: "view".into(),
        colour: Colour::Blue,
        width,
        dashed: false,
        points,
    });
    plot.layers.push(Layer::Level {
        label: "all views".into(),
        colour: Colour::Orange,
        y: run.calibration.rms_px,
    });
    card(
        &plot,
        "Rest the pointer on a bar for its file. One high bar is a bad image; all high is a bad model or a bad board.",
        "",
    )
}

fn histogram(run: &CalibrationRun) -> String {
    let mut plot = Plot::new("How large the errors are", "distance (px)", "corners");
    let lengths: Vec<f64> = residuals(run).map(|r| r.norm()).collect();
    let rms = run.calibration.rms_px.max(1e-9);
    let (bins, most) = (40, 4.0 * rms);
    let width = most / bins as f64;
    let mut counts = vec![0_usize; bins];
    for length in &lengths {
        counts[((length / width) as usize).min(bins - 1)] += 1;
    }
    let steps: Vec<(f64, f64, f64)> = counts
        .iter()
        .enumerate()
        .flat_map(|(k, &count)| {
            let (low, high) = (k as f64 * width, (k + 1) as f64 * width);
            [(low, 0.0, count as f64), (high, 0.0, count as f64)]
        })
        .collect();
    plot.layers.push(Layer::Band {
        label: "corners".into(),
        colour: Colour::Blue,
        points: steps.clone(),
    });
    plot.layers.push(Layer::line(
        "",
        Colour::Blue,
        steps.iter().map(|step| (step.0, step.2)).collect(),
    ));
    let variance = 0.5 * rms * rms;
    plot.layers.push(Layer::dashed(
        "Gaussian of the same size",
        Colour::Orange,
        (0..=120)
            .map(|k| {
                let r = most * f64::from(k) / 120.0;
                let density = r / variance * (-0.5 * r * r / variance).exp();
                (r, density * width * lengths.len() as f64)
            })
            .collect(),
    ));
    let beyond = lengths.iter().filter(|&&length| length > most).count();
    let mean = run.calibration.mean_error_px;
    card(
        &plot,
        &format!(
            "Mean {mean:.3} px. {beyond} of {} corners beyond four times the RMS (in the last column).",
            lengths.len()
        ),
        "",
    )
}

/// Cells of equal size over the image: (columns, rows, side in pixels).
fn cells(run: &CalibrationRun) -> (usize, usize, f64) {
    let side = run.width.max(run.height) as f64 / CELLS as f64;
    let across = |pixels: usize| (pixels as f64 / side).ceil().max(1.0) as usize;
    (across(run.width), across(run.height), side)
}

fn cell_of(run: &CalibrationRun, corner: [f64; 2]) -> usize {
    let (columns, rows, side) = cells(run);
    let index = |value: f64, most: usize| (((value + 0.5) / side).max(0.0) as usize).min(most - 1);
    index(corner[1], rows) * columns + index(corner[0], columns)
}

/// Share of the cells that hold a corner.
pub(super) fn coverage_share(run: &CalibrationRun) -> f64 {
    let counts = counts(run);
    counts.iter().filter(|&&count| count > 0).count() as f64 / counts.len() as f64
}

fn counts(run: &CalibrationRun) -> Vec<usize> {
    let (columns, rows, _) = cells(run);
    let mut counts = vec![0; columns * rows];
    for (_, board) in run.used() {
        for &corner in &board.corners {
            counts[cell_of(run, corner)] += 1;
        }
    }
    counts
}

/// An element whose units are the image's pixels, around the body given.
fn image_svg(run: &CalibrationRun, label: &str, body: &str) -> String {
    let (width, height) = (run.width as f64, run.height as f64);
    let margin = 0.006 * width;
    format!(
        "<svg class=\"field\" viewBox=\"{:.1} {:.1} {:.1} {:.1}\" role=\"img\" aria-label=\"{label}\" style=\"--px:{:.3}\">{body}\
         <rect class=\"frame\" x=\"-0.5\" y=\"-0.5\" width=\"{width}\" height=\"{height}\"/></svg>",
        -0.5 - margin,
        -0.5 - margin,
        width + 2.0 * margin,
        height + 2.0 * margin,
        width / 520.0
    )
}

fn field(run: &CalibrationRun) -> String {
    let (columns, rows, side) = cells(run);
    let mut sums = vec![(Vector2::zeros(), Vector2::zeros(), 0_usize); columns * rows];
    let mut all = Vec::new();
    for ((_, board), view) in run.used().zip(&run.calibration.views) {
        for (&corner, residual) in board.corners.iter().zip(&view.residuals_px) {
            let entry = &mut sums[cell_of(run, corner)];
            entry.0 += residual;
            entry.1 += Vector2::new(corner[0], corner[1]);
            entry.2 += 1;
            all.push((corner, *residual));
        }
    }
    let means: Vec<(Vector2<f64>, Vector2<f64>)> = sums
        .iter()
        .filter(|entry| entry.2 >= 3)
        .map(|(residual, place, count)| (place / *count as f64, residual / *count as f64))
        .collect();
    let longest = means
        .iter()
        .map(|(_, mean)| mean.norm())
        .fold(1e-6, f64::max);
    let rms = run.calibration.rms_px.max(1e-6);
    let scale = LONGEST_ARROW * side / longest.max(0.3 * rms);
    let (mut thin, mut thick) = (String::new(), String::new());
    for ([x, y], residual) in &all {
        let r = residual * scale;
        if r.norm() < 4.0 * side {
            let _ = write!(thin, "M{x:.1} {y:.1}l{:.1} {:.1}", r.x, r.y);
        }
    }
    for (place, mean) in &means {
        arrow(&mut thick, place, &(mean * scale));
    }
    let svg = image_svg(
        run,
        "Residuals over the image",
        &format!("<path class=\"arrow\" d=\"{thin}\"/><path class=\"mean\" d=\"{thick}\"/>"),
    );
    format!(
        "<figure class=\"card\"><figcaption><h3>Over the image, {scale:.0} times enlarged</h3><p class=\"keys\">\
         <span class=\"key\"><i style=\"--c:var(--blue)\"></i>corner</span><span class=\"key\"><i style=\"--c:var(--red)\"></i>mean of a cell</span></p></figcaption>{svg}\
         <p class=\"note\">Largest mean {longest:.3} px. Red arrows that point the same way in a region are what the lens model cannot describe; noise points everywhere.</p></figure>\n"
    )
}

/// A line with a head, pixels.
fn arrow(path: &mut String, from: &Vector2<f64>, by: &Vector2<f64>) {
    let head = by * 0.3;
    let aside = Vector2::new(-head.y, head.x) * 0.6;
    let (left, right) = (aside - head, -aside - head);
    let _ = write!(
        path,
        "M{:.1} {:.1}l{:.1} {:.1}l{:.1} {:.1}m{:.1} {:.1}l{:.1} {:.1}",
        from.x, from.y, by.x, by.y, left.x, left.y, -left.x, -left.y, right.x, right.y
    );
}

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
