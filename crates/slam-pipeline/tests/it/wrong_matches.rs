//! Keypoints that look like landmarks which stand elsewhere.

use nalgebra::Vector2;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use slam_pipeline::{FrameInput, KeypointFate, Slam};

use crate::drive::{Drive, FRAMES, config, rig};
use crate::rendered::error;

/// Share of the keypoints of every frame that get the descriptor of another.
const SHARE: f64 = 0.3;

struct Outcome {
    rmse_m: f64,
    within: f64,
    matches: usize,
    /// Accepted matches of keypoints whose descriptor is that of another.
    wrong: usize,
}

/// The drive with `share` of its descriptors in wrong places.
fn run(drive: &Drive, share: f64, seed: u64) -> Outcome {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut slam = Slam::new(rig(), &config(30, seed)).unwrap();
    let mut path = Vec::new();
    let (mut within, mut matches, mut wrong) = (0, 0, 0);
    for frame in 0..FRAMES {
        let mut features = drive.features[frame].clone();
        let mut replaced = vec![false; features.descriptors.len()];
        for (descriptor, replaced) in features.descriptors.iter_mut().zip(&mut replaced) {
            if rng.random::<f64>() < share {
                let other = &drive.features[rng.random_range(0..FRAMES)].descriptors;
                let other = other[rng.random_range(0..other.len())];
                *replaced = other != *descriptor;
                *descriptor = other;
            }
        }
        let input = FrameInput {
            features: &features,
            odometry: drive.input(frame).odometry,
        };
        let report = slam.step(&input, &mut |_| {}).unwrap();
        let (_, sigmas) = error(&report, &drive.truth[frame]);
        within += usize::from(frame == 0 || sigmas * sigmas < 11.83);
        matches += report.matches;
        wrong += report
            .keypoints
            .iter()
            .zip(&replaced)
            .filter(|(k, replaced)| **replaced && k.fate == KeypointFate::Matched)
            .count();
        let pose = report.estimate.pose;
        path.push(Vector2::new(pose.x, pose.y));
    }
    Outcome {
        rmse_m: drive.rmse(&path),
        within: within as f64 / FRAMES as f64,
        matches,
        wrong,
    }
}

#[test]
fn a_third_of_wrong_looks_moves_the_path_by_millimetres() {
    for seed in [3, 4] {
        let drive = Drive::new(seed);
        let (plain, mixed) = (run(&drive, 0.0, seed), run(&drive, SHARE, seed));
        assert_eq!(plain.wrong, 0);
        // A landmark is matched when it was right in this frame and in the one before.
        assert!(
            mixed.matches as f64 > 0.4 * plain.matches as f64,
            "{} of {}",
            mixed.matches,
            plain.matches
        );
        let wrong = mixed.wrong as f64 / mixed.matches as f64;
        assert!(
            wrong < 0.05,
            "{seed}: {} of {} matches are wrong",
            mixed.wrong,
            mixed.matches
        );
        assert!(
            mixed.rmse_m < 1.5 * plain.rmse_m + 0.01,
            "{seed}: {} m, {} m without",
            mixed.rmse_m,
            plain.rmse_m
        );
        assert!(mixed.within > 0.94, "{seed}: {}", mixed.within);
    }
}
