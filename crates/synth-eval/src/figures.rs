//! Figures in the manner of the paper's: the maps from above (Fig. 7) and the errors against
//! the number of particles (Fig. 8).

use crate::Options;
use crate::estimator::{FULL, family_of};
use crate::plan::Plan;
use crate::recording::Recording;
use crate::row::Row;
use crate::statistics::{Interval, bootstrap_mean};
use crate::study::{Outcome, run, write_file};
use crate::trial::{self, Trial};
use estimation_base::Se2;
use slam_report::{Colour, Layer, Plot};
use std::fmt::Write as _;

/// Width of a panel, pixels.
const PANEL_WIDTH: f64 = 620.0;
/// Room between the panels, pixels.
const GAP: f64 = 16.0;
/// The range of a map panel, metres: the wall of the scene at 2 m and a little behind it.
const MAP_X: (f64, f64) = (-1.6, 5.4);
const MAP_Y: (f64, f64) = (-0.7, 2.6);
/// Height of the letters S and E, metres.
const LETTER_M: f64 = 0.22;

/// Runs the estimators on walls, writes `figure7_map.svg` and `figure8_particles.svg` beside the results and returns
/// the table.
///
/// # Errors
/// As [`run`].
pub fn figures(options: &Options, progress: &(dyn Fn(&str) + Sync)) -> anyhow::Result<Outcome> {
    let outcome = run(options, progress)?;
    let rows = crate::row::read_rows(&options.out.join("results.jsonl"))?;
    let plan = Plan::new(options)?;
    let recording = plan.batches[0].source.record(&plan.settings)?;
    let trials = FULL
        .iter()
        .map(|&estimator| trial::run(estimator, &recording, 1, &plan.settings, false))
        .collect::<anyhow::Result<Vec<_>>>()?;
    write_file(
        &options.out.join("figure7_map.svg"),
        &map(&trials, &recording),
    )?;
    write_file(
        &options.out.join("figure8_particles.svg"),
        &particles(&rows),
    )?;
    Ok(outcome)
}

/// Fig. 7: path and landmarks of each trial from above.
fn map(trials: &[Trial], recording: &Recording) -> String {
    let truth: Vec<Se2> = recording.truth.iter().flatten().copied().collect();
    let panels: Vec<String> = trials
        .iter()
        .map(|trial| map_panel(trial, &truth, recording).to_svg_file())
        .collect();
    grid(&panels, "Paths and landmarks from above")
}

fn map_panel(trial: &Trial, truth: &[Se2], recording: &Recording) -> Plot {
    let row = &trial.row;
    let title = match row.landmark_median_m {
        Some(median) => format!(
            "{}: path RMSE {:.0} mm, median landmark error {:.0} mm",
            row.method,
            row.position_rmse_m * 1e3,
            median * 1e3
        ),
        None => format!(
            "{}: path RMSE {:.0} mm",
            row.method,
            row.position_rmse_m * 1e3
        ),
    };
    let mut plot = Plot::new(&title, "x (m)", "y (m)");
    plot.width = PANEL_WIDTH;
    plot.equal_aspect = true;
    plot.x_range = Some(MAP_X);
    plot.y_range = Some(MAP_Y);
    let surface = trial
        .landmarks
        .iter()
        .filter_map(|l| recording.surface_point(l.descriptor.as_deref()?))
        .map(|p| (p.x, p.y))
        .collect();
    let landmarks = trial
        .landmarks
        .iter()
        .map(|l| (l.position.x, l.position.y))
        .collect();
    let dots = |label: &str, colour, radius, points| Layer::Dots {
        label: if trial.landmarks.is_empty() {
            String::new()
        } else {
            label.into()
        },
        colour,
        radius,
        points,
    };
    plot.layers = vec![
        dots("landmarks", Colour::Blue, 1.4, landmarks),
        dots("true surface points", Colour::Yellow, 1.0, surface),
        Layer::Line {
            label: "estimated path".into(),
            colour: Colour::Red,
            width: 2.2,
            dashed: false,
            points: points(&trial.poses),
        },
        Layer::dashed("true path", Colour::Ink, points(truth)),
    ];
    if let (Some(first), Some(last)) = (trial.poses.first(), trial.poses.last()) {
        for (pose, letter) in [(first, LETTER_S), (last, LETTER_E)] {
            plot.layers.push(Layer::Dots {
                label: String::new(),
                colour: Colour::Red,
                radius: 4.0,
                points: vec![(pose.x, pose.y)],
            });
            plot.layers.extend(strokes(letter, (pose.x, pose.y)));
        }
    }
    plot
}

