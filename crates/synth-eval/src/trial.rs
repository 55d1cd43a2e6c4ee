//! One estimator on one recording with one seed.

use crate::estimator::{Estimator, Family};
use crate::limit::{Limit, limit};
use crate::measures::{heading_freed_rmse_m, honesty, landmark_errors, path_errors};
use crate::recording::Recording;
use crate::row::{Row, Times};
use crate::settings::Settings;
use anyhow::Context;
use estimation_base::Se2;
use nalgebra::Matrix3;
use slam_pipeline::config::Config;
use slam_pipeline::{Ablation, FrameInput, MapLandmark, Odometer, Slam};
use std::time::Instant;
use trajectory_eval::Statistics;

/// A run with what a figure draws of it.
#[derive(Debug, Clone)]
pub(crate) struct Trial {
    /// Its figures.
    pub(crate) row: Row,
    /// Its times.
    pub(crate) times: Times,
    /// Estimated poses, one a frame.
    pub(crate) poses: Vec<Se2>,
    /// Final map.
    pub(crate) landmarks: Vec<MapLandmark>,
}

/// The results of an estimator.
#[derive(Debug, Default)]
struct Track {
    poses: Vec<Se2>,
    covariances: Vec<Matrix3<f64>>,
    landmarks: Vec<MapLandmark>,
    n_eff: Vec<f64>,
    resamplings: usize,
    matches: usize,
    frame_ms: Option<f64>,
    batch: Option<Limit>,
}

/// Runs an estimator on a recording, on the current thread.
///
/// # Errors
/// The filter refuses the configuration or a frame.
pub(crate) fn run(
    estimator: Estimator,
    recording: &Recording,
    seed: u64,
    settings: &Settings,
    batch: bool,
) -> anyhow::Result<Trial> {
    let mut config = settings.config(recording);
    estimator.configure(&mut config, seed);
    let track = match estimator.family {
        Family::DeadReckoning => dead_reckoning(&config, recording),
        Family::Filter(_) => filter(&config, recording, None, batch),
        Family::Without(part) => filter(&config, recording, Some(part), batch),
    }
    .with_context(|| format!("{}, seed {seed}, {}", recording.name, estimator.label()))?;
    let row = row(estimator, recording, seed, settings, &track)?;
    Ok(Trial {
        times: Times {
            scene: row.scene.clone(),
            settings: row.settings.clone(),
            seed,
            method: row.method.clone(),
            detection_ms: recording.detection_ms,
            frame_ms: track.frame_ms,
        },
        row,
        poses: track.poses,
        landmarks: track.landmarks,
    })
}

fn row(
    estimator: Estimator,
    recording: &Recording,
    seed: u64,
    settings: &Settings,
    track: &Track,
) -> anyhow::Result<Row> {
    // Frames without a reference pose are not judged.
    let (mut poses, mut covariances, mut truth) = (Vec::new(), Vec::new(), Vec::new());
    for ((pose, covariance), known) in track
        .poses
        .iter()
        .zip(&track.covariances)
        .zip(&recording.truth)
    {
        if let Some(known) = known {
            poses.push(*pose);
            covariances.push(*covariance);
            truth.push(*known);
        }
    }
    let errors = path_errors(&poses, &truth).context("a sequence without frames")?;
    let of_landmarks = Statistics::of(&landmark_errors(&track.landmarks, recording));
    let claimed = |variance: &dyn Fn(&Matrix3<f64>) -> f64| {
        let sum: f64 = covariances.iter().map(variance).sum();
        (sum / covariances.len() as f64).sqrt()
    };
    let honesty = honesty(&poses, &covariances, &truth);
    let frames = recording.features.len();
    Ok(Row {
        scene: recording.name.clone(),
        settings: settings.label(recording).to_owned(),
        seed,
        method: estimator.label(),
        particles: estimator.particles,
        frames,
        keyframes: track.n_eff.len(),
        position_rmse_m: errors.position_rmse_m,
        position_rmse_heading_freed_m: heading_freed_rmse_m(&poses, &truth),
        final_error_m: errors.final_m,
        heading_rmse_rad: errors.heading_rmse_rad,
        scale_error: Some(errors.scale_error).filter(|error| error.is_finite()),
        landmark_rmse_m: of_landmarks.map(|s| s.rmse),
        landmark_median_m: of_landmarks.map(|s| s.median),
        landmarks: track.landmarks.len(),
        claimed_position_m: claimed(&|c| c[(0, 0)] + c[(1, 1)]),
        claimed_heading_rad: claimed(&|c| c[(2, 2)]),
        nees: honesty.nees,
        nees_inside: honesty.inside,
        three_sigma: honesty.three_sigma,
        n_eff: Statistics::of(&track.n_eff).map(|s| s.mean),
        resamplings: track.resamplings,
        matches: track.matches as f64 / frames as f64,
        batch: track.batch,
    })
}

