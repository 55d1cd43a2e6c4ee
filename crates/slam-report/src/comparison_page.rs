//! The page of two runs: both paths over each other, errors, uncertainties and counts side by side, and the keys of the
//! configuration in which they differ.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use mono_geometry::Se2;
use slam_io::{FrameRecord, PathFigures, RunFigures, RunRecord, run_figures};
use trajectory_eval::{associate, spatial};

use crate::card::{STYLE, card};
use crate::escape::escape;
use crate::plot::{Colour, Layer, Plot};
use crate::units::{angle, duration, length, three_digits};

const TIME: &str = "time since the start (s)";
const COLOURS: [Colour; 2] = [Colour::Blue, Colour::Orange];
const MISSING: &str = "–";

/// A run with its name on the page.
struct Side<'a> {
    name: &'a str,
    run: &'a RunRecord,
    figures: RunFigures,
}

/// Draws the page of two runs, each with the name it is called by, such as its folder's.
///
/// Errors are those without alignment, of each run against its own reference. Time O(frames + landmarks); points that are
/// not finite are left out.
pub fn render_comparison_html(runs: [(&str, &RunRecord); 2]) -> String {
    let sides = runs.map(|(name, run)| Side {
        name,
        run,
        figures: run_figures(run),
    });
    let title = format!("{} and {}", escape(sides[0].name), escape(sides[1].name));
    let mut page = String::with_capacity(1 << 18);
    // Writing into a String cannot fail.
    let _ = write!(
        page,
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n<title>{title}: mono-slam comparison</title>\n\
         <style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n<header>\n<p class=\"brand\">mono-slam {}</p>\n<h1>{title}</h1>\n\
         <p class=\"lead\">{}</p>\n</header>\n",
        env!("CARGO_PKG_VERSION"),
        lead(&sides)
    );
    page.push_str(&warnings(&sides));
    page.push_str(&table(&sides));
    page.push_str(&paths(&sides));
    page.push_str(&curves(&sides));
    page.push_str(&configuration(&sides));
    page.push_str("</main>\n</body>\n</html>\n");
    page
}