fn points(path: &[Se2]) -> Vec<(f64, f64)> {
    path.iter().map(|pose| (pose.x, pose.y)).collect()
}

/// Strokes of a letter in a box 0.6 wide and 1 high, from the lower left corner.
type Letter = &'static [&'static [(f64, f64)]];
const LETTER_S: Letter = &[&[
    (0.6, 0.85),
    (0.45, 0.98),
    (0.15, 0.98),
    (0.0, 0.82),
    (0.0, 0.68),
    (0.15, 0.54),
    (0.45, 0.46),
    (0.6, 0.32),
    (0.6, 0.18),
    (0.45, 0.02),
    (0.15, 0.02),
    (0.0, 0.15),
]];
const LETTER_E: Letter = &[
    &[(0.55, 1.0), (0.0, 1.0), (0.0, 0.0), (0.58, 0.0)],
    &[(0.0, 0.52), (0.45, 0.52)],
];

/// A letter below a place, as lines: the plot has no text of its own between the axes.
fn strokes(letter: Letter, (x, y): (f64, f64)) -> Vec<Layer> {
    let (left, bottom) = (x - 0.3 * LETTER_M, y - 1.9 * LETTER_M);
    letter
        .iter()
        .map(|stroke| {
            let place = |&(u, v): &(f64, f64)| (left + u * LETTER_M, bottom + v * LETTER_M);
            Layer::line("", Colour::Ink, stroke.iter().map(place).collect())
        })
        .collect()
}

/// Fig. 8: pose error and landmark error against the number of particles.
fn particles(rows: &[Row]) -> String {
    let panels = [
        curves(
            rows,
            "Position RMSE against the number of particles",
            "position RMSE (mm)",
            |row| Some(row.position_rmse_m),
        ),
        curves(
            rows,
            "Median landmark error against the number of particles",
            "landmark error (mm)",
            |row| row.landmark_median_m,
        ),
    ];
    grid(
        &panels.map(|plot| plot.to_svg_file()),
        "Errors against the number of particles",
    )
}

fn curves(rows: &[Row], title: &str, y_label: &str, value: impl Fn(&Row) -> Option<f64>) -> Plot {
    let mut plot = Plot::new(title, "particles", y_label);
    plot.width = PANEL_WIDTH;
    plot.height = 400.0;
    let most = rows.iter().map(|row| row.particles).max().unwrap_or(1);
    let means_of = |family: &str| -> Vec<(f64, Interval)> {
        let mut numbers: Vec<u32> = rows.iter().map(|row| row.particles).collect();
        numbers.sort_unstable();
        numbers.dedup();
        let of = |particles: u32| {
            let values: Vec<f64> = rows
                .iter()
                .filter(|row| row.particles == particles && family_of(&row.method) == family)
                .filter_map(&value)
                .collect();
            Some((f64::from(particles), bootstrap_mean(&values)?))
        };
        numbers.into_iter().filter_map(of).collect()
    };
    plot.x_range = Some((0.0, 1.06 * f64::from(most)));
    let mut top = 0.0_f64;
    for (family, colour) in [
        ("conventional", Colour::Orange),
        ("paper", Colour::Purple),
        ("exact", Colour::Blue),
    ] {
        let curve = means_of(family);
        let Some(highest) = curve.iter().map(|(_, v)| v.high).reduce(f64::max) else {
            continue;
        };
        top = top.max(highest * 1e3);
        for (n, v) in &curve {
            plot.layers.push(Layer::line(
                "",
                colour,
                vec![(*n, v.low * 1e3), (*n, v.high * 1e3)],
            ));
        }
        let means: Vec<_> = curve.iter().map(|(n, v)| (*n, v.mean * 1e3)).collect();
        plot.layers.push(Layer::line(family, colour, means.clone()));
        plot.layers.push(Layer::Dots {
            label: String::new(),
            colour,
            radius: 4.5,
            points: means,
        });
    }
    if let Some((_, reckoned)) = means_of("dead reckoning").first() {
        top = top.max(reckoned.mean * 1e3);
        plot.layers.push(Layer::Level {
            label: "dead reckoning".into(),
            colour: Colour::Grey,
            y: reckoned.mean * 1e3,
        });
    }
    plot.y_range = Some((0.0, 1.05 * top.max(1.0)));
    plot
}

