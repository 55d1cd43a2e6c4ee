//! Curves over time: errors against the reference, health of the filter, time per stage.

use mono_geometry::Se2;
use nalgebra::Matrix3;
use slam_io::{FrameRecord, RunRecord, RunScale, StageTimes};
use trajectory_eval::{associate, spatial};

use crate::card::card;
use crate::plot::{Colour, Layer, Plot};
use crate::{events, units};

const TIME: &str = "time (s)";

/// Errors over time; empty without a reference.
pub(super) fn error_section(run: &RunRecord) -> String {
    let Some(reference) = &run.reference else {
        return String::new();
    };
    // Without a scale there is no difference of positions in metres.
    if run.scale == RunScale::Arbitrary {
        return String::new();
    }
    let estimate: Vec<_> = run
        .frames
        .iter()
        .map(|frame| (frame.time_s, frame.report.estimate.pose))
        .collect();
    let errors = signed_errors(&estimate, reference);
    if errors.is_empty() {
        return String::new();
    }
    let dead_reckoning: Vec<_> = estimate
        .iter()
        .map(|entry| entry.0)
        .zip(run.dead_reckoning.iter().copied())
        .collect();
    let drift = signed_errors(&dead_reckoning, reference);
    let mut section = String::from(
        "<section>\n<h2>Error against the reference</h2>\n<p class=\"intro\">No alignment: both start in the same pose.</p>\n<div class=\"grid\">\n",
    );
    section.push_str(&distance_chart(run, &errors, &drift));
    let axes: [(&str, &str, usize, f64); 3] = [
        ("Error along x", "x error (mm)", 0, 1000.0),
        ("Error along y", "y error (mm)", 1, 1000.0),
        (
            "Heading error",
            "heading error (deg)",
            2,
            180.0 / std::f64::consts::PI,
        ),
    ];
    for (title, label, axis, unit) in axes {
        section.push_str(&component_chart(run, &errors, title, label, axis, unit));
    }
    section.push_str("</div>\n</section>\n");
    section
}

/// (time, estimate minus reference) where both have a pose, in time order.
fn signed_errors(path: &[(f64, Se2)], reference: &[(f64, Se2)]) -> Vec<(f64, [f64; 3])> {
    // A robot that reports poses without a common moment has no errors to show.
    let pairs = associate(&spatial(path), &spatial(reference)).unwrap_or_default();
    pairs
        .iter()
        .map(|(estimate, reference)| {
            let (a, b) = (estimate.world_from_frame, reference.world_from_frame);
            let turn = (b.rotation.inverse() * a.rotation).euler_angles().2;
            let offset = a.translation.vector - b.translation.vector;
            (estimate.t_s, [offset.x, offset.y, turn])
        })
        .collect()
}

fn distance_chart(
    run: &RunRecord,
    errors: &[(f64, [f64; 3])],
    drift: &[(f64, [f64; 3])],
) -> String {
    let distances = |errors: &[(f64, [f64; 3])]| -> Vec<(f64, f64)> {
        errors
            .iter()
            .map(|(t_s, e)| (*t_s, 1000.0 * e[0].hypot(e[1])))
            .collect()
    };
    let mut plot = Plot::new("Distance to the reference", TIME, "distance (mm)");
    let estimate = distances(errors);
    plot.hints = errors
        .iter()
        .zip(&estimate)
        .map(|((t_s, e), (_, mm))| {
            let text = format!(
                "{t_s:.2} s\nestimate {}\nheading {}",
                units::length(mm / 1000.0),
                units::angle(e[2])
            );
            (*t_s, text)
        })
        .collect();
    if !drift.is_empty() {
        plot.layers.push(Layer::dashed(
            "dead reckoning",
            Colour::Orange,
            distances(drift),
        ));
    }
    plot.layers
        .push(Layer::line("estimate", Colour::Blue, estimate));
    over_time(
        run,
        plot,
        "How far the robot believes to be from where it is.",
    )
}

