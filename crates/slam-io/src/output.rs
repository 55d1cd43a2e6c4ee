//! Results of a run on disk, and reading them back.
//!
//! | file | contents |
//! |---|---|
//! | `trajectory.tum` | filtered body pose of every frame |
//! | `trajectory_smoothed.tum` | path that looks back over the whole run |
//! | `covariance.csv` | covariance of every filtered pose |
//! | `map.ply` | landmarks, coloured by uncertainty |
//! | `map.slam` | camera, keyframes and landmarks with covariance and descriptor, checksummed: a run can begin in it |
//! | `tracks.csv` | which landmark was found where at every keyframe |
//! | `frames.csv` | counts, filter health and milliseconds of every frame |
//! | `summary.json` | all figures, errors, seed, configuration, version |
//! | `report_data.json` | everything of the run that `map.slam` does not hold, so that [`read_run`] gives it back |
//!
//! Numbers are written with the fewest digits that read back as the same value, so equal
//! results give equal bytes; only `frames.csv`, `summary.json` and `report_data.json` carry wall
//! times. Every file is written under a temporary name, synced,
//! and renamed once all of them are complete: an interrupted write leaves no half file
//! under a final name.

mod atomic;
mod checkpoint;
mod error;
mod map_file;
mod ply;
mod report_data;
mod summary;
mod tables;
mod target;

use std::fs;
use std::path::Path;

use crate::record::RunRecord;
use atomic::{PendingFile, commit};
use mono_geometry::Se2;

pub use checkpoint::{
    Checkpoint, RunIdentity, read_checkpoint, remove_checkpoint, write_checkpoint,
};
pub use error::OutputError;
pub use map_file::{map_checksum, read_known_map, read_map, write_map};
pub use tables::{covariance_csv, tum as tum_text};
pub use target::{check_output_file, check_output_folder};

/// Files that later commands put beside the results of a run, and that speak of that run.
const LATER_FILES: [&str; 4] = [
    "report.html",
    "trajectory_batch.tum",
    "covariance_batch.csv",
    "batch.json",
];

/// Writes every result of `run` into the folder `dir`, creating it when needed.
///
/// The files of `extra`, (name, contents), are written with them: all of them appear together or
/// none does. Files of an earlier run in `dir` are replaced, and those that this run does not have are removed: a batch
/// or a page of another drive beside these results would be believed.
///
/// # Errors
/// [`OutputError::NotFinite`] before anything is written when a pose, covariance or
/// landmark is not finite; [`OutputError::Io`] when the file system refuses.
pub fn write_run(
    run: &RunRecord,
    dir: &Path,
    extra: &[(&str, Vec<u8>)],
) -> Result<(), OutputError> {
    check_finite(run)?;
    let trajectory = run
        .frames
        .iter()
        .map(|frame| (frame.time_s, frame.report.estimate.pose));
    let contents: [(&str, Vec<u8>); 9] = [
        ("trajectory.tum", tables::tum(trajectory).into_bytes()),
        (
            "trajectory_smoothed.tum",
            tables::tum(run.smoothed.iter().copied()).into_bytes(),
        ),
        (
            "covariance.csv",
            tables::filtered_covariance_csv(&run.frames)?,
        ),
        ("map.ply", ply::ply(&run.landmarks).into_bytes()),
        (
            "map.slam",
            map_file::encode_map(&run.landmarks, run.known_map.as_ref()),
        ),
        ("tracks.csv", tables::tracks_csv(&run.tracks)?),
        ("frames.csv", tables::frames_csv(&run.frames)?),
        ("summary.json", summary::summary_json(run)?),
        ("report_data.json", report_data::encode(run)?),
    ];
    write_all(dir, contents.iter().chain(extra))?;
    for name in LATER_FILES {
        if extra.iter().all(|(own, _)| *own != name) {
            match fs::remove_file(dir.join(name)) {
                Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                    return Err(OutputError::io(&dir.join(name), "removed", source));
                }
                _ => {}
            }
        }
    }
    Ok(())
}

/// Writes files, (name, contents), into the folder `dir`, creating it when needed: all of them appear together or none
/// does.
///
/// # Errors
/// [`OutputError::Io`] when the file system refuses.
pub fn write_files(dir: &Path, files: &[(&str, Vec<u8>)]) -> Result<(), OutputError> {
    write_all(dir, files.iter())
}

fn write_all<'a>(
    dir: &Path,
    files: impl Iterator<Item = &'a (&'a str, Vec<u8>)>,
) -> Result<(), OutputError> {
    fs::create_dir_all(dir).map_err(|source| OutputError::io(dir, "created", source))?;
    let pending = files
        .map(|(name, bytes)| PendingFile::write(&dir.join(name), bytes))
        .collect::<Result<Vec<_>, _>>()?;
    commit(pending)
}