fn filter(
    config: &Config,
    recording: &Recording,
    without: Option<Ablation>,
    batch: bool,
) -> anyhow::Result<Track> {
    let config = match &recording.camera {
        Some(camera) => camera.considered_in(config),
        None => config.clone(),
    }
    .check()?;
    let mut slam = match without {
        None => Slam::new(recording.rig, &config)?,
        Some(part) => Slam::ablated(recording.rig, &config, part)?,
    };
    let start = Instant::now();
    let mut track = Track::default();
    let mut sightings = slam_batch::Recording::default();
    for (frame, features) in recording.features.iter().enumerate() {
        let input = FrameInput {
            features,
            odometry: &recording.odometry[frame],
        };
        let report = slam.step(&input, &mut |_| {})?;
        if batch {
            sightings.push(features, &report, input.odometry);
        }
        let pose = report.estimate.pose;
        track.poses.push(Se2::new(pose.x, pose.y, pose.phi));
        track.covariances.push(report.estimate.covariance);
        track.matches += report.matches;
        if frame > 0 && report.keyframe {
            track.n_eff.push(report.n_eff);
            track.resamplings += usize::from(report.resampled);
        }
    }
    track.frame_ms = Some(start.elapsed().as_secs_f64() * 1e3 / recording.features.len() as f64);
    track.landmarks = slam.landmarks();
    if batch {
        track.batch = limit(&sightings, &config, &slam.smoothed_path(), recording);
    }
    Ok(track)
}

/// Odometry alone, with the covariance its noise implies, the constant scale error included.
fn dead_reckoning(config: &Config, recording: &Recording) -> anyhow::Result<Track> {
    let config = config.clone().check()?;
    let mut odometer = Odometer::new(&config.odometry);
    let mut track = Track::default();
    for intervals in &recording.odometry {
        for interval in intervals {
            odometer.push(interval)?;
        }
        let control = odometer.control();
        let reckoned = control.increment;
        let along =
            nalgebra::Vector3::new(reckoned.x, reckoned.y, 0.0) * config.odometry.scale_bias;
        track
            .poses
            .push(Se2::new(reckoned.x, reckoned.y, reckoned.phi));
        track
            .covariances
            .push(control.covariance + along * along.transpose());
    }
    Ok(track)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::DEAD_RECKONING;
    use slam_pipeline::config::Method;
    use wall_scenes::OdometryNoise;
    use wall_scenes::SceneSpec;

    #[test]
    fn perfect_odometry_reckons_the_truth_and_a_filter_keeps_it() {
        let spec = SceneSpec {
            frames: 5,
            odometry: OdometryNoise::NONE,
            ..SceneSpec::wall(2)
        };
        let recording = Recording::rendered("wall", spec, &Config::default()).unwrap();
        let run = |estimator| run(estimator, &recording, 2, &Settings::ExactNoise, false).unwrap();
        let reckoned = run(DEAD_RECKONING).row;
        assert!(reckoned.position_rmse_m < 1e-9 && reckoned.scale_error.unwrap().abs() < 1e-9);
        assert_eq!((reckoned.landmarks, reckoned.landmark_rmse_m), (0, None));

        let conventional = Estimator {
            family: Family::Filter(Method::Conventional),
            particles: 5,
        };
        // Without odometry noise the particles of this filter spread by the floor of the motion
        // model only, a tenth of a millimetre a step, so its landmarks show the accuracy of
        // triangulation: 0.6 px over a baseline of 0.1 m or more at 2 m is 65 mm in depth or less.
        let row = run(conventional).row;
        assert!(row.position_rmse_m < 5e-4, "{row:?}");
        assert!(row.landmarks > 20, "{row:?}");
        assert!(row.landmark_median_m.unwrap() < 0.065, "{row:?}");
        assert_eq!((row.frames, row.keyframes), (5, 4));
    }
}
