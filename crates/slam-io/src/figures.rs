//! All figures of a run: counts, health of the filter, times, and errors against a reference.
//!
//! Errors are given where there is a reference path: of the filtered path, of the best
//! particle's whole path and of dead reckoning, each as it stands and after the best
//! planar rotation and translation were removed.

use std::collections::BTreeMap;

use mono_geometry::Se2;
use serde::Serialize;
use slam_pipeline::MapLandmark;
use trajectory_eval::{Alignment, Statistics, absolute_error, relative_error, spatial};

use crate::record::{FrameRecord, RunRecord, RunScale, StageTimes};

/// Figures of one path against the reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PathFigures {
    /// Poses matched in time.
    pub poses: usize,
    /// Distance to the reference, metres.
    pub position_m: Statistics,
    /// Heading difference, radians.
    pub heading_rad: Statistics,
    /// Distance at the last matched pose, metres.
    pub final_position_m: f64,
    /// Heading difference at the last matched pose, radians.
    pub final_heading_rad: f64,
    /// Root mean square drift from frame to frame, metres; `None` for a single pose.
    pub step_position_rmse_m: Option<f64>,
}

/// All figures of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunFigures {
    /// Number of frames.
    pub frames: usize,
    /// Frames that were filter steps.
    pub keyframes: usize,
    /// Time from the first to the last frame, seconds.
    pub duration_s: f64,
    /// Length of the filtered path, metres.
    pub path_length_m: f64,
    /// Landmarks in the final map.
    pub landmarks: usize,
    /// Median standard deviation of a landmark's position, metres; `None` for an empty map.
    pub landmark_uncertainty_median_m: Option<f64>,
    /// Mean number of keypoints over the frames that had any; `None` when none had.
    pub keypoints_mean: Option<f64>,
    /// Matches used per keyframe, mean; `None` without keyframes.
    pub matches_mean: Option<f64>,
    /// Share of matches that gate or consensus rejected; `None` without matches.
    pub outlier_share: Option<f64>,
    /// Frames that resampled.
    pub resampled: usize,
    /// Effective number of particles over keyframes, mean.
    pub n_eff_mean: Option<f64>,
    /// Smallest effective number of particles over keyframes.
    pub n_eff_min: Option<f64>,
    /// Distinct first-frame ancestors at the end.
    pub unique_ancestors_final: Option<usize>,
    /// Share of accepted evolution moves, mean over frames that tried any.
    pub es_acceptance_mean: Option<f64>,
    /// Normalised innovation squared per degree of freedom, mean over frames with matches.
    pub nis_mean: Option<f64>,
    /// How often each note was made, by its text.
    pub notes: BTreeMap<String, usize>,
    /// Mean milliseconds per frame by stage.
    pub stage_mean_ms: StageTimes,
    /// Wall time of the run, seconds.
    pub wall_s: f64,
    /// Frames per second of wall time; `None` when no time was measured.
    pub frames_per_s: Option<f64>,
    /// Errors by path (`filtered`, `smoothed`, `dead_reckoning`) and alignment (`none`, `se2`; `sim2` alone for a run
    /// whose scale is arbitrary); empty without a reference.
    pub errors: BTreeMap<&'static str, BTreeMap<&'static str, PathFigures>>,
}

