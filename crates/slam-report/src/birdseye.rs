//! The map from above: paths, landmarks by uncertainty, pose covariance.

use std::fmt::Write as _;

use mono_geometry::Se2;
use slam_io::{RunRecord, RunScale, uncertainty_m};
use trajectory_eval::{Alignment, absolute_error, spatial};

use crate::card::card;
use crate::player::View;
use crate::plot::{Colour, Ellipse, Layer, Plot};
use crate::{events, units};

/// Landmarks drawn at most; more of them hide each other.
const MOST_LANDMARKS: usize = 4000;
/// Steps of the uncertainty scale.
const SHADES: usize = 10;
/// Ellipses along the path.
const ELLIPSES: usize = 16;
/// Share of landmarks on either side that does not stretch the view.
const STRAY_SHARE: f64 = 0.03;

/// The section with the bird's-eye view, and where it shows poses.
pub(super) fn section(run: &RunRecord) -> (String, View) {
    let reference = reference(run);
    let mut plot = match run.scale {
        RunScale::Metric => Plot::new("Bird’s-eye view", "x (m)", "y (m)"),
        RunScale::Arbitrary => Plot::new("Bird’s-eye view", "x (units)", "y (units)"),
    };
    plot.width = 1100.0;
    plot.equal_aspect = true;
    plot.font_size = 13.0;
    let (x_range, y_range) = view(run, &reference);
    plot.x_range = Some(x_range);
    plot.y_range = Some(y_range);

    let scale = uncertainty_scale(run);
    if let Some(scale) = &scale {
        landmarks(run, scale, &mut plot);
    }
    let path = |poses: &mut dyn Iterator<Item = Se2>| {
        poses.map(|pose| (pose.x, pose.y)).collect::<Vec<_>>()
    };
    if !run.dead_reckoning.is_empty() {
        let points = path(&mut run.dead_reckoning.iter().copied());
        plot.layers
            .push(Layer::dashed("dead reckoning", Colour::Orange, points));
    }
    if !reference.is_empty() {
        plot.layers.push(Layer::Line {
            label: match run.scale {
                RunScale::Metric => "reference".into(),
                RunScale::Arbitrary => "reference, turned and scaled".into(),
            },
            colour: Colour::Green,
            width: 6.0,
            dashed: false,
            points: reference,
        });
    }
    let magnified = ellipses(run, &mut plot, x_range);
    plot.layers.push(Layer::Line {
        label: "estimate".into(),
        colour: Colour::Blue,
        width: 2.0,
        dashed: false,
        points: path(&mut run.frames.iter().map(|frame| frame.report.estimate.pose)),
    });
    plot.layers.extend(events::on_the_path(run));
    if let (Some(first), Some(last)) = (run.frames.first(), run.frames.last()) {
        plot.layers.push(Layer::Dots {
            label: String::new(),
            colour: Colour::Blue,
            radius: 5.0,
            points: vec![(first.report.estimate.pose.x, first.report.estimate.pose.y)],
        });
        plot.layers.push(Layer::Arrow {
            label: String::new(),
            colour: Colour::Blue,
            at: (last.report.estimate.pose.x, last.report.estimate.pose.y),
            heading: last.report.estimate.pose.phi,
        });
    }
    let mut note = String::from(
        "The world is the first body pose: x ahead, y to the left. The dot is the start, the arrow the end. ",
    );
    if magnified > 1.0 {
        let _ = write!(
            note,
            "Pose ellipses are enlarged {magnified} times to be seen. "
        );
    }
    if let Some(scale) = scale {
        let _ = write!(
            note,
            "<span class=\"ramp\">Landmark uncertainty (one sigma) {} <i></i> {}</span>",
            units::length(scale.certain_m),
            units::length(scale.uncertain_m)
        );
    }
    let view = View {
        placement: plot.placement(),
        magnified,
    };
    let section = format!("<section>\n{}</section>\n", card(&plot, &note, "wide"));
    (section, view)
}

/// Logarithmic scale of landmark uncertainty.
struct Scale {
    certain_m: f64,
    uncertain_m: f64,
}

impl Scale {
    fn share(&self, sigma_m: f64) -> f64 {
        let share = (sigma_m / self.certain_m).ln() / (self.uncertain_m / self.certain_m).ln();
        // A landmark without any uncertainty has logarithm minus infinity, a NaN compares as certain.
        if share > 0.0 { share.min(1.0) } else { 0.0 }
    }
}

/// From the fifth to the ninety-fifth percentile; `None` without landmarks.
fn uncertainty_scale(run: &RunRecord) -> Option<Scale> {
    let mut sigmas: Vec<f64> = run
        .landmarks
        .iter()
        .map(uncertainty_m)
        .filter(|sigma| sigma.is_finite())
        .collect();
    sigmas.sort_by(f64::total_cmp);
    let at =
        |share: f64| sigmas.get((share * sigmas.len().saturating_sub(1) as f64).round() as usize);
    let certain_m = at(0.05)?.max(1e-4);
    let uncertain_m = at(0.95)?.max(2.0 * certain_m);
    Some(Scale {
        certain_m,
        uncertain_m,
    })
}

