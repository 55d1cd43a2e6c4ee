//! Paths and landmarks from above, in the manner of the paper's Fig. 6, 7 and 9.

use super::grid::{PANEL_WIDTH, grid};
use crate::estimator::Estimator;
use crate::recording::Recording;
use crate::settings::Settings;
use crate::trial::{self, Trial};
use estimation_base::Se2;
use slam_report::{Colour, Layer, Plot};

/// The range of a map, metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Extent {
    pub(super) x: (f64, f64),
    pub(super) y: (f64, f64),
}

/// The wall of the scene at 2 m and a little behind it.
pub(super) const WALL: Extent = Extent {
    x: (-1.6, 5.4),
    y: (-0.7, 2.6),
};
/// The four walls of the room.
pub(super) const ROOM: Extent = Extent {
    x: (-3.6, 3.6),
    y: (-3.7, 2.5),
};
/// Height of the letters S and E, metres.
const LETTER_M: f64 = 0.22;

/// Runs estimators on a recording and draws their paths and landmarks, a panel each.
///
/// # Errors
/// A filter that fails.
pub(super) fn maps(
    recording: &Recording,
    estimators: &[Estimator],
    settings: &Settings,
    seed: u64,
    extent: Extent,
    title: &str,
) -> anyhow::Result<String> {
    let truth: Vec<Se2> = recording.truth.iter().flatten().copied().collect();
    let mut panels = Vec::new();
    for &estimator in estimators {
        let trial = trial::run(estimator, recording, seed, settings, false)?;
        panels.push(map_panel(&trial, &truth, recording, extent).to_svg_file());
    }
    Ok(grid(&panels, title))
}

fn map_panel(trial: &Trial, truth: &[Se2], recording: &Recording, extent: Extent) -> Plot {
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
    plot.x_range = Some(extent.x);
    plot.y_range = Some(extent.y);
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

#[cfg(test)]
mod tests {
    use super::*;

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
