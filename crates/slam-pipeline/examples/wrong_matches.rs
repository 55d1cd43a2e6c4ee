//! Wrong matches: every image of a wall loses a share of its descriptors to other keypoints of the same wall, so that these
//! keypoints look like landmarks that stand elsewhere. `wrong_matches [SHARE] [FIRST SEED] [SEEDS]`, by default 0.3, 1 and 10, prints the
//! error of the run with and without, and the share of the frames whose true position lies within three standard deviations.

#![expect(clippy::print_stdout, reason = "an example for a terminal")]

use std::error::Error;

use mono_geometry::{Camera, Distortion};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use slam_pipeline::config::Config;
use slam_pipeline::{FrameInput, OdometryInterval, Rig, Slam, detector_of};
use vision_sift::{Features, GrayImage, Workspace};
use wall_scenes::{Scene, SceneSpec};

/// Chi-square of two degrees of freedom that is three standard deviations.
const THREE_SIGMA: f64 = 11.83;

/// The features of all images of a scene.
fn features_of(scene: &Scene) -> Result<Vec<Features>, Box<dyn Error>> {
    let detector = detector_of(&Config::default().check()?)?;
    let (mut workspace, skins) = (Workspace::new(), scene.skins());
    (0..scene.images())
        .map(|frame| {
            let image = scene.render(&skins, frame);
            let view = GrayImage::new(image.width, image.height, &image.pixels)?;
            let mut features = Features::default();
            detector.detect(&view, &mut workspace, &mut features)?;
            Ok(features)
        })
        .collect()
}

/// Gives a share of the keypoints of every image the descriptor of some keypoint of some image.
fn mix(frames: &[Features], share: f64, seed: u64) -> Vec<Features> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut mixed = frames.to_vec();
    for frame in &mut mixed {
        for descriptor in &mut frame.descriptors {
            if rng.random::<f64>() >= share {
                continue;
            }
            let other = &frames[rng.random_range(0..frames.len())].descriptors;
            if !other.is_empty() {
                *descriptor = other[rng.random_range(0..other.len())];
            }
        }
    }
    mixed
}

/// Root of the mean squared position error, metres; share of the frames within three standard deviations; mean number of matches and
/// of rejected ones.
fn run(scene: &Scene, frames: &[Features], seed: u64) -> Result<[f64; 4], Box<dyn Error>> {
    let rig = Rig {
        camera: Camera::new(Scene::pinhole(), Distortion::None)?,
        mount: Scene::mount(),
    };
    let mut config = Config::default();
    config.filter.seed = seed;
    let mut slam = Slam::new(rig, &config.check()?)?;
    let mut sums = [0.0; 4];
    for (index, (features, truth)) in frames.iter().zip(&scene.path().poses).enumerate() {
        let odometry: Vec<OdometryInterval> = scene
            .odometry_before(index)
            .iter()
            .map(|(duration_s, row)| OdometryInterval {
                duration_s: *duration_s,
                v_mps: row.v_mps,
                omega_radps: row.omega_radps,
            })
            .collect();
        let input = FrameInput {
            features,
            odometry: &odometry,
        };
        let report = slam.step(&input, &mut |_| {})?;
        let (pose, c) = (report.estimate.pose, report.estimate.covariance);
        let (dx, dy) = (pose.x - truth.x, pose.y - truth.y);
        let determinant = c[(0, 0)] * c[(1, 1)] - c[(0, 1)] * c[(0, 1)];
        let squared = c[(1, 1)] * dx * dx - 2.0 * c[(0, 1)] * dx * dy + c[(0, 0)] * dy * dy;
        sums[0] += dx * dx + dy * dy;
        // The first frame is the origin by definition.
        sums[1] += f64::from(determinant <= 0.0 || squared < THREE_SIGMA * determinant);
        sums[2] += report.matches as f64;
        sums[3] += report.outliers as f64;
    }
    let count = frames.len() as f64;
    Ok([
        (sums[0] / count).sqrt(),
        sums[1] / count,
        sums[2] / count,
        sums[3] / count,
    ])
}

fn main() -> Result<(), Box<dyn Error>> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let share: f64 = given.first().map_or(Ok(0.3), |text| text.parse())?;
    let first: u64 = given.get(1).map_or(Ok(1), |text| text.parse())?;
    let seeds: u64 = given.get(2).map_or(Ok(10), |text| text.parse())?;
    println!(
        "| seed | mm without | mm with | within 3 sigma without, % | with, % | matches without | with | rejected without | with |"
    );
    println!("|--:|--:|--:|--:|--:|--:|--:|--:|--:|");
    let mut means = [[0.0; 4]; 2];
    let print = |name: &str, [plain, wrong]: [[f64; 4]; 2]| {
        println!(
            "| {name} | {:.1} | {:.1} | {:.1} | {:.1} | {:.0} | {:.0} | {:.1} | {:.1} |",
            1e3 * plain[0],
            1e3 * wrong[0],
            1e2 * plain[1],
            1e2 * wrong[1],
            plain[2],
            wrong[2],
            plain[3],
            wrong[3]
        );
    };
    for seed in first..first + seeds {
        let scene = Scene::new(SceneSpec::wall(seed))?;
        let frames = features_of(&scene)?;
        let both = [
            run(&scene, &frames, seed)?,
            run(&scene, &mix(&frames, share, seed), seed)?,
        ];
        print(&seed.to_string(), both);
        for (mean, row) in means.iter_mut().zip(both) {
            for (sum, value) in mean.iter_mut().zip(row) {
                *sum += value / seeds as f64;
            }
        }
    }
    print("mean", means);
    Ok(())
}