/// Landmarks in groups of one shade, the most certain ones on top.
fn landmarks(run: &RunRecord, scale: &Scale, plot: &mut Plot) {
    let stride = run.landmarks.len().div_ceil(MOST_LANDMARKS).max(1);
    let mut shades: Vec<Vec<(f64, f64)>> = vec![Vec::new(); SHADES];
    for landmark in run.landmarks.iter().step_by(stride) {
        let share = scale.share(uncertainty_m(landmark));
        let shade = ((share * SHADES as f64) as usize).min(SHADES - 1);
        shades[shade].push((landmark.position.x, landmark.position.y));
    }
    let radius = if run.landmarks.len() > 1500 { 1.6 } else { 2.3 };
    for (shade, points) in shades.into_iter().enumerate().rev() {
        let colour = Colour::Scale(shade as f64 / (SHADES - 1) as f64);
        let label = if shade == 0 {
            "landmarks".into()
        } else {
            String::new()
        };
        plot.layers.push(Layer::Dots {
            label,
            colour,
            radius,
            points,
        });
    }
}

/// Three-sigma ellipses along the path; returns by how much they are enlarged.
fn ellipses(run: &RunRecord, plot: &mut Plot, x_range: (f64, f64)) -> f64 {
    let stride = run.frames.len().div_ceil(ELLIPSES).max(1);
    let at_sigmas = |sigmas: f64| -> Vec<Ellipse> {
        run.frames
            .iter()
            .rev()
            .step_by(stride)
            .map(|frame| {
                let c = &frame.report.estimate.covariance;
                Ellipse::of_covariance(
                    (frame.report.estimate.pose.x, frame.report.estimate.pose.y),
                    c[(0, 0)],
                    c[(0, 1)],
                    c[(1, 1)],
                    sigmas,
                )
            })
            .filter(|ellipse| ellipse.half_axes.0.is_finite() && ellipse.half_axes.0 > 0.0)
            .collect()
    };
    let largest = at_sigmas(3.0)
        .iter()
        .map(|ellipse| ellipse.half_axes.0)
        .fold(0.0, f64::max);
    if largest <= 0.0 {
        return 1.0;
    }
    // Nothing smaller than about a hundredth of the view can be seen.
    let wanted = 0.012 * (x_range.1 - x_range.0);
    let magnified = [1.0, 3.0, 10.0, 30.0, 100.0]
        .into_iter()
        .find(|factor| factor * largest >= wanted)
        .unwrap_or(100.0);
    let label = if magnified > 1.0 {
        format!("3σ of the pose × {magnified}")
    } else {
        "3σ of the pose".into()
    };
    plot.layers.push(Layer::Ellipses {
        label,
        colour: Colour::Blue,
        ellipses: at_sigmas(3.0 * magnified),
    });
    magnified
}

/// The reference path as the map shows it; empty without one.
///
/// A run without a scale has no metres: the reference is brought to its unit by the similarity that fits best.
fn reference(run: &RunRecord) -> Vec<(f64, f64)> {
    let Some(reference) = &run.reference else {
        return Vec::new();
    };
    if run.scale == RunScale::Metric {
        return reference.iter().map(|(_, p)| (p.x, p.y)).collect();
    }
    let estimate: Vec<_> = run
        .frames
        .iter()
        .map(|frame| (frame.time_s, frame.report.estimate.pose))
        .collect();
    let Ok(error) = absolute_error(&spatial(&estimate), &spatial(reference), Alignment::Sim2)
    else {
        return Vec::new();
    };
    let estimate_from_reference = error.applied.reference_from_estimate.inverse();
    reference
        .iter()
        .map(|(_, p)| {
            let point = estimate_from_reference * nalgebra::Point3::new(p.x, p.y, 0.0);
            (point.x / error.applied.scale, point.y / error.applied.scale)
        })
        .collect()
}

/// Ranges that hold every path and all but the stray landmarks.
fn view(run: &RunRecord, reference: &[(f64, f64)]) -> ((f64, f64), (f64, f64)) {
    let poses = run
        .frames
        .iter()
        .map(|frame| frame.report.estimate.pose)
        .chain(run.dead_reckoning.iter().copied())
        .map(|pose| (pose.x, pose.y))
        .chain(reference.iter().copied());
    let mut x = (f64::INFINITY, f64::NEG_INFINITY);
    let mut y = x;
    for point in poses.filter(|point| point.0.is_finite() && point.1.is_finite()) {
        x = (x.0.min(point.0), x.1.max(point.0));
        y = (y.0.min(point.1), y.1.max(point.1));
    }
    if !(x.0 <= x.1 && y.0 <= y.1) {
        return ((-1.0, 1.0), (-1.0, 1.0));
    }
    // Landmarks further than this from the path are not what the page is about.
    let reach = 3.0_f64.max(0.8 * (x.1 - x.0).hypot(y.1 - y.0));
    let stretched = |range: (f64, f64), mut values: Vec<f64>| {
        values.retain(|value| value.is_finite());
        values.sort_by(f64::total_cmp);
        let last = values.len().saturating_sub(1) as f64;
        let at = |share: f64| values.get((share * last).round() as usize).copied();
        let low = at(STRAY_SHARE)
            .unwrap_or(range.0)
            .clamp(range.0 - reach, range.0);
        let high = at(1.0 - STRAY_SHARE)
            .unwrap_or(range.1)
            .clamp(range.1, range.1 + reach);
        let air = 0.05 * (high - low).max(0.2);
        (low - air, high + air)
    };
    let coordinates = |axis: usize| {
        run.landmarks
            .iter()
            .map(|landmark| landmark.position[axis])
            .collect()
    };
    (stretched(x, coordinates(0)), stretched(y, coordinates(1)))
}
