//! The text tables: TUM trajectories, `covariance.csv`, `frames.csv`.

use std::fmt::Write as _;
use std::path::Path;

use mono_geometry::Se2;
use slam_pipeline::PoseEstimate;

use super::error::OutputError;
use crate::record::{FrameRecord, TrackRow};

/// Poses (time in seconds, body pose) as the text of a TUM file: height zero, rotation about z.
pub fn tum(path: impl Iterator<Item = (f64, Se2)>) -> String {
    let mut text = String::from("# t_s x_m y_m z_m qx qy qz qw (body in world)\n");
    for (t_s, pose) in path {
        let (sin, cos) = (0.5 * pose.phi).sin_cos();
        // Writing into a String cannot fail.
        let _ = writeln!(text, "{t_s} {} {} 0 0 0 {sin} {cos}", pose.x, pose.y);
    }
    text
}

/// Upper triangle of the covariance of every filtered pose.
pub(super) fn filtered_covariance_csv(frames: &[FrameRecord]) -> Result<Vec<u8>, OutputError> {
    let times: Vec<f64> = frames.iter().map(|frame| frame.time_s).collect();
    let estimates: Vec<PoseEstimate> = frames.iter().map(|frame| frame.report.estimate).collect();
    covariance_csv(&times, &estimates)
}

/// The bytes of a `covariance.csv`: the upper triangle of every pose covariance, one estimate a time.
///
/// # Errors
/// [`OutputError`] of the encoding.
pub fn covariance_csv(times_s: &[f64], estimates: &[PoseEstimate]) -> Result<Vec<u8>, OutputError> {
    let header = ["frame", "t_s", "xx", "xy", "xphi", "yy", "yphi", "phiphi"];
    let rows: Vec<(usize, f64, &PoseEstimate)> = times_s
        .iter()
        .zip(estimates)
        .enumerate()
        .map(|(index, (time_s, estimate))| (index, *time_s, estimate))
        .collect();
    table(header, &rows, |(index, time_s, estimate)| {
        let c = &estimate.covariance;
        [
            index.to_string(),
            time_s.to_string(),
            c[(0, 0)].to_string(),
            c[(0, 1)].to_string(),
            c[(0, 2)].to_string(),
            c[(1, 1)].to_string(),
            c[(1, 2)].to_string(),
            c[(2, 2)].to_string(),
        ]
    })
}

/// Header of `frames.csv`.
const FRAME_COLUMNS: [&str; 23] = [
    "frame",
    "t_s",
    "keyframe",
    "keypoints",
    "matches",
    "new_landmarks",
    "outliers",
    "landmarks",
    "n_eff",
    "unique_ancestors",
    "resampled",
    "es_acceptance",
    "nis",
    "decode_ms",
    "features_ms",
    "association_ms",
    "proposal_ms",
    "evolution_ms",
    "mapping_ms",
    "total_ms",
    "state",
    "revisit",
    "notes",
];

/// One row per frame; an empty cell means "does not apply".
pub(super) fn frames_csv(frames: &[FrameRecord]) -> Result<Vec<u8>, OutputError> {
    let optional = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    table(FRAME_COLUMNS, frames, |frame| {
        let times = &frame.times;
        [
            frame.index.to_string(),
            frame.time_s.to_string(),
            u8::from(frame.report.keyframe).to_string(),
            frame.keypoints.to_string(),
            frame.report.matches.to_string(),
            frame.report.new_landmarks.to_string(),
            frame.report.outliers.to_string(),
            frame.report.landmarks.to_string(),
            frame.report.n_eff.to_string(),
            frame.report.unique_ancestors.to_string(),
            u8::from(frame.report.resampled).to_string(),
            optional(frame.report.es_acceptance),
            optional(frame.report.nis),
            times.decode_ms.to_string(),
            times.features_ms.to_string(),
            times.association_ms.to_string(),
            times.proposal_ms.to_string(),
            times.evolution_ms.to_string(),
            times.mapping_ms.to_string(),
            times.total_ms.to_string(),
            frame.report.tracking.name().to_owned(),
            u8::from(frame.report.revisit).to_string(),
            frame.report.notes.join("; "),
        ]
    })
}

/// Header of `tracks.csv`.
const TRACK_COLUMNS: [&str; 5] = ["frame", "landmark", "x_px", "y_px", "size_px"];

/// One row per sighting.
pub(super) fn tracks_csv(tracks: &[TrackRow]) -> Result<Vec<u8>, OutputError> {
    table(TRACK_COLUMNS, tracks, |row| {
        [
            row.frame.to_string(),
            row.landmark.to_string(),
            row.x_px.to_string(),
            row.y_px.to_string(),
            row.size_px.to_string(),
        ]
    })
}

/// Reads `tracks.csv` back; no file, no tracks.
pub(super) fn read_tracks(path: &Path) -> Result<Vec<TrackRow>, OutputError> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    let malformed = |error: csv::Error| {
        OutputError::malformed(
            path,
            "frame,landmark,x_px,y_px,size_px in every row",
            error.to_string(),
        )
    };
    csv::Reader::from_path(path)
        .map_err(malformed)?
        .deserialize()
        .collect::<Result<_, _>>()
        .map_err(malformed)
}

/// A header and a row for every item.
fn table<Item, const COLUMNS: usize>(
    header: [&str; COLUMNS],
    items: &[Item],
    row: impl Fn(&Item) -> [String; COLUMNS],
) -> Result<Vec<u8>, OutputError> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(header).map_err(OutputError::encoding)?;
    for item in items {
        writer
            .write_record(row(item))
            .map_err(OutputError::encoding)?;
    }
    writer.into_inner().map_err(OutputError::encoding)
}