/// Writes one file so that it appears whole or not at all.
///
/// The folder it goes to must exist. Symbolic links are followed; a device or a pipe is written through, never replaced.
///
/// # Errors
/// [`OutputError::Io`] when the file system refuses.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    commit(vec![PendingFile::write(path, bytes)?])
}

/// Reads a finished run back from its folder, for the report and for evaluation.
///
/// # Errors
/// [`OutputError`] when the folder is no run, `report_data.json` or `map.slam` is missing, damaged or of
/// another version, or `tracks.csv` is damaged; runs of earlier versions have no tracks.
pub fn read_run(dir: &Path) -> Result<RunRecord, OutputError> {
    check_run_folder(dir)?;
    let map = map_file::read(&dir.join("map.slam"))?;
    let tracks = tables::read_tracks(&dir.join("tracks.csv"))?;
    report_data::read(&dir.join("report_data.json"), map, tracks)
}

/// Refuses a path that is not the folder of a run: one that holds neither of the files that only a run has.
fn check_run_folder(dir: &Path) -> Result<(), OutputError> {
    let found = match fs::metadata(dir) {
        Err(source) if source.kind() == std::io::ErrorKind::NotFound => "nothing there",
        Err(source) => return Err(OutputError::io(dir, "read", source)),
        Ok(file) if !file.is_dir() => "a file",
        Ok(_) if has_any(dir, &["map.slam", "report_data.json"]) => return Ok(()),
        Ok(_) if has_any(dir, &["images", "camera.toml", "odometry.csv"]) => {
            "a sequence, which has not been run"
        }
        Ok(_) => "a folder without report_data.json",
    };
    Err(OutputError::NoRun {
        path: dir.to_path_buf(),
        found,
    })
}

fn has_any(dir: &Path, names: &[&str]) -> bool {
    // A dangling link is something that is there: the reader of the file has the better sentence.
    names
        .iter()
        .any(|name| dir.join(name).symlink_metadata().is_ok())
}

/// Refuses a run with a NaN or an infinity in it and names the first place.
fn check_finite(run: &RunRecord) -> Result<(), OutputError> {
    let refuse = |what: String| Err(OutputError::NotFinite { what });
    let finite_pose = |pose: &Se2| pose.x.is_finite() && pose.y.is_finite() && pose.phi.is_finite();
    for frame in &run.frames {
        if !(frame.time_s.is_finite() && finite_pose(&frame.report.estimate.pose)) {
            return refuse(format!("time or pose of frame {}", frame.index));
        }
        if !frame
            .report
            .estimate
            .covariance
            .iter()
            .all(|value| value.is_finite())
        {
            return refuse(format!("covariance of frame {}", frame.index));
        }
        let nis = frame.report.nis.unwrap_or(0.0);
        let acceptance = frame.report.es_acceptance.unwrap_or(0.0);
        if ![frame.report.n_eff, nis, acceptance]
            .iter()
            .all(|value| value.is_finite())
        {
            return refuse(format!(
                "effective particle number, NIS or acceptance of frame {}",
                frame.index
            ));
        }
    }
    for (index, (time_s, pose)) in run.smoothed.iter().enumerate() {
        if !(time_s.is_finite() && finite_pose(pose)) {
            return refuse(format!("pose {index} of the smoothed path"));
        }
    }
    for (index, pose) in run.dead_reckoning.iter().enumerate() {
        if !finite_pose(pose) {
            return refuse(format!("pose {index} of dead reckoning"));
        }
    }
    for landmark in &run.landmarks {
        let mut values = landmark.position.iter().chain(&landmark.covariance);
        if !values.all(|value| value.is_finite()) {
            return refuse(format!("landmark {}", landmark.id));
        }
    }
    let keyframes = run.known_map.iter().flat_map(|map| &map.keyframes);
    for (index, keyframe) in keyframes.enumerate() {
        let camera = &keyframe.world_from_camera;
        let mut values = camera.rotation.matrix().iter().chain(&camera.translation);
        if !(finite_pose(&keyframe.body)
            && values.all(|value| value.is_finite())
            && keyframe.covariance.iter().all(|value| value.is_finite()))
        {
            return refuse(format!("keyframe {index} of the map"));
        }
    }
    for landmark in run.known_map.iter().flat_map(|map| &map.landmarks) {
        let mut values = landmark
            .parameters
            .iter()
            .chain(&landmark.covariance)
            .chain(&landmark.last_direction)
            .chain([&landmark.existence]);
        if !values.all(|value| value.is_finite()) {
            return refuse(format!("landmark {} in its anchor", landmark.id));
        }
    }
    Ok(())
}
