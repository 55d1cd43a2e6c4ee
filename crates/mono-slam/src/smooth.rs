//! The smoothed path of a finished run: the batch solution over its associations where there is one, else the path of
//! the best particle.

use mono_geometry::Se2;
use slam_batch::{BatchError, LearnedConstant, Model, Problem, Recording, Solution, solve};
use slam_io::{LearnedValue, Sequence, SmootherRecord, TrackRow};
use slam_pipeline::config::{Method, ValidConfig};
use slam_pipeline::{OdometryInterval, Rig};

/// Keyframes beyond which a run does not wait for its batch: the dense system of so many takes some ten seconds and half
/// a gigabyte.
const MAX_KEYFRAMES: usize = 600;
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

/// The record of a run that began in a map: a batch over its own sightings alone would leave the frame of the map.
pub(crate) fn not_smoothed() -> SmootherRecord {
    SmootherRecord {
        method: BEST_PARTICLE.to_owned(),
        note: Some(
            "a run that begins in a map is not smoothed: its world is that of the map".to_owned(),
        ),
        iterations: 0,
        sightings: 0,
        constants: Vec::new(),
    }
}

/// The smoothed path, one pose a frame, and where it comes from.
///
/// A run whose robot was `found_again` by the looks of a place is not smoothed by the batch, which trusts odometry throughout.
/// Only the method `exact` is smoothed by the batch: the others reproduce what they are compared for.
pub(crate) fn smoothed(
    recording: &Recording,
    rig: Rig,
    config: &ValidConfig,
    best: Vec<Se2>,
    found_again: bool,
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
    if found_again {
        let note =
            "the robot was lost and found elsewhere, odometry does not lead there".to_owned();
        return (best, otherwise(note));
    }
    let keyframes = recording.keyframes().len();
    if keyframes > MAX_KEYFRAMES {
        let note = format!(
            "{keyframes} keyframes, a run solves at most {MAX_KEYFRAMES} at once; mono-slam batch solves any number"
        );
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

#[cfg(test)]
mod tests {
    use super::*;
    use mono_geometry::{Camera, Distortion, Mount, Pinhole};
    use slam_pipeline::config::Config;

    fn rig() -> Rig {
        let pinhole = Pinhole {
            width: 320,
            height: 240,
            fx: 300.0,
            fy: 300.0,
            cx: 160.0,
            cy: 120.0,
        };
        Rig {
            camera: Camera::new(pinhole, Distortion::None).expect("a camera"),
            mount: Mount::forward(),
        }
    }

    #[test]
    fn without_a_batch_the_path_is_that_of_the_best_particle_and_says_why() {
        let config = Config::default().check().expect("valid");
        for (frames, reason) in [
            (1, "at least 2 keyframes, found 1"),
            (3, "no landmark was seen from two keyframes"),
            (601, "601 keyframes, a run solves at most 600 at once"),
        ] {
            let mut recording = Recording::default();
            let mut best = Vec::new();
            for i in 0..frames {
                let pose = Se2::new(0.1 * f64::from(i), 0.0, 0.0);
                recording.push_frame(pose, true, &[], []);
                best.push(pose);
            }
            let (path, smoother) = smoothed(&recording, rig(), &config, best.clone(), false);
            assert_eq!(path, best);
            assert_eq!(smoother.method, BEST_PARTICLE);
            let note = smoother.note.expect("a reason");
            assert!(note.contains(reason), "{note}");
        }
    }
}
