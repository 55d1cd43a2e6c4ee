//! Key figures at the top of the page, all figures and the configuration at its end.

use std::fmt::Write as _;

use slam_io::{PathFigures, RunFigures, RunRecord, RunScale, SmootherRecord};

use crate::escape::escape;
use crate::units::{angle, duration, length, three_digits};

/// One sentence under the title.
pub(super) fn lead(run: &RunRecord, figures: &RunFigures) -> String {
    format!(
        "{} frames over {} and {}, method <b>{}</b>, {} particles, seed {}.",
        figures.frames,
        duration(figures.duration_s),
        match run.scale {
            RunScale::Metric => length(figures.path_length_m),
            RunScale::Arbitrary => "an unknown length (no scale)".to_owned(),
        },
        escape(&run.method),
        run.particles,
        run.seed
    )
}

/// The key figures in cards.
pub(super) fn cards(run: &RunRecord, figures: &RunFigures) -> String {
    let mut cards: Vec<(&str, String, String)> = Vec::new();
    let (alignment, said) = match run.scale {
        RunScale::Metric => ("none", "no alignment"),
        RunScale::Arbitrary => ("sim2", "after alignment with scale"),
    };
    let unaligned = |path: &str| figures.errors.get(path).and_then(|by| by.get(alignment));
    match unaligned("filtered") {
        Some(error) => {
            let gain = unaligned("dead_reckoning").map_or_else(String::new, |drift| {
                comparison(error.position_m.rmse, drift.position_m.rmse)
            });
            cards.push((
                "Position error",
                length(error.position_m.rmse),
                format!("RMSE, {said}{gain}"),
            ));
            let share = 100.0 * error.final_position_m / figures.path_length_m;
            let of_path = if share.is_finite() && run.scale == RunScale::Metric {
                format!("{} % of the path", three_digits(share))
            } else {
                String::new()
            };
            cards.push(("Final error", length(error.final_position_m), of_path));
            cards.push((
                "Heading error",
                angle(error.heading_rad.rmse),
                "RMSE".into(),
            ));
        }
        None => cards.push((
            "Path",
            match run.scale {
                RunScale::Metric => length(figures.path_length_m),
                RunScale::Arbitrary => format!("{} units", three_digits(figures.path_length_m)),
            },
            "no reference to compare with".into(),
        )),
    }
    let spread = figures
        .landmark_uncertainty_median_m
        .map_or_else(String::new, |sigma| {
            format!("median uncertainty {}", length(sigma))
        });
    cards.push(("Landmarks", figures.landmarks.to_string(), spread));
    if let Some(matches) = figures.matches_mean {
        let rejected = figures.outlier_share.map_or_else(String::new, |share| {
            format!("{:.1} % rejected", 100.0 * share)
        });
        cards.push(("Matches a frame", format!("{matches:.0}"), rejected));
    }
    if let Some(nis) = figures.nis_mean {
        cards.push((
            "Innovation",
            three_digits(nis),
            "NIS per degree of freedom, 1 is right".into(),
        ));
    }
    if let Some(rate) = figures.frames_per_s {
        cards.push((
            "Speed",
            format!("{} /s", three_digits(rate)),
            format!("frames; {} in all", duration(run.wall_s)),
        ));
    }
    let mut html = String::from("<div class=\"cards\">\n");
    for (name, value, note) in cards {
        let _ = writeln!(
            html,
            "<div><span>{name}</span><strong>{value}</strong><small>{note}</small></div>"
        );
    }
    html.push_str("</div>\n");
    html
}

/// How an error compares with that of dead reckoning.
fn comparison(error_m: f64, drift_m: f64) -> String {
    if !(error_m > 0.0 && drift_m > 0.0) {
        return String::new();
    }
    let ratio = drift_m / error_m;
    if ratio >= 1.0 {
        format!("; dead reckoning {} ({ratio:.1}×)", length(drift_m))
    } else {
        format!("; <em>dead reckoning is better</em>: {}", length(drift_m))
    }
}

/// Tables of all figures, notes and the configuration.
pub(super) fn tables(run: &RunRecord, figures: &RunFigures) -> String {
    let mut html = String::from("<section>\n<h2>All figures</h2>\n");
    html.push_str(&error_table(figures));
    html.push_str("<div class=\"grid\">\n");
    html.push_str(&run_table(run, figures));
    html.push_str(&time_table(figures));
    if let Some(smoother) = &run.smoother {
        html.push_str(&smoother_table(smoother));
    }
    html.push_str("</div>\n</section>\n");
    if !figures.notes.is_empty() {
        html.push_str("<section>\n<h2>Notes of the filter</h2>\n<ul class=\"card notes\">\n");
        for (note, count) in &figures.notes {
            let _ = writeln!(html, "<li><b>{count} ×</b> {}</li>", escape(note));
        }
        html.push_str("</ul>\n</section>\n");
    }
    let _ = write!(
        html,
        "<section>\n<details class=\"card\"><summary>Configuration of this run</summary><pre>{}</pre></details>\n</section>\n",
        escape(&run.configuration)
    );
    html
}

