//! A whole sequence through the frame loop.

use mono_geometry::Camera;
use mono_geometry::motion::{OdometrySample, exact_arc};
use motion_consistency::check_motion;
use rayon::ThreadPool;
use slam_io::{
    DrawnKeypoint, FrameRecord, OdometrySource, RunRecord, RunScale, Sequence, StageTimes,
    configuration,
};
use slam_pipeline::config::ValidConfig;
use slam_pipeline::{
    FrameInput, FrameReport, KeypointReport, KnownMap, MapUse, Rig, Slam, SlamError, Tracking,
    detector_of,
};
use vision_sift::Features;

use crate::detection::{Detected, FrameDetector};
pub use crate::run_error::RunError;
use crate::run_state::Collected;
use crate::smooth::{not_smoothed, odometry_before, smoothed, track_rows};
use crate::stopwatch::{Clock, Lap, StageClock};
use crate::warnings;
use crate::without_odometry::{self, expected};

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
    let mut run = Run::begin(sequence, config, clock)?;
    while let Some(after) = run.step()? {
        progress(after);
    }
    Ok(run.finish())
}

/// A run of a sequence, frame by frame: it may be stored after any frame, and ended after any.
///
/// After an error of [`Self::step`] the run is what it was before that frame: its results so far are there.
pub struct Run<'a> {
    sequence: &'a Sequence,
    config: ValidConfig,
    clock: &'a Clock<'a>,
    pool: ThreadPool,
    rig: Rig,
    slam: Slam,
    detector: FrameDetector<'a>,
    /// The next frame, when it was looked at already.
    ahead: Option<Result<Detected, RunError>>,
    collected: Collected,
    /// Reading of the clock when this process began, less the time that earlier ones took.
    started_s: f64,
}

impl std::fmt::Debug for Run<'_> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("Run")
            .field("sequence", &self.sequence.name)
            .field("frames", &self.frames())
            .finish_non_exhaustive()
    }
}

impl<'a> Run<'a> {
    /// A run at its first frame; settings and clock as for [`run_sequence`].
    ///
    /// # Errors
    /// [`RunError`] for a camera, a configuration or a number of threads that cannot be.
    pub fn begin(
        sequence: &'a Sequence,
        config: &ValidConfig,
        clock: &'a Clock<'a>,
    ) -> Result<Self, RunError> {
        let config = sequence.camera.considered_in(config).check()?;
        let rig = rig_of(sequence)?;
        let slam = Slam::new(rig, &config)?;
        let collected = Collected::new(sequence.images.len());
        Self::with(sequence, config, clock, rig, slam, collected)
    }

    /// A run at its first frame that begins in a map: its world is that of the map, and where the robot is in it, the
    /// images must tell.
    ///
    /// # Errors
    /// As [`Self::begin`], and [`RunError::Slam`] for a map that contradicts itself.
    pub fn begin_in(
        sequence: &'a Sequence,
        config: &ValidConfig,
        clock: &'a Clock<'a>,
        map: &KnownMap,
        usage: MapUse,
    ) -> Result<Self, RunError> {
        let config = sequence.camera.considered_in(config).check()?;
        let rig = rig_of(sequence)?;
        let slam = Slam::with_map(rig, &config, map, usage)?;
        let collected = Collected {
            in_map: true,
            ..Collected::new(sequence.images.len())
        };
        Self::with(sequence, config, clock, rig, slam, collected)
    }

    /// The run that [`Self::state`] stored, of the same sequence under the same configuration: it ends in the same results,
    /// wall times aside.
    ///
    /// # Errors
    /// [`RunError::State`] for bytes that are no state of such a run; as [`Self::begin`].
    pub fn resume(
        sequence: &'a Sequence,
        config: &ValidConfig,
        clock: &'a Clock<'a>,
        state: &[u8],
    ) -> Result<Self, RunError> {
        let config = sequence.camera.considered_in(config).check()?;
        let rig = rig_of(sequence)?;
        let (collected, slam) = Collected::from_bytes(state)?;
        let slam = Slam::restore_state(rig, &config, slam)?;
        collected.check(&slam, sequence)?;
        Self::with(sequence, config, clock, rig, slam, collected)
    }

