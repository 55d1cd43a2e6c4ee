//! `report_data.json`: everything of a run that `map.slam` does not hold.
//!
//! Pictures are base64 JPEG, so the file stays a readable JSON text of moderate size. Earlier versions wrote a few large
//! ones as PNG; they are read too.

use std::borrow::Cow;
use std::fs;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use mono_geometry::Se2;
use serde::{Deserialize, Serialize};
use slam_pipeline::KeypointFate;

use super::error::OutputError;
use super::map_file::MapFile;
use crate::disk::{Fate, Pose};
use crate::images::GreyImage;
use crate::record::{FrameRecord, RunRecord, RunScale, SmootherRecord, TrackRow};
use crate::snapshot::{DrawnKeypoint, FrameSnapshot};
use crate::warning::Warning;

/// Version written, and the only one read.
const FORMAT_VERSION: u32 = 1;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ReportData<'a> {
    format_version: u32,
    sequence: Cow<'a, str>,
    method: Cow<'a, str>,
    particles: usize,
    seed: u64,
    wall_s: f64,
    configuration: Cow<'a, str>,
    /// Absent in files of earlier versions.
    #[serde(default)]
    scale: RunScale,
    /// Absent in files of earlier versions.
    #[serde(default)]
    warnings: Cow<'a, [Warning]>,
    frames: Cow<'a, [FrameRecord]>,
    smoothed: Vec<(f64, Pose)>,
    /// Absent in files of earlier versions.
    #[serde(default)]
    smoother: Option<Cow<'a, SmootherRecord>>,
    dead_reckoning: Vec<Pose>,
    reference: Option<Vec<(f64, Pose)>>,
    /// Absent in files of earlier versions.
    #[serde(default)]
    pictures: Vec<Picture<'a>>,
    /// Only in files of earlier versions.
    #[serde(default, skip_serializing)]
    snapshots: Vec<EarlierPicture>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Picture<'a> {
    index: usize,
    width: usize,
    height: usize,
    jpeg_base64: String,
    keypoints: Cow<'a, [DrawnKeypoint]>,
}

#[derive(Deserialize)]
struct EarlierPicture {
    index: usize,
    png_base64: String,
    keypoints: Vec<EarlierKeypoint>,
}

#[derive(Deserialize)]
struct EarlierKeypoint {
    x: f32,
    y: f32,
    sigma: f32,
    #[serde(with = "Fate")]
    fate: KeypointFate,
    predicted: Option<[f32; 2]>,
}

/// The bytes of the file.
pub(super) fn encode(run: &RunRecord) -> Result<Vec<u8>, OutputError> {
    let pictures = run
        .snapshots
        .iter()
        .map(|snapshot| Picture {
            index: snapshot.index,
            width: snapshot.width,
            height: snapshot.height,
            jpeg_base64: STANDARD.encode(&snapshot.jpeg),
            keypoints: Cow::Borrowed(&snapshot.keypoints),
        })
        .collect();
    let data = ReportData {
        format_version: FORMAT_VERSION,
        sequence: Cow::Borrowed(&run.sequence),
        method: Cow::Borrowed(&run.method),
        particles: run.particles,
        seed: run.seed,
        wall_s: run.wall_s,
        configuration: Cow::Borrowed(&run.configuration),
        scale: run.scale,
        warnings: Cow::Borrowed(&run.warnings),
        frames: Cow::Borrowed(&run.frames),
        smoothed: to_disk(&run.smoothed),
        smoother: run.smoother.as_ref().map(Cow::Borrowed),
        dead_reckoning: run.dead_reckoning.iter().copied().map(Pose::from).collect(),
        reference: run.reference.as_deref().map(to_disk),
        pictures,
        snapshots: Vec::new(),
    };
    serde_json::to_vec(&data).map_err(OutputError::encoding)
}

/// A run from the file, its map and its tracks.
pub(super) fn read(
    path: &Path,
    map: MapFile,
    tracks: Vec<TrackRow>,
) -> Result<RunRecord, OutputError> {
    let bytes = fs::read(path).map_err(|source| OutputError::io(path, "read", source))?;
    let data: ReportData<'_> = serde_json::from_slice(&bytes).map_err(|error| {
        OutputError::malformed(path, "the data of a finished run", error.to_string())
    })?;
    if data.format_version != FORMAT_VERSION {
        return Err(OutputError::malformed(
            path,
            format!("format version {FORMAT_VERSION}"),
            data.format_version.to_string(),
        ));
    }
    let mut snapshots = data
        .pictures
        .into_iter()
        .map(|picture| decoded(path, picture))
        .collect::<Result<Vec<_>, _>>()?;
    for picture in data.snapshots {
        snapshots.push(converted(path, data.frames.len(), picture)?);
    }
    Ok(RunRecord {
        sequence: data.sequence.into_owned(),
        scale: data.scale,
        predicted: Vec::new(),
        warnings: data.warnings.into_owned(),
        frames: data.frames.into_owned(),
        smoothed: from_disk(data.smoothed),
        smoother: data.smoother.map(Cow::into_owned),
        tracks,
        landmarks: map.landmarks,
        known_map: map.known,
        dead_reckoning: data.dead_reckoning.into_iter().map(Pose::into).collect(),
        reference: data.reference.map(from_disk),
        snapshots,
        configuration: data.configuration.into_owned(),
        seed: data.seed,
        particles: data.particles,
        method: data.method.into_owned(),
        wall_s: data.wall_s,
    })
}

fn to_disk(path: &[(f64, Se2)]) -> Vec<(f64, Pose)> {
    path.iter().map(|&(t_s, pose)| (t_s, pose.into())).collect()
}

fn from_disk(path: Vec<(f64, Pose)>) -> Vec<(f64, Se2)> {
    path.into_iter()
        .map(|(t_s, pose)| (t_s, pose.into()))
        .collect()
}

fn decoded(path: &Path, picture: Picture<'_>) -> Result<FrameSnapshot, OutputError> {
    Ok(FrameSnapshot {
        index: picture.index,
        width: picture.width,
        height: picture.height,
        jpeg: bytes(path, picture.index, &picture.jpeg_base64)?,
        keypoints: picture.keypoints.into_owned(),
    })
}

/// A picture as earlier versions wrote it.
fn converted(
    path: &Path,
    frames: usize,
    picture: EarlierPicture,
) -> Result<FrameSnapshot, OutputError> {
    let index = picture.index;
    let png = bytes(path, index, &picture.png_base64)?;
    let pixels = image::load_from_memory_with_format(&png, image::ImageFormat::Png)
        .map_err(|error| {
            OutputError::malformed(
                path,
                format!("a picture of frame {index}"),
                error.to_string(),
            )
        })?
        .into_luma8();
    let image = GreyImage {
        width: pixels.width() as usize,
        height: pixels.height() as usize,
        pixels: pixels.into_raw(),
    };
    let keypoints: Vec<DrawnKeypoint> = picture
        .keypoints
        .into_iter()
        .map(|k| DrawnKeypoint {
            x: k.x,
            y: k.y,
            sigma: k.sigma,
            fate: k.fate,
            predicted: k.predicted,
        })
        .collect();
    Ok(FrameSnapshot::of_image(index, frames, &image).with_keypoints(&keypoints))
}

fn bytes(path: &Path, index: usize, base64: &str) -> Result<Vec<u8>, OutputError> {
    STANDARD.decode(base64).map_err(|error| {
        let found = format!("text that is not base64: {error}");
        OutputError::malformed(path, format!("a picture of frame {index}"), found)
    })
}
