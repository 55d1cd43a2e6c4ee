//! The smoothed path of a finished run: the batch solution over its associations where there is one, else the path of
//! the best particle, and where that contradicts the filter, the filtered path.
//!
//! A particle keeps its path in a unit of its own, and the metres of all of it come from the present scale, so that path and map agree
//! in every pixel. Along a street, where no old place is seen again, the unit drifts, and the beginning of such a path
//! can be off by a tenth of its length. It then no longer ends where the filter says that the robot is.

use mono_geometry::Se2;
use nalgebra::Vector2;
use slam_batch::{BatchError, LearnedConstant, Model, Problem, Recording, Solution, solve};
use slam_io::{LearnedValue, Sequence, SmootherRecord, TrackRow};
use slam_pipeline::config::{Method, ValidConfig};
use slam_pipeline::{OdometryInterval, PoseEstimate, Rig};

/// Keyframes beyond which a run does not wait for its batch: the dense system of so many takes some ten seconds and half
/// a gigabyte.
const MAX_KEYFRAMES: usize = 600;
/// Names in `summary.json`.
const BATCH: &str = "batch";
const BEST_PARTICLE: &str = "best particle";
const FILTERED: &str = "filtered";
/// Squared normalised distance of the ends of the two paths that is no chance: 0.1 % of chi-square with two degrees of freedom.
const CONTRADICTION: f64 = 13.8;

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
    last: &PoseEstimate,
    found_again: bool,
) -> (Vec<Se2>, SmootherRecord) {
    let contradicted = config.filter.method == Method::Exact && contradicts(&best, last);
    let (method, best) = if contradicted {
        (FILTERED, recording.filtered().collect())
    } else {
        (BEST_PARTICLE, best)
    };
    let otherwise = |note: String| SmootherRecord {
        method: method.to_owned(),
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

/// Whether a path ends elsewhere than the filter says, given its covariance.
fn contradicts(path: &[Se2], last: &PoseEstimate) -> bool {
    let Some(end) = path.last() else { return false };
    let apart = Vector2::new(end.x - last.pose.x, end.y - last.pose.y);
    last.covariance
        .fixed_view::<2, 2>(0, 0)
        .into_owned()
        .cholesky()
        .is_some_and(|factor| apart.dot(&factor.solve(&apart)) > CONTRADICTION)
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
                size_px: s.size_px,
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
    use nalgebra::Matrix3;
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

    fn estimate(x: f64) -> PoseEstimate {
        PoseEstimate {
            pose: Se2::new(x, 0.0, 0.0),
            covariance: Matrix3::identity() * 1e-4,
        }
    }

    /// On a street of 160 m a unit that drifted by a tenth put the smoothed path 8 m beside the filtered one.
    #[test]
    fn regress_a_path_that_does_not_end_where_the_robot_is_gives_way_to_the_filtered_one() {
        let config = Config::default().check().expect("valid");
        let mut recording = Recording::default();
        let filtered: Vec<Se2> = (0..3).map(|i| Se2::new(f64::from(i), 0.0, 0.0)).collect();
        for pose in &filtered {
            recording.push_frame(*pose, true, &[], []);
        }
        for (scale, method) in [(1.01, BEST_PARTICLE), (0.9, FILTERED)] {
            let best: Vec<Se2> = filtered
                .iter()
                .map(|p| Se2::new(scale * p.x, 0.0, 0.0))
                .collect();
            let (path, smoother) = smoothed(
                &recording,
                rig(),
                &config,
                best.clone(),
                &estimate(2.0),
                false,
            );
            assert_eq!(smoother.method, method);
            assert_eq!(
                path,
                if method == FILTERED {
                    filtered.clone()
                } else {
                    best
                }
            );
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
            let last = estimate(best[best.len() - 1].x);
            let (path, smoother) = smoothed(&recording, rig(), &config, best.clone(), &last, false);
            assert_eq!(path, best);
            assert_eq!(smoother.method, BEST_PARTICLE);
            let note = smoother.note.expect("a reason");
            assert!(note.contains(reason), "{note}");
        }
    }
}
