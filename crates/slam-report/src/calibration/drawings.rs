//! Reprojection errors, drawn: scatter, bars per view, histogram, field over the image.

use std::fmt::Write as _;

use camera_calibration::CalibrationRun;
use nalgebra::Vector2;

use super::coverage_grid::{cell_of, cells, image_svg};
use crate::card::card;
use crate::plot::{Colour, Ellipse, Layer, Plot};

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