/// One signed component with the filter's own three-sigma band about zero.
fn component_chart(
    run: &RunRecord,
    errors: &[(f64, [f64; 3])],
    title: &str,
    label: &str,
    axis: usize,
    unit: f64,
) -> String {
    let mut plot = Plot::new(title, TIME, label);
    let band: Vec<(f64, f64, f64)> = run
        .frames
        .iter()
        .map(|frame| {
            (
                frame.time_s,
                three_sigma(&frame.report.estimate.covariance, axis) * unit,
            )
        })
        .filter(|(_, reach)| reach.is_finite())
        .map(|(t_s, reach)| (t_s, -reach, reach))
        .collect();
    let inside = errors
        .iter()
        .filter(|(t_s, error)| {
            let after = band.partition_point(|entry| entry.0 < *t_s);
            band.get(after)
                .is_some_and(|entry| (error[axis] * unit).abs() <= entry.2)
        })
        .count();
    plot.layers.push(Layer::Band {
        label: "±3σ of the filter".into(),
        colour: Colour::Blue,
        points: band,
    });
    plot.layers.push(Layer::Level {
        label: String::new(),
        colour: Colour::Grey,
        y: 0.0,
    });
    let points = errors
        .iter()
        .map(|(t_s, error)| (*t_s, error[axis] * unit))
        .collect();
    plot.layers.push(Layer::line("error", Colour::Blue, points));
    let note = format!(
        "{:.0} % of the frames lie inside the band; a filter that knows itself has 99.7 %.",
        100.0 * inside as f64 / errors.len().max(1) as f64
    );
    over_time(run, plot, &note)
}

fn three_sigma(covariance: &Matrix3<f64>, axis: usize) -> f64 {
    3.0 * covariance[(axis, axis)].max(0.0).sqrt()
}

/// Counts, weights, innovations and wall time.
pub(super) fn health_section(run: &RunRecord) -> String {
    format!(
        "<section>\n<h2>Health of the filter</h2>\n<div class=\"grid\">\n{}{}{}{}</div>\n</section>\n",
        particles_chart(run),
        association_chart(run),
        innovation_chart(run),
        stage_chart(run)
    )
}

/// A quantity over the frames that were filter steps.
fn over_keyframes(run: &RunRecord, value: impl Fn(&FrameRecord) -> Option<f64>) -> Vec<(f64, f64)> {
    run.frames
        .iter()
        .filter(|frame| frame.report.keyframe)
        .filter_map(|frame| Some((frame.time_s, value(frame)?)))
        .collect()
}

/// The card of a chart over time, with what happened to the run below its curves.
fn over_time(run: &RunRecord, mut plot: Plot, note: &str) -> String {
    plot.layers.splice(0..0, events::over_time(run));
    card(&plot, note, "")
}

fn hints(run: &RunRecord, text: impl Fn(&FrameRecord) -> String) -> Vec<(f64, String)> {
    run.frames
        .iter()
        .filter(|frame| frame.report.keyframe)
        .map(|frame| {
            (
                frame.time_s,
                format!(
                    "frame {}, {:.2} s\n{}",
                    frame.index,
                    frame.time_s,
                    text(frame)
                ),
            )
        })
        .collect()
}

fn particles_chart(run: &RunRecord) -> String {
    let mut plot = Plot::new("Particles", TIME, "particles");
    plot.y_range = Some((0.0, 1.05 * run.particles.max(1) as f64));
    let ancestors = over_keyframes(run, |frame| Some(frame.report.unique_ancestors as f64));
    plot.layers
        .push(Layer::line("distinct ancestors", Colour::Purple, ancestors));
    let effective = over_keyframes(run, |frame| Some(frame.report.n_eff));
    plot.layers
        .push(Layer::line("effective number", Colour::Blue, effective));
    let resampled: Vec<f64> = run
        .frames
        .iter()
        .filter(|frame| frame.report.resampled)
        .map(|frame| frame.time_s)
        .collect();
    let note = format!(
        "Of {} particles. Resampled {} times.",
        run.particles,
        resampled.len()
    );
    plot.layers.push(Layer::Marks {
        label: "resampled".into(),
        colour: Colour::Orange,
        xs: resampled,
    });
    plot.hints = hints(run, |frame| {
        format!(
            "effective {:.1}\nancestors {}",
            frame.report.n_eff, frame.report.unique_ancestors
        )
    });
    over_time(run, plot, &note)
}