fn error_table(figures: &RunFigures) -> String {
    if figures.errors.is_empty() {
        return String::new();
    }
    let mut html = String::from(
        "<div class=\"card scroll\"><table>\n<thead><tr><th>Path</th><th>Alignment</th><th>RMSE</th><th>mean</th><th>median</th><th>largest</th>\
         <th>final</th><th>heading RMSE</th><th>step RMSE</th></tr></thead>\n<tbody>\n",
    );
    for (path, name) in [
        ("filtered", "filtered"),
        ("smoothed", "smoothed"),
        ("dead_reckoning", "dead reckoning"),
    ] {
        for (label, alignment) in [("none", "none"), ("se2", "SE(2)"), ("sim2", "Sim(2)")] {
            if let Some(error) = figures.errors.get(path).and_then(|by| by.get(label)) {
                html.push_str(&error_row(name, alignment, error));
            }
        }
    }
    html.push_str("</tbody></table></div>\n");
    html
}

fn error_row(name: &str, alignment: &str, error: &PathFigures) -> String {
    let position = &error.position_m;
    let step = error
        .step_position_rmse_m
        .map_or_else(|| "–".into(), length);
    format!(
        "<tr><th>{name}</th><td>{alignment}</td><td><b>{}</b></td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{step}</td></tr>\n",
        length(position.rmse),
        length(position.mean),
        length(position.median),
        length(position.max),
        length(error.final_position_m),
        angle(error.heading_rad.rmse)
    )
}

fn run_table(run: &RunRecord, figures: &RunFigures) -> String {
    let number = |value: Option<f64>| value.map_or_else(|| "–".to_string(), three_digits);
    let rows = [
        ("Frames", figures.frames.to_string()),
        ("of them filter steps", figures.keyframes.to_string()),
        ("Keypoints per frame, mean", number(figures.keypoints_mean)),
        (
            "Matches per filter step, mean",
            number(figures.matches_mean),
        ),
        ("Landmarks at the end", figures.landmarks.to_string()),
        ("Effective particles, mean", number(figures.n_eff_mean)),
        ("Effective particles, smallest", number(figures.n_eff_min)),
        ("Resampled", format!("{} times", figures.resampled)),
        (
            "Distinct ancestors at the end",
            figures.unique_ancestors_final.map_or_else(
                || "–".into(),
                |count| format!("{count} of {}", run.particles),
            ),
        ),
        (
            "Evolution moves accepted",
            figures.es_acceptance_mean.map_or_else(
                || "–".into(),
                |share| format!("{} %", three_digits(100.0 * share)),
            ),
        ),
        ("NIS per degree of freedom, mean", number(figures.nis_mean)),
    ];
    rows_card("Run", &rows)
}

fn time_table(figures: &RunFigures) -> String {
    let times = &figures.stage_mean_ms;
    let milliseconds = |value: f64| format!("{} ms", three_digits(value));
    let rows = [
        ("Decode", milliseconds(times.decode_ms)),
        ("Features", milliseconds(times.features_ms)),
        ("Association", milliseconds(times.association_ms)),
        ("Proposal", milliseconds(times.proposal_ms)),
        ("Evolution", milliseconds(times.evolution_ms)),
        ("Mapping", milliseconds(times.mapping_ms)),
        ("Whole frame", milliseconds(times.total_ms)),
        ("Whole run", duration(figures.wall_s)),
    ];
    rows_card("Time per frame, mean", &rows)
}

/// Where the smoothed path comes from, and the constants of the robot that it learned.
fn smoother_table(smoother: &SmootherRecord) -> String {
    let mut rows = vec![("Smoothed path", escape(&smoother.method))];
    if let Some(note) = &smoother.note {
        rows.push(("because", escape(note)));
    }
    let names: Vec<String> = smoother.constants.iter().map(|c| escape(&c.name)).collect();
    for (name, constant) in names.iter().zip(&smoother.constants) {
        let text = format!(
            "{:.5} ± {:.5} (before: 0 ± {})",
            constant.value, constant.sigma, constant.prior_sigma
        );
        rows.push((name, text));
    }
    rows_card("Smoother", &rows)
}

fn rows_card(title: &str, rows: &[(&str, String)]) -> String {
    let mut html = format!("<div class=\"card\"><h3>{title}</h3><table class=\"pairs\"><tbody>\n");
    for (name, value) in rows {
        let _ = writeln!(html, "<tr><th>{name}</th><td>{value}</td></tr>");
    }
    html.push_str("</tbody></table></div>\n");
    html
}
