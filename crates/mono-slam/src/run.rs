//! A whole sequence through the frame loop.

use mono_geometry::motion::{OdometrySample, exact_arc};
use mono_geometry::{Camera, Se2};
use slam_batch::Recording;
use slam_io::{
    DrawnKeypoint, FrameRecord, FrameSnapshot, OdometrySource, RunRecord, RunScale, Sequence,
    StageTimes, configuration,
};
use slam_pipeline::config::ValidConfig;
use slam_pipeline::{
    FrameInput, FrameReport, KeypointReport, Rig, Slam, SlamError, Tracking, detector_of,
};
use vision_sift::Features;

use crate::detection::{Detected, FrameDetector};
use crate::pairs::PairCollector;
pub use crate::run_error::RunError;
use crate::smooth::{odometry_before, smoothed, track_rows};
use crate::stopwatch::{Clock, Lap, StageClock};
use crate::warnings;
use crate::without_odometry::{self, expected};

/// Frames kept for the picture strip.
const SNAPSHOTS: usize = 8;

/// How far a run is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Frames done.
    pub frame: usize,
    /// Frames in all.
    pub frames: usize,
    /// Landmarks in the map.
    pub landmarks: usize,
}

/// Runs `sequence` under `config` and returns everything it found. Standard deviations that the camera file states take
/// the place of those of the configuration.
///
/// `clock` gives seconds for the stage times and for nothing else; `progress`
/// is called after every frame. The estimate is the same, bit for bit, for any
/// number of threads.
///
/// # Errors
/// [`RunError`]; nothing was written.
pub fn run_sequence(
    sequence: &Sequence,
    config: &ValidConfig,
    clock: &Clock<'_>,
    progress: &mut (dyn FnMut(Progress) + Send),
) -> Result<RunRecord, RunError> {
    let config = &sequence.camera.considered_in(config).check()?;
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(config.filter.threads as usize)
        .build()?;
    pool.install(|| run_in_pool(sequence, config, clock, progress))
}

fn run_in_pool(
    sequence: &Sequence,
    config: &ValidConfig,
    clock: &Clock<'_>,
    progress: &mut (dyn FnMut(Progress) + Send),
) -> Result<RunRecord, RunError> {
    let (camera, mount) = sequence.camera.camera_and_mount()?;
    let mut detector = FrameDetector::new(sequence, detector_of(config)?, clock);
    let rig = Rig { camera, mount };
    let mut slam = Slam::new(rig, config)?;
    let count = sequence.images.len();
    let every = count.div_ceil(SNAPSHOTS).max(1);
    let started = clock();
    let mut recording = Recording::default();
    let mut pairs = PairCollector::new(count);
    let mut frames = Vec::with_capacity(count);
    let mut snapshots = Vec::new();
    let measured = sequence.odometry_source != OdometrySource::None;
    let mut predictions = Vec::new();
    let mut wheels = Se2::identity();
    let mut dead_reckoning = Vec::with_capacity(count);
    let mut ahead = detector.detect(0);
    while let Some(detected) = ahead {
        let Detected {
            image,
            features,
            decode_ms,
            features_ms,
        } = detected?;
        let index = frames.len();
        let odometry = if measured {
            odometry_before(sequence, index)
        } else {
            let expected = expected(&slam.smoothed_path(), &sequence.times_s);
            predictions.extend(expected);
            expected.into_iter().collect()
        };
        if measured {
            for o in &odometry {
                wheels = wheels.compose(&exact_arc(o.v_mps, o.omega_radps, o.duration_s));
            }
            dead_reckoning.push(wheels);
        }
        let input = FrameInput {
            features: &features,
            odometry: &odometry,
        };
        let (stepped, next) = rayon::join(
            || timed_step(&mut slam, &input, clock),
            || {
                pairs.observe(index, sequence.times_s[index], &features, &camera);
                detector.detect(index + 1)
            },
        );
        ahead = next;
        let (mut report, stages) = stepped?;
        recording.push(&features, &report, &odometry);
        let keypoints = std::mem::take(&mut report.keypoints);
        if index % every == 0 {
            snapshots.push(FrameSnapshot {
                index,
                width: image.width,
                height: image.height,
                keypoints: drawn(&features, &keypoints, &camera),
                pixels: image.pixels,
            });
        }
        progress(Progress {
            frame: index + 1,
            frames: count,
            landmarks: report.landmarks,
        });
        frames.push(FrameRecord {
            index,
            time_s: sequence.times_s[index],
            keypoints: features.keypoints.len(),
            report,
            times: StageTimes {
                decode_ms,
                features_ms,
                total_ms: decode_ms + features_ms + stages.total_ms,
                ..stages
            },
        });
    }
    let found_again = frames
        .iter()
        .any(|f: &FrameRecord| f.report.tracking == Tracking::Relocalised);
    let (path, smoother) = smoothed(&recording, rig, config, slam.smoothed_path(), found_again);
    let mut warnings = sequence.warnings.clone();
    warnings.extend(warnings::of_reference(sequence));
    let samples: Vec<OdometrySample> = sequence.odometry.iter().map(|&row| row.into()).collect();
    warnings.extend(warnings::of_run(
        &rig,
        &samples,
        pairs.pairs(),
        &frames,
        &path,
    ));
    let smoothed = sequence.times_s.iter().copied().zip(path).collect();
    Ok(RunRecord {
        sequence: sequence.name.clone(),
        warnings,
        scale: if measured {
            RunScale::Metric
        } else {
            RunScale::Arbitrary
        },
        predicted: without_odometry::rows(&predictions, &sequence.times_s),
        frames,
        smoothed,
        smoother: Some(smoother),
        tracks: track_rows(&recording),
        landmarks: slam.landmarks(),
        dead_reckoning,
        reference: sequence.reference.clone(),
        snapshots,
        configuration: configuration::to_toml(config),
        seed: config.filter.seed,
        particles: config.filter.particles as usize,
        method: config.filter.method.name().to_owned(),
        wall_s: clock() - started,
    })
}

/// A step of the filter with its times; the total is that of the step alone.
fn timed_step(
    slam: &mut Slam,
    input: &FrameInput<'_>,
    clock: &Clock<'_>,
) -> Result<(FrameReport, StageTimes), SlamError> {
    let mut lap = Lap::start(clock);
    let mut stages = StageClock::start(clock);
    let report = slam.step(input, &mut stages)?;
    let times = StageTimes {
        total_ms: lap.lap_ms(),
        ..stages.stop()
    };
    Ok((report, times))
}

fn drawn(features: &Features, reports: &[KeypointReport], camera: &Camera) -> Vec<DrawnKeypoint> {
    features
        .keypoints
        .iter()
        .zip(reports)
        .map(|(k, report)| DrawnKeypoint {
            x: k.x,
            y: k.y,
            sigma: k.sigma,
            fate: report.fate,
            predicted: report.predicted.map(|p| {
                let raw = camera.distort_pixel(&p);
                [raw.x as f32, raw.y as f32]
            }),
        })
        .collect()
}
