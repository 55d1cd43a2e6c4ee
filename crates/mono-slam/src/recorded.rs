//! A finished run read back from its folder, ready for a batch over its associations.

use std::path::{Path, PathBuf};

use mono_geometry::motion::{OdometrySample, held_between};
use mono_geometry::{GeometryError, Se2};
use nalgebra::Vector2;
use slam_batch::{Model, Problem, Recording};
use slam_io::{
    CameraFile, OutputError, RunRecord, SequenceError, TrackRow, configuration, read_run,
    read_run_inputs,
};
use slam_pipeline::config::{Config, ConfigError, ValidConfig};
use slam_pipeline::{OdometryInterval, Rig};
use thiserror::Error;

/// Why a run cannot be solved again.
#[derive(Debug, Error)]
pub enum RecordedError {
    /// A result of the run is missing or damaged.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The camera or the odometry beside the results is missing or damaged.
    #[error(transparent)]
    Input(#[from] SequenceError),
    /// The camera file describes no camera.
    #[error("camera.toml: {0}")]
    Camera(#[from] GeometryError),
    /// The configuration of the run is not one of this version.
    #[error("{}: its {fault}", path.display())]
    Syntax {
        /// The run.
        path: PathBuf,
        /// The fault of the text.
        fault: configuration::SyntaxError,
    },
    /// A value of the configuration is out of its range.
    #[error("{}: its configuration: {fault}", path.display())]
    Config {
        /// The run.
        path: PathBuf,
        /// The value out of range.
        fault: ConfigError,
    },
    /// The run was made by a version that kept no associations.
    #[error("{}: expected a run with associations in tracks.csv, found none", path.display())]
    NoTracks {
        /// The run.
        path: PathBuf,
    },
    /// A track names a frame that is no keyframe of the run.
    #[error("{}: expected keyframes of the run in tracks.csv, found frame {frame}", path.display())]
    Frame {
        /// The run.
        path: PathBuf,
        /// Index of the frame.
        frame: usize,
    },
}

/// A finished run with everything that a batch over it needs.
#[derive(Debug, Clone)]
pub struct RecordedRun {
    /// The results.
    pub record: RunRecord,
    /// Associations and odometry by frame.
    pub recording: Recording,
    /// Camera and mount that the run used.
    pub rig: Rig,
    /// The same as its file holds it.
    pub camera: CameraFile,
    /// Configuration of the run.
    pub config: ValidConfig,
}

impl RecordedRun {
    /// Reads the folder that `mono-slam run` wrote.
    ///
    /// # Errors
    /// [`RecordedError`] naming the file and what it lacks.
    pub fn open(dir: &Path) -> Result<Self, RecordedError> {
        let record = read_run(dir)?;
        if record.tracks.is_empty() {
            return Err(RecordedError::NoTracks {
                path: dir.to_path_buf(),
            });
        }
        let first_s = record.frames.first().map_or(0.0, |f| f.time_s);
        let (camera, odometry) = read_run_inputs(dir, first_s)?;
        let (lens, mount) = camera.camera_and_mount()?;
        let config = configuration::from_toml(&record.configuration).map_err(|fault| {
            RecordedError::Syntax {
                path: dir.to_path_buf(),
                fault,
            }
        })?;
        let config = check(config, dir)?;
        let samples: Vec<OdometrySample> = odometry.into_iter().map(Into::into).collect();
        Ok(Self {
            recording: recording(&record, &samples, dir)?,
            record,
            rig: Rig {
                camera: lens,
                mount,
            },
            camera,
            config,
        })
    }

    /// The batch over the run, started at its smoothed path.
    #[must_use]
    pub fn problem(&self, model: Model) -> Problem {
        let path: Vec<Se2> = self.record.smoothed.iter().map(|(_, pose)| *pose).collect();
        self.recording.problem(self.rig, model, &path)
    }
}

fn check(config: Config, dir: &Path) -> Result<ValidConfig, RecordedError> {
    config.check().map_err(|fault| RecordedError::Config {
        path: dir.to_path_buf(),
        fault,
    })
}

fn recording(
    record: &RunRecord,
    samples: &[OdometrySample],
    dir: &Path,
) -> Result<Recording, RecordedError> {
    let mut recording = Recording::default();
    let mut tracks: &[TrackRow] = &record.tracks;
    let mut before_s = None;
    for frame in &record.frames {
        let rows: Vec<OdometryInterval> = before_s.map_or_else(Vec::new, |from| {
            held_between(samples, from, frame.time_s)
                .into_iter()
                .map(|(sample, duration_s)| OdometryInterval {
                    duration_s,
                    v_mps: sample.v_mps,
                    omega_radps: sample.omega_radps,
                })
                .collect()
        });
        before_s = Some(frame.time_s);
        let here = tracks.partition_point(|row| row.frame <= frame.index);
        let seen = &tracks[..here];
        if let Some(stray) = seen
            .iter()
            .find(|row| row.frame != frame.index || !frame.report.keyframe)
        {
            return Err(RecordedError::Frame {
                path: dir.to_path_buf(),
                frame: stray.frame,
            });
        }
        tracks = &tracks[here..];
        recording.push_frame(
            frame.report.estimate.pose,
            frame.report.keyframe,
            &rows,
            seen.iter()
                .map(|row| (row.landmark, Vector2::new(row.x_px, row.y_px), row.size_px)),
        );
    }
    match tracks.first() {
        Some(stray) => Err(RecordedError::Frame {
            path: dir.to_path_buf(),
            frame: stray.frame,
        }),
        None => Ok(recording),
    }
}