fn lead(sides: &[Side<'_>; 2]) -> String {
    let [a, b] = sides;
    if a.run.sequence == b.run.sequence {
        format!(
            "Two runs over the sequence <b>{}</b>.",
            escape(&a.run.sequence)
        )
    } else {
        format!(
            "Runs over two sequences, <b>{}</b> and <b>{}</b>.",
            escape(&a.run.sequence),
            escape(&b.run.sequence)
        )
    }
}

/// The warnings of either run; nothing where there are none.
fn warnings(sides: &[Side<'_>; 2]) -> String {
    if sides.iter().all(|side| side.run.warnings.is_empty()) {
        return String::new();
    }
    let mut list = String::from(
        "<section class=\"warnings\" role=\"alert\">\n<h2>Before you believe these runs</h2>\n<ul>\n",
    );
    for side in sides {
        for warning in &side.run.warnings {
            let _ = writeln!(
                list,
                "<li><b>{}</b>: {} <code>{}</code></li>",
                escape(side.name),
                escape(&warning.message),
                escape(&warning.name)
            );
        }
    }
    list.push_str("</ul>\n</section>\n");
    list
}

/// One line of the table: both values as text, and as numbers where a quotient says something.
type Line = (String, [String; 2], Option<[f64; 2]>);

fn table(sides: &[Side<'_>; 2]) -> String {
    let mut lines: Vec<Line> = vec![
        text("Method", sides, |side| side.run.method.clone()),
        text("Particles", sides, |side| side.run.particles.to_string()),
        text("Seed", sides, |side| side.run.seed.to_string()),
        text("Frames", sides, |side| side.figures.frames.to_string()),
        text("of them filter steps", sides, |side| {
            side.figures.keyframes.to_string()
        }),
        text("Duration", sides, |side| duration(side.figures.duration_s)),
    ];
    lines.push(number("Path length", sides, length, |f| {
        Some(f.path_length_m)
    }));
    for (path, name) in [
        ("filtered", "Filtered path"),
        ("smoothed", "Smoothed path"),
        ("dead_reckoning", "Dead reckoning"),
    ] {
        let of = move |f: &RunFigures, pick: fn(&PathFigures) -> f64| {
            Some(pick(f.errors.get(path)?.get("none")?))
        };
        lines.push(number(
            &format!("{name}: position error (RMSE)"),
            sides,
            length,
            |f| of(f, |e| e.position_m.rmse),
        ));
        if path == "filtered" {
            lines.push(number("largest position error", sides, length, |f| {
                of(f, |e| e.position_m.max)
            }));
            lines.push(number("final position error", sides, length, |f| {
                of(f, |e| e.final_position_m)
            }));
            lines.push(number("heading error (RMSE)", sides, angle, |f| {
                of(f, |e| e.heading_rad.rmse)
            }));
        }
    }
    lines.push(number("Landmarks", sides, count, |f| {
        Some(f.landmarks as f64)
    }));
    lines.push(number(
        "median uncertainty of a landmark",
        sides,
        length,
        |f| f.landmark_uncertainty_median_m,
    ));
    lines.push(number("Keypoints a frame", sides, count, |f| {
        f.keypoints_mean
    }));
    lines.push(number("Matches a filter step", sides, count, |f| {
        f.matches_mean
    }));
    lines.push(number("Share rejected", sides, percent, |f| {
        f.outlier_share
    }));
    lines.push(number(
        "Innovation (NIS per degree of freedom)",
        sides,
        three_digits,
        |f| f.nis_mean,
    ));
    lines.push(number("Effective particles", sides, three_digits, |f| {
        f.n_eff_mean
    }));
    lines.push(number("Frames a second", sides, three_digits, |f| {
        f.frames_per_s
    }));
    let [a, b] = sides;
    let mut html = format!(
        "<section>\n<h2>Side by side</h2>\n<div class=\"card scroll\"><table>\n\
         <thead><tr><th></th><th>{}</th><th>{}</th><th>second over first</th></tr></thead>\n<tbody>\n",
        escape(a.name),
        escape(b.name)
    );
    for (name, [first, second], numbers) in lines {
        if first == MISSING && second == MISSING {
            continue;
        }
        let ratio = match numbers {
            Some([first, second]) if first > 0.0 && (second / first).is_finite() => {
                format!("{:.2}", second / first)
            }
            _ => String::new(),
        };
        let _ = writeln!(
            html,
            "<tr><th>{name}</th><td>{}</td><td>{}</td><td>{ratio}</td></tr>",
            escape(&first),
            escape(&second)
        );
    }
    html.push_str("</tbody></table></div>\n</section>\n");
    html
}

fn text(name: &str, sides: &[Side<'_>; 2], value: impl Fn(&Side<'_>) -> String) -> Line {
    (name.to_owned(), [value(&sides[0]), value(&sides[1])], None)
}

fn number(
    name: &str,
    sides: &[Side<'_>; 2],
    shown: fn(f64) -> String,
    value: impl Fn(&RunFigures) -> Option<f64>,
) -> Line {
    let values = [value(&sides[0].figures), value(&sides[1].figures)];
    let both = match values {
        [Some(first), Some(second)] => Some([first, second]),
        _ => None,
    };
    (
        name.to_owned(),
        values.map(|value| value.map_or_else(|| MISSING.to_owned(), shown)),
        both,
    )
}

fn count(value: f64) -> String {
    format!("{value:.0}")
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// Both paths from above, over the reference of the first run that has one.
fn paths(sides: &[Side<'_>; 2]) -> String {
    let mut plot = Plot::new("Paths from above", "x (m)", "y (m)");
    plot.width = 1100.0;
    plot.equal_aspect = true;
    plot.font_size = 13.0;
    if let Some(reference) = sides.iter().find_map(|side| side.run.reference.as_ref()) {
        plot.layers.push(Layer::Line {
            label: "reference".into(),
            colour: Colour::Green,
            width: 6.0,
            dashed: false,
            points: reference.iter().map(|(_, pose)| (pose.x, pose.y)).collect(),
        });
    }
    for (side, colour) in sides.iter().zip(COLOURS) {
        let estimates = || {
            side.run
                .frames
                .iter()
                .map(|frame| frame.report.estimate.pose)
        };
        plot.layers.push(Layer::Line {
            label: side.name.to_owned(),
            colour,
            width: 2.0,
            dashed: false,
            points: estimates().map(|pose| (pose.x, pose.y)).collect(),
        });
        if let Some(last) = estimates().next_back() {
            plot.layers.push(Layer::Arrow {
                label: String::new(),
                colour,
                at: (last.x, last.y),
                heading: last.phi,
            });
        }
    }
    format!(
        "<section>\n{}</section>\n",
        card(
            &plot,
            "The world of each run is its first body pose: x ahead, y to the left. The arrows are the ends.",
            "wide"
        )
    )
}

fn curves(sides: &[Side<'_>; 2]) -> String {
    let mut html = String::from("<section>\n<h2>Over time</h2>\n<div class=\"grid\">\n");
    let mut chart = |title: &str, label: &str, note: &str, lines: [Vec<(f64, f64)>; 2]| {
        if lines.iter().all(Vec::is_empty) {
            return;
        }
        let mut plot = Plot::new(title, TIME, label);
        let top = lines
            .iter()
            .flatten()
            .map(|point| point.1)
            .filter(|value| value.is_finite())
            .fold(0.0, f64::max);
        if top > 0.0 {
            plot.y_range = Some((0.0, 1.05 * top));
        }
        // The second is dashed, so that equal curves show both.
        let draw = [Layer::line, Layer::dashed];
        for (((side, colour), points), draw) in sides.iter().zip(COLOURS).zip(lines).zip(draw) {
            if !points.is_empty() {
                plot.layers.push(draw(side.name, colour, points));
            }
        }
        html.push_str(&card(&plot, note, ""));
    };
    let both =
        |curve: &dyn Fn(&RunRecord) -> Vec<(f64, f64)>| [curve(sides[0].run), curve(sides[1].run)];
    chart(
        "Distance to the reference",
        "distance (mm)",
        "Each run against its own reference, without alignment.",
        both(&|run| match &run.reference {
            Some(reference) => apart(&timed(run), reference, start(run)),
            None => Vec::new(),
        }),
    );
    chart(
        "Reported uncertainty of the position",
        "one sigma (mm)",
        "Root of the trace of the position's covariance.",
        both(&|run| {
            over_frames(run, |frame| {
                let covariance = &frame.report.estimate.covariance;
                Some(1000.0 * (covariance[(0, 0)] + covariance[(1, 1)]).max(0.0).sqrt())
            })
        }),
    );
    chart(
        "Reported uncertainty of the heading",
        "one sigma (deg)",
        "",
        both(&|run| {
            over_frames(run, |frame| {
                let variance = frame.report.estimate.covariance[(2, 2)];
                Some(variance.max(0.0).sqrt().to_degrees())
            })
        }),
    );
    chart(
        "Matches",
        "per filter step",
        "Matches with the map that were used.",
        both(&|run| {
            over_frames(run, |frame| {
                frame.report.keyframe.then_some(frame.report.matches as f64)
            })
        }),
    );
    chart(
        "Landmarks",
        "number",
        "",
        both(&|run| over_frames(run, |frame| Some(frame.report.landmarks as f64))),
    );
    html.push_str(&between(sides));
    html.push_str("</div>\n</section>\n");
    html
}

/// How far the two paths lie apart; nothing where they have no common time.
fn between([a, b]: &[Side<'_>; 2]) -> String {
    let points = apart(&timed(b.run), &timed(a.run), start(a.run));
    if points.is_empty() {
        return String::new();
    }
    let mut plot = Plot::new("Distance between the two paths", TIME, "distance (mm)");
    plot.layers
        .push(Layer::line("between them", Colour::Purple, points));
    card(&plot, "Poses of one time, as each run reports them.", "")
}

fn start(run: &RunRecord) -> f64 {
    run.frames.first().map_or(0.0, |frame| frame.time_s)
}

fn timed(run: &RunRecord) -> Vec<(f64, Se2)> {
    run.frames
        .iter()
        .map(|frame| (frame.time_s, frame.report.estimate.pose))
        .collect()
}

fn over_frames(run: &RunRecord, value: impl Fn(&FrameRecord) -> Option<f64>) -> Vec<(f64, f64)> {
    let start_s = start(run);
    run.frames
        .iter()
        .filter_map(|frame| Some((frame.time_s - start_s, value(frame)?)))
        .collect()
}

/// (time since `start_s`, distance in mm) where both paths have a pose.
fn apart(path: &[(f64, Se2)], other: &[(f64, Se2)], start_s: f64) -> Vec<(f64, f64)> {
    associate(&spatial(path), &spatial(other))
        .unwrap_or_default()
        .iter()
        .map(|(a, b)| {
            let offset =
                a.world_from_frame.translation.vector - b.world_from_frame.translation.vector;
            (a.t_s - start_s, 1000.0 * offset.norm())
        })
        .collect()
}

/// The lines of the configurations that the other does not have, under their sections.
fn configuration(sides: &[Side<'_>; 2]) -> String {
    let keys = |run: &RunRecord| -> BTreeSet<String> {
        let mut section = String::new();
        run.configuration
            .lines()
            .map(str::trim)
            .filter(|line| !line.is_empty() && !line.starts_with('#'))
            .filter_map(|line| {
                if line.starts_with('[') {
                    section = line.trim_matches(['[', ']']).to_owned();
                    return None;
                }
                Some(format!("{section}.{line}"))
            })
            .collect()
    };
    let [a, b] = [keys(sides[0].run), keys(sides[1].run)];
    let mut html = String::from("<section>\n<h2>Configuration</h2>\n");
    if a == b {
        html.push_str(
            "<p class=\"intro\">Both runs have the same configuration.</p>\n</section>\n",
        );
        return html;
    }
    html.push_str("<div class=\"grid\">\n");
    for (side, [own, other]) in sides.iter().zip([[&a, &b], [&b, &a]]) {
        let lines: Vec<String> = own.difference(other).map(|line| escape(line)).collect();
        let _ = writeln!(
            html,
            "<div class=\"card\"><h3>Only in {}</h3><pre>{}</pre></div>",
            escape(side.name),
            lines.join("\n")
        );
    }
    html.push_str("</div>\n</section>\n");
    html
}
