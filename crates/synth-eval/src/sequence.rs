//! Recorded sequences beside the rendered ones.

use crate::recording::{Drive, Recording, Surface, detect};
use anyhow::{Context, ensure};
use estimation_base::Se2;
use slam_io::Sequence;
use slam_pipeline::config::Config;
use slam_pipeline::{OdometryInterval, Rig};
use std::path::Path;

/// Largest difference in time between a frame and the reference pose it is compared with, seconds.
const TIME_TOLERANCE_S: f64 = 0.01;

/// Reads a sequence folder and detects the keypoints of its images.
///
/// # Errors
/// The folder is no sequence, holds no reference path, or an image cannot be decoded.
pub(crate) fn read(folder: &Path, config: &Config) -> anyhow::Result<Recording> {
    let sequence = Sequence::open(folder)?;
    let reference = sequence
        .reference
        .as_deref()
        .with_context(|| format!("{} holds no reference path", folder.display()))?;
    let (camera, mount) = sequence.camera.camera_and_mount()?;
    let truth: Vec<Option<Se2>> = sequence
        .times_s
        .iter()
        .map(|&time| at_time(reference, time))
        .collect();
    ensure!(
        truth.iter().flatten().count() > 1,
        "{}: the reference has no poses at the times of the images",
        folder.display()
    );
    let mut odometry = vec![Vec::new()];
    for pair in sequence.times_s.windows(2) {
        let pieces = sequence.odometry_between(pair[0], pair[1]);
        odometry.push(
            pieces
                .into_iter()
                .map(|(duration_s, v_mps, omega_radps)| OdometryInterval {
                    duration_s,
                    v_mps,
                    omega_radps,
                })
                .collect(),
        );
    }
    let (features, detection_ms) = detect(config, sequence.images.len(), |frame| {
        let image = sequence.load_image(frame)?;
        Ok((image.width, image.height, image.pixels))
    })?;
    let drive = Drive {
        name: format!("recorded {}", sequence.name),
        rig: Rig { camera, mount },
        odometry,
        truth,
        noise: None,
        camera: Some(sequence.camera.clone()),
        surface: Surface::Unknown,
    };
    Ok(Recording::new(drive, features, detection_ms))
}

/// The pose nearest in time, within the tolerance.
fn at_time(reference: &[(f64, Se2)], time_s: f64) -> Option<Se2> {
    let after = reference.partition_point(|(t, _)| *t < time_s);
    reference[after.saturating_sub(1)..(after + 1).min(reference.len())]
        .iter()
        .min_by(|a, b| (a.0 - time_s).abs().total_cmp(&(b.0 - time_s).abs()))
        .filter(|(t, _)| (t - time_s).abs() <= TIME_TOLERANCE_S)
        .map(|(_, pose)| *pose)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_takes_the_nearest_pose_and_no_far_one() {
        let reference: Vec<(f64, Se2)> = (0..4)
            .map(|k| (0.1 * f64::from(k), Se2::new(f64::from(k), 0.0, 0.0)))
            .collect();
        let x = |time| at_time(&reference, time).map(|pose| pose.x);
        assert_eq!(x(0.0), Some(0.0));
        assert_eq!(x(0.095), Some(1.0));
        assert_eq!(x(0.1051), Some(1.0));
        assert_eq!(x(0.15), None);
        assert_eq!(x(0.305), Some(3.0));
        assert_eq!(x(-0.005), Some(0.0));
        assert_eq!(x(0.5), None);
        assert_eq!(at_time(&[], 0.0), None);
    }
}