/// Computes every figure of `run`; O(frames + landmarks).
pub fn run_figures(run: &RunRecord) -> RunFigures {
    let frames = &run.frames;
    let keyframes: Vec<&FrameRecord> = frames
        .iter()
        .filter(|frame| frame.report.keyframe)
        .collect();
    let matches: usize = frames.iter().map(|frame| frame.report.matches).sum();
    let outliers: usize = frames.iter().map(|frame| frame.report.outliers).sum();
    let mut uncertainties: Vec<f64> = run.landmarks.iter().map(uncertainty_m).collect();
    uncertainties.sort_by(f64::total_cmp);
    let mut notes = BTreeMap::new();
    for note in frames.iter().flat_map(|frame| &frame.report.notes) {
        *notes.entry(note.clone()).or_insert(0) += 1;
    }
    let duration_s = match (frames.first(), frames.last()) {
        (Some(first), Some(last)) => last.time_s - first.time_s,
        _ => 0.0,
    };
    RunFigures {
        frames: frames.len(),
        keyframes: keyframes.len(),
        duration_s,
        path_length_m: frames
            .windows(2)
            .map(|pair| {
                let (from, to) = (pair[0].report.estimate.pose, pair[1].report.estimate.pose);
                (to.x - from.x).hypot(to.y - from.y)
            })
            .sum(),
        landmarks: run.landmarks.len(),
        landmark_uncertainty_median_m: uncertainties.get(uncertainties.len() / 2).copied(),
        keypoints_mean: mean(
            frames
                .iter()
                .filter(|f| f.keypoints > 0)
                .map(|f| f.keypoints as f64),
        ),
        matches_mean: mean(keyframes.iter().map(|frame| frame.report.matches as f64)),
        outlier_share: (matches + outliers > 0)
            .then(|| outliers as f64 / (matches + outliers) as f64),
        resampled: frames.iter().filter(|frame| frame.report.resampled).count(),
        n_eff_mean: mean(keyframes.iter().map(|frame| frame.report.n_eff)),
        n_eff_min: keyframes
            .iter()
            .map(|frame| frame.report.n_eff)
            .min_by(f64::total_cmp),
        unique_ancestors_final: frames.last().map(|frame| frame.report.unique_ancestors),
        es_acceptance_mean: mean(frames.iter().filter_map(|frame| frame.report.es_acceptance)),
        nis_mean: mean(frames.iter().filter_map(|frame| frame.report.nis)),
        notes,
        stage_mean_ms: stage_means(frames),
        wall_s: run.wall_s,
        frames_per_s: (run.wall_s > 0.0).then(|| frames.len() as f64 / run.wall_s),
        errors: errors(run),
    }
}

/// Root of the covariance's trace: the typical distance between the estimated landmark and the true one, metres.
pub fn uncertainty_m(landmark: &MapLandmark) -> f64 {
    landmark.covariance.trace().max(0.0).sqrt()
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (count, sum) = values.fold((0_usize, 0.0), |(count, sum), value| {
        (count + 1, sum + value)
    });
    (count > 0).then(|| sum / count as f64)
}

fn stage_means(frames: &[FrameRecord]) -> StageTimes {
    let over = |stage: fn(&StageTimes) -> f64| {
        mean(frames.iter().map(|frame| stage(&frame.times))).unwrap_or(0.0)
    };
    StageTimes {
        decode_ms: over(|times| times.decode_ms),
        features_ms: over(|times| times.features_ms),
        association_ms: over(|times| times.association_ms),
        proposal_ms: over(|times| times.proposal_ms),
        evolution_ms: over(|times| times.evolution_ms),
        mapping_ms: over(|times| times.mapping_ms),
        total_ms: over(|times| times.total_ms),
    }
}

fn errors(run: &RunRecord) -> BTreeMap<&'static str, BTreeMap<&'static str, PathFigures>> {
    let Some(reference) = &run.reference else {
        return BTreeMap::new();
    };
    let alignments: &[(&str, Alignment)] = match run.scale {
        RunScale::Metric => &[("none", Alignment::None), ("se2", Alignment::Se2)],
        RunScale::Arbitrary => &[("sim2", Alignment::Sim2)],
    };
    let times = run.frames.iter().map(|frame| frame.time_s);
    let filtered: Vec<_> = run
        .frames
        .iter()
        .map(|frame| (frame.time_s, frame.report.estimate.pose))
        .collect();
    let dead_reckoning: Vec<_> = times.zip(run.dead_reckoning.iter().copied()).collect();
    [
        ("filtered", filtered.as_slice()),
        ("smoothed", run.smoothed.as_slice()),
        ("dead_reckoning", dead_reckoning.as_slice()),
    ]
    .into_iter()
    .map(|(name, path)| {
        let by_alignment = alignments
            .iter()
            .filter_map(|&(label, alignment)| {
                Some((label, path_figures(path, reference, alignment)?))
            })
            .collect();
        (name, by_alignment)
    })
    .collect()
}

/// `None` when the path cannot be compared (no common time, or a robot that never moved).
fn path_figures(
    path: &[(f64, Se2)],
    reference: &[(f64, Se2)],
    alignment: Alignment,
) -> Option<PathFigures> {
    let (path, reference) = (spatial(path), spatial(reference));
    let absolute = absolute_error(&path, &reference, alignment).ok()?;
    let relative = relative_error(&path, &reference, 1, alignment).ok();
    Some(PathFigures {
        poses: absolute.matched.len(),
        position_m: absolute.translation_m,
        heading_rad: absolute.rotation_rad,
        final_position_m: absolute.last().translation_m,
        final_heading_rad: absolute.last().rotation_rad,
        step_position_rmse_m: relative.map(|relative| relative.translation_m.rmse),
    })
}
