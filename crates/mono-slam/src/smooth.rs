//! The smoothed path of a finished run: the batch solution over its associations where there is one, else the path of
//! the best particle.

use mono_geometry::Se2;
use slam_batch::{BatchError, LearnedConstant, Model, Problem, Recording, Solution, solve};
use slam_io::{LearnedValue, Sequence, SmootherRecord, TrackRow};
use slam_pipeline::config::{Method, ValidConfig};
use slam_pipeline::{OdometryInterval, Rig};

/// Names in `summary.json`.
const BATCH: &str = "batch";
const BEST_PARTICLE: &str = "best particle";

/// Odometry since the frame before `index`; none before the first.
pub(crate) fn odometry_before(sequence: &Sequence, index: usize) -> Vec<OdometryInterval> {
    if index == 0 {
        return Vec::new();
    }
    sequence
        .odometry_between(sequence.times_s[index - 1], sequence.times_s[index])
        .into_iter()
        .map(|(duration_s, v_mps, omega_radps)| OdometryInterval {
            duration_s,
            v_mps,
            omega_radps,
        })
        .collect()
}

/// The smoothed path, one pose a frame, and where it comes from.
///
/// Only the method `exact` is smoothed by the batch: the others reproduce what they are compared for.
pub(crate) fn smoothed(
    recording: &Recording,
    rig: Rig,
    config: &ValidConfig,
    best: Vec<Se2>,
) -> (Vec<Se2>, SmootherRecord) {
    let otherwise = |note: String| SmootherRecord {
        method: BEST_PARTICLE.to_owned(),
        note: Some(note),
        iterations: 0,
        sightings: 0,
        constants: Vec::new(),
    };
    if config.filter.method != Method::Exact {
        let note = format!("the method {} is not smoothed", config.filter.method.name());
        return (best, otherwise(note));
    }
    match batch(&recording.problem(rig, Model::of(config), &best)) {
        Ok(solution) => {
            let path = recording
                .whole_path(&solution)
                .iter()
                .map(|e| e.pose)
                .collect();
            (path, record(&solution))
        }
        Err(note) => (best, otherwise(note)),
    }
}

/// The solution, or one clause on why there is none.
fn batch(problem: &Problem) -> Result<Solution, String> {
    let solution = solve(problem).map_err(|e: BatchError| format!("no batch solution: {e}"))?;
    if solution.converged {
        Ok(solution)
    } else {
        Err(format!(
            "the batch has not converged after {} iterations",
            solution.iterations
        ))
    }
}

fn record(solution: &Solution) -> SmootherRecord {
    SmootherRecord {
        method: BATCH.to_owned(),
        note: None,
        iterations: solution.iterations,
        sightings: solution.fit.sightings,
        constants: solution.constants.iter().map(learned_value).collect(),
    }
}

/// A learned constant as files name it.
#[must_use]
pub fn learned_value(learned: &LearnedConstant) -> LearnedValue {
    LearnedValue {
        name: learned.constant.name().to_owned(),
        value: learned.value,
        sigma: learned.sigma,
        prior_sigma: learned.prior_sigma,
    }
}

/// Rows of `tracks.csv`, in order of frame and landmark.
pub(crate) fn track_rows(recording: &Recording) -> Vec<TrackRow> {
    let mut rows: Vec<TrackRow> = recording
        .tracks()
        .flat_map(|(landmark, sightings)| {
            sightings.iter().map(move |s| TrackRow {
                frame: recording.keyframes()[s.keyframe],
                landmark,
                x_px: s.pixel.x,
                y_px: s.pixel.y,
            })
        })
        .collect();
    rows.sort_by_key(|row| (row.frame, row.landmark));
    rows
}
