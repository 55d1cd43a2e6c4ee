//! One estimator on one recording.

use crate::estimator::Estimator;
use crate::measures::{landmark_errors, nees, path_errors};
use crate::recording::Recording;
use anyhow::Context;
use estimation_base::Se2;
use mono_geometry::{Camera, Distortion};
use nalgebra::Matrix3;
use serde::Serialize;
use slam_pipeline::{FrameInput, MapLandmark, Odometer, Rig, Slam};
use std::time::Instant;
use trajectory_eval::Statistics;
use wall_scenes::Scene;

/// One line of `results.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Row {
    /// Seed of scene and filter.
    pub(crate) seed: u64,
    /// [`Estimator::label`].
    pub(crate) estimator: String,
    /// Number of particles; 0 for dead reckoning.
    pub(crate) particles: u32,
    /// Root mean square position error without alignment, metres.
    pub(crate) position_rmse_m: f64,
    /// Position error of the last frame, metres.
    pub(crate) final_error_m: f64,
    /// Root mean square heading error, radians.
    pub(crate) heading_rmse_rad: f64,
    /// Relative error of the path's scale; positive is too long.
    pub(crate) scale_error: f64,
    /// Root mean square landmark error, metres; none without a map.
    pub(crate) landmark_rmse_m: Option<f64>,
    /// Median landmark error, metres.
    pub(crate) landmark_median_m: Option<f64>,
    /// Landmarks in the final map.
    pub(crate) landmarks: usize,
    /// Root mean square of the position error the filter claims, metres.
    pub(crate) claimed_position_m: f64,
    /// Root mean square of the heading error the filter claims, radians.
    pub(crate) claimed_heading_rad: f64,
    /// Normalised estimation error squared of each frame after the first.
    pub(crate) nees: Vec<f64>,
    /// Filter steps.
    pub(crate) steps: usize,
    /// Mean effective number of particles before resampling, over the filter steps.
    pub(crate) n_eff: Option<f64>,
    /// Steps that resampled.
    pub(crate) resamplings: usize,
    /// Mean matches used in a frame.
    pub(crate) matches: f64,
    /// Mean time of a frame after detection, milliseconds of one thread.
    pub(crate) frame_ms: Option<f64>,
}

impl Row {
    /// Mean NEES over the frames.
    pub(crate) fn mean_nees(&self) -> f64 {
        self.nees.iter().sum::<f64>() / self.nees.len() as f64
    }
}

/// A run with what a figure draws of it.
#[derive(Debug, Clone)]
pub(crate) struct Trial {
    /// Its figures.
    pub(crate) row: Row,
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
}

/// Runs an estimator on a recording, on the current thread.
///
/// # Errors
/// The filter refuses the configuration or a frame.
pub(crate) fn run(estimator: Estimator, recording: &Recording) -> anyhow::Result<Trial> {
    let spec = recording.scene.spec();
    let label = estimator.label();
    let track = match estimator {
        Estimator::DeadReckoning => dead_reckoning(estimator, recording),
        Estimator::Filter { .. } => filter(estimator, recording),
    }
    .with_context(|| format!("seed {}, {label}", spec.seed))?;
    let truth = &recording.scene.path().poses;
    let errors = path_errors(&track.poses, truth).context("a scene without frames")?;
    let of_landmarks = Statistics::of(&landmark_errors(&track.landmarks, recording));
    let claimed = |variance: &dyn Fn(&Matrix3<f64>) -> f64| {
        let sum: f64 = track.covariances.iter().map(variance).sum();
        (sum / track.covariances.len() as f64).sqrt()
    };
    let row = Row {
        seed: spec.seed,
        estimator: label,
        particles: estimator.particles(),
        position_rmse_m: errors.position_rmse_m,
        final_error_m: errors.final_m,
        heading_rmse_rad: errors.heading_rmse_rad,
        scale_error: errors.scale_error,
        landmark_rmse_m: of_landmarks.map(|s| s.rmse),
        landmark_median_m: of_landmarks.map(|s| s.median),
        landmarks: track.landmarks.len(),
        claimed_position_m: claimed(&|c| c[(0, 0)] + c[(1, 1)]),
        claimed_heading_rad: claimed(&|c| c[(2, 2)]),
        nees: nees(&track.poses, &track.covariances, truth),
        steps: track.n_eff.len(),
        n_eff: Statistics::of(&track.n_eff).map(|s| s.mean),
        resamplings: track.resamplings,
        matches: track.matches as f64 / truth.len() as f64,
        frame_ms: track.frame_ms,
    };
    Ok(Trial {
        row,
        poses: track.poses,
        landmarks: track.landmarks,
    })
}

fn filter(estimator: Estimator, recording: &Recording) -> anyhow::Result<Track> {
    let spec = recording.scene.spec();
    let config = estimator.config(spec.seed, &spec.odometry).check()?;
    let camera = Camera::new(Scene::pinhole(), Distortion::None)?;
    let mount = Scene::mount();
    let mut slam = Slam::new(Rig { camera, mount }, &config)?;
    let start = Instant::now();
    let clock = || start.elapsed().as_secs_f64();
    let mut track = Track::default();
    for (frame, features) in recording.features.iter().enumerate() {
        let input = FrameInput {
            features,
            odometry: &recording.odometry[frame],
        };
        let report = slam.step(&input, &mut |_| {})?;
        let pose = report.estimate.pose;
        track.poses.push(Se2::new(pose.x, pose.y, pose.phi));
        track.covariances.push(report.estimate.covariance);
        track.matches += report.matches;
        if frame > 0 && report.keyframe {
            track.n_eff.push(report.n_eff);
            track.resamplings += usize::from(report.resampled);
        }
    }
    track.frame_ms = Some(clock() * 1e3 / recording.features.len() as f64);
    track.landmarks = slam.landmarks();
    Ok(track)
}

/// Odometry alone, with the covariance its noise implies, the constant scale error included.
fn dead_reckoning(estimator: Estimator, recording: &Recording) -> anyhow::Result<Track> {
    let spec = recording.scene.spec();
    let config = estimator.config(spec.seed, &spec.odometry).check()?;
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
    use slam_pipeline::config::Method;
    use wall_scenes::OdometryNoise;
    use wall_scenes::SceneSpec;

    #[test]
    fn perfect_odometry_reckons_the_truth_and_a_filter_keeps_it() {
        let recording = Recording::new(SceneSpec {
            frames: 5,
            odometry: OdometryNoise::NONE,
            ..SceneSpec::wall(2)
        })
        .unwrap();
        let reckoned = run(Estimator::DeadReckoning, &recording).unwrap().row;
        assert!(reckoned.position_rmse_m < 1e-9 && reckoned.scale_error.abs() < 1e-9);
        assert_eq!((reckoned.landmarks, reckoned.landmark_rmse_m), (0, None));

        let conventional = Estimator::Filter {
            method: Method::Conventional,
            particles: 5,
        };
        // Without odometry noise the particles of this filter spread by the floor of the motion
        // model only, a tenth of a millimetre a step, so its landmarks show the accuracy of
        // triangulation: 0.6 px over a baseline of 0.1 m or more at 2 m is 65 mm in depth or less.
        let row = run(conventional, &recording).unwrap().row;
        assert!(row.position_rmse_m < 5e-4, "{row:?}");
        assert!(row.landmarks > 20, "{row:?}");
        assert!(row.landmark_median_m.unwrap() < 0.065, "{row:?}");
        assert_eq!(row.nees.len(), 4);
    }
}