fn association_chart(run: &RunRecord) -> String {
    let mut plot = Plot::new("Keypoints", TIME, "per frame");
    let count =
        |pick: fn(&FrameRecord) -> usize| over_keyframes(run, |frame| Some(pick(frame) as f64));
    plot.layers.push(Layer::line(
        "matched",
        Colour::Green,
        count(|frame| frame.report.matches),
    ));
    plot.layers.push(Layer::line(
        "new landmarks",
        Colour::Blue,
        count(|frame| frame.report.new_landmarks),
    ));
    plot.layers.push(Layer::line(
        "rejected",
        Colour::Red,
        count(|frame| frame.report.outliers),
    ));
    plot.hints = hints(run, |frame| {
        format!(
            "{} keypoints, {} matched, {} rejected, {} new\n{} landmarks",
            frame.keypoints,
            frame.report.matches,
            frame.report.outliers,
            frame.report.new_landmarks,
            frame.report.landmarks
        )
    });
    over_time(
        run,
        plot,
        "Matches with the map that were used, those that gate or consensus rejected, and landmarks started.",
    )
}

fn innovation_chart(run: &RunRecord) -> String {
    let mut plot = Plot::new("Innovation", TIME, "NIS per degree of freedom");
    let nis = over_keyframes(run, |frame| frame.report.nis);
    let top = nis
        .iter()
        .map(|entry| entry.1)
        .filter(|value| value.is_finite())
        .fold(1.6, f64::max);
    plot.y_range = Some((0.0, 1.08 * top));
    plot.layers.push(Layer::Level {
        label: "expected".into(),
        colour: Colour::Grey,
        y: 1.0,
    });
    plot.layers.push(Layer::line(
        "normalised innovation squared",
        Colour::Teal,
        nis,
    ));
    plot.hints = hints(run, |frame| {
        frame
            .report
            .nis
            .map_or_else(|| "no measurement".into(), |nis| format!("NIS {nis:.2}"))
    });
    over_time(
        run,
        plot,
        "Around one the measurements are as far off as the filter expects; above, it is over-confident.",
    )
}

/// Name, colour and value of a stage.
type Stage = (&'static str, Colour, fn(&StageTimes) -> f64);

fn stage_chart(run: &RunRecord) -> String {
    let stages: [Stage; 6] = [
        ("decode", Colour::Grey, |times| times.decode_ms),
        ("features", Colour::Blue, |times| times.features_ms),
        ("association", Colour::Teal, |times| times.association_ms),
        ("proposal", Colour::Purple, |times| times.proposal_ms),
        ("evolution", Colour::Orange, |times| times.evolution_ms),
        ("mapping", Colour::Yellow, |times| times.mapping_ms),
    ];
    let mut plot = Plot::new("Time per frame", TIME, "milliseconds");
    plot.layers.push(Layer::Stack {
        parts: stages
            .iter()
            .map(|(name, colour, _)| ((*name).to_string(), *colour))
            .collect(),
        points: run
            .frames
            .iter()
            .filter(|frame| frame.report.keyframe)
            .map(|frame| {
                (
                    frame.time_s,
                    stages
                        .iter()
                        .map(|(_, _, pick)| pick(&frame.times).max(0.0))
                        .collect(),
                )
            })
            .collect(),
    });
    plot.hints = hints(run, |frame| {
        let parts: Vec<String> = stages
            .iter()
            .map(|(name, _, pick)| format!("{name} {}", units::three_digits(pick(&frame.times))))
            .collect();
        format!(
            "{} ms: {}",
            units::three_digits(frame.times.total_ms),
            parts.join(", ")
        )
    });
    over_time(
        run,
        plot,
        "Wall time of the frames that were filter steps, by stage.",
    )
}