/// Drawings of one width side by side in two columns.
fn grid(panels: &[String], title: &str) -> String {
    let sizes: Vec<f64> = panels.iter().map(|panel| height(panel)).collect();
    let row_height = sizes.iter().copied().fold(0.0, f64::max);
    let columns = panels.len().min(2);
    let rows = panels.len().div_ceil(2);
    let width = columns as f64 * (PANEL_WIDTH + GAP) - GAP;
    let total = rows as f64 * (row_height + GAP) - GAP;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{total:.0}\" viewBox=\"0 0 {width:.0} {total:.0}\" role=\"img\" aria-label=\"{title}\">\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n"
    );
    for (index, (panel, height)) in panels.iter().zip(sizes).enumerate() {
        let x = (index % 2) as f64 * (PANEL_WIDTH + GAP);
        let y = (index / 2) as f64 * (row_height + GAP);
        let place = format!(
            "<svg x=\"{x:.0}\" y=\"{y:.0}\" width=\"{PANEL_WIDTH:.0}\" height=\"{height:.0}\" "
        );
        let _ = writeln!(out, "{}", panel.replacen("<svg ", &place, 1));
    }
    out.push_str("</svg>\n");
    out
}

/// Height of a drawing from its view box.
fn height(svg: &str) -> f64 {
    svg.split_once("viewBox=\"")
        .and_then(|(_, rest)| rest.split_once('"'))
        .and_then(|(numbers, _)| numbers.split(' ').nth(3)?.parse().ok())
        .unwrap_or(PANEL_WIDTH)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_stand_in_two_columns_at_their_own_height() {
        let panel = |h: f64| {
            let mut plot = Plot::new("t", "x", "y");
            plot.width = PANEL_WIDTH;
            plot.height = h;
            plot.to_svg_file()
        };
        let drawings = [panel(200.0), panel(300.0), panel(200.0)];
        assert_eq!(height(&drawings[1]), 300.0);
        let whole = grid(&drawings, "three");
        assert!(whole.contains("viewBox=\"0 0 1256 616\""), "{whole}");
        assert!(whole.contains("<svg x=\"636\" y=\"0\" width=\"620\" height=\"300\""));
        assert!(whole.contains("<svg x=\"0\" y=\"316\" width=\"620\" height=\"200\""));
        assert_eq!(
            whole.matches("<svg").count(),
            whole.matches("</svg>").count()
        );
    }

    #[test]
    fn letters_hang_below_their_place() {
        for letter in [LETTER_S, LETTER_E] {
            for layer in strokes(letter, (3.0, 1.0)) {
                let Layer::Line { points, .. } = layer else {
                    panic!("{layer:?}")
                };
                assert!(points.iter().all(|p| (p.0 - 3.0).abs() < 0.1));
                assert!(points.iter().all(|p| (0.55..0.85).contains(&p.1)));
            }
        }
    }
}