    fn with(
        sequence: &'a Sequence,
        config: ValidConfig,
        clock: &'a Clock<'a>,
        rig: Rig,
        slam: Slam,
        collected: Collected,
    ) -> Result<Self, RunError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(config.filter.threads as usize)
            .build()?;
        Ok(Self {
            sequence,
            clock,
            pool,
            rig,
            slam,
            detector: FrameDetector::new(sequence, detector_of(&config)?, clock),
            ahead: None,
            started_s: clock() - collected.wall_s,
            collected,
            config,
        })
    }

    /// Number of frames done.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.collected.frames.len()
    }

    /// The next frame; `None` when all are done.
    ///
    /// # Errors
    /// [`RunError`] when its image cannot be read or the filter refuses it.
    pub fn step(&mut self) -> Result<Option<Progress>, RunError> {
        let index = self.frames();
        let count = self.sequence.images.len();
        if index >= count {
            return Ok(None);
        }
        let landmarks = {
            let Self {
                sequence,
                clock,
                pool,
                rig,
                slam,
                detector,
                ahead,
                collected,
                ..
            } = self;
            let detected = match ahead.take() {
                Some(detected) => detected,
                None => pool.install(|| detector.detect(index)),
            };
            let Detected {
                snapshot,
                features,
                decode_ms,
                features_ms,
            } = detected?;
            let measured = is_measured(sequence);
            let odometry = if measured {
                odometry_before(sequence, index)
            } else {
                expected(&slam.smoothed_path(), &sequence.times_s)
                    .into_iter()
                    .collect()
            };
            let input = FrameInput {
                features: &features,
                odometry: &odometry,
            };
            let pairs = &mut collected.pairs;
            let (stepped, next) = pool.install(|| {
                rayon::join(
                    || timed_step(slam, &input, *clock),
                    || {
                        pairs.observe(index, sequence.times_s[index], &features, &rig.camera);
                        (index + 1 < count).then(|| detector.detect(index + 1))
                    },
                )
            });
            *ahead = next;
            let (mut report, stages) = stepped?;
            if measured {
                for o in &odometry {
                    let step = exact_arc(o.v_mps, o.omega_radps, o.duration_s);
                    collected.wheels = collected.wheels.compose(&step);
                }
                collected.dead_reckoning.push(collected.wheels);
            } else {
                collected.predictions.extend(&odometry);
            }
            collected.repeated.observe(index, &features);
            collected.recording.push(&features, &report, &odometry);
            let keypoints = std::mem::take(&mut report.keypoints);
            if let Some(snapshot) = snapshot {
                let drawn = drawn(&features, &keypoints, &rig.camera);
                collected.snapshots.push(snapshot.with_keypoints(&drawn));
            }
            let landmarks = report.landmarks;
            collected.frames.push(FrameRecord {
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
            landmarks
        };
        Ok(Some(Progress {
            frame: index + 1,
            frames: count,
            landmarks,
        }))
    }

    /// Everything that [`Self::resume`] needs to go on after the frames done.
    ///
    /// # Errors
    /// [`RunError::Slam`] for the method `paper`, whose state is not stored.
    pub fn state(&mut self) -> Result<Vec<u8>, RunError> {
        self.collected.wall_s = (self.clock)() - self.started_s;
        self.collected.to_bytes(&self.slam.save_state()?)
    }

    /// Everything that the frames so far have found.
    #[must_use]
    pub fn finish(self) -> RunRecord {
        let Self {
            sequence,
            config,
            clock,
            pool,
            rig,
            slam,
            collected,
            started_s,
            ..
        } = self;
        pool.install(|| {
            let best = slam.smoothed_path();
            let found_again = collected
                .frames
                .iter()
                .any(|f| f.report.tracking == Tracking::Relocalised);
            let samples: Vec<OdometrySample> =
                sequence.odometry.iter().map(|&row| row.into()).collect();
            let ((path, smoother), findings) = rayon::join(
                || match collected.frames.last() {
                    Some(last) if !collected.in_map => {
                        let last = &last.report.estimate;
                        smoothed(&collected.recording, rig, &config, best, last, found_again)
                    }
                    _ => (best, not_smoothed()),
                },
                || {
                    let pairs = collected.pairs.pairs();
                    check_motion(pairs, &samples, rig.camera.pinhole(), &rig.mount)
                },
            );
            let mut warnings = sequence.warnings.clone();
            warnings.extend(warnings::of_reference(sequence));
            warnings.extend(collected.repeated.warning(&samples, &collected.frames));
            warnings.extend(warnings::of_run(
                &samples,
                findings,
                &collected.frames,
                &path,
            ));
            RunRecord {
                sequence: sequence.name.clone(),
                warnings,
                scale: if is_measured(sequence) {
                    RunScale::Metric
                } else {
                    RunScale::Arbitrary
                },
                predicted: without_odometry::rows(&collected.predictions, &sequence.times_s),
                smoothed: sequence.times_s.iter().copied().zip(path).collect(),
                smoother: Some(smoother),
                tracks: track_rows(&collected.recording),
                frames: collected.frames,
                landmarks: slam.landmarks(),
                known_map: Some(slam.known_map()),
                dead_reckoning: collected.dead_reckoning,
                reference: sequence.reference.clone(),
                snapshots: collected.snapshots,
                configuration: configuration::to_toml(&config),
                seed: config.filter.seed,
                particles: config.filter.particles as usize,
                method: config.filter.method.name().to_owned(),
                wall_s: clock() - started_s,
            }
        })
    }
}

fn rig_of(sequence: &Sequence) -> Result<Rig, RunError> {
    let (camera, mount) = sequence.camera.camera_and_mount()?;
    Ok(Rig { camera, mount })
}

/// Whether something measured the motion.
fn is_measured(sequence: &Sequence) -> bool {
    sequence.odometry_source != OdometrySource::None
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
