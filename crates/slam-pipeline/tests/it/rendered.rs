//! A rendered drive: features of images, odometry and the truth, forwards and on the way back.

use mono_geometry::{Camera, Distortion, Se2};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use slam_pipeline::config::Config;
use slam_pipeline::{FrameReport, OdometryInterval, Rig, detector_of};
use vision_sift::{Features, GrayImage, Workspace};
use wall_scenes::{Scene, SceneSpec};

/// Grey levels by which the images of the way back differ at most from those of the way there.
const FLICKER: i16 = 3;

/// One frame as the system gets it, with the truth.
pub(crate) struct Frame {
    pub(crate) features: Features,
    pub(crate) odometry: Vec<OdometryInterval>,
    pub(crate) truth: Se2,
}

pub(crate) fn rig() -> Rig {
    Rig {
        camera: Camera::new(Scene::pinhole(), Distortion::None).unwrap(),
        mount: Scene::mount(),
    }
}

/// The drive of `spec`, and back again to frame `until`: the wheels turn the other way, the images have noise of their own.
pub(crate) fn there_and_back(spec: SceneSpec, until: usize) -> Vec<Frame> {
    let scene = Scene::new(spec).unwrap();
    let skins = scene.skins();
    let detector = detector_of(&Config::default().check().unwrap()).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(spec.seed);
    let (mut there, mut back) = (Vec::new(), Vec::new());
    for frame in 0..scene.images() {
        let image = scene.render(&skins, frame);
        let truth = scene.path().poses[frame];
        let rows = scene.odometry_before(frame);
        let driven = |sign: f64| {
            rows.iter().map(move |(duration_s, row)| OdometryInterval {
                duration_s: *duration_s,
                v_mps: sign * row.v_mps,
                omega_radps: sign * row.omega_radps,
            })
        };
        let mut seen = |flicker: i16| {
            let pixels: Vec<u8> = image
                .pixels
                .iter()
                .map(|&level| {
                    let noise = rng.random_range(-flicker..=flicker);
                    (i16::from(level) + noise).clamp(0, 255) as u8
                })
                .collect();
            let view = GrayImage::new(image.width, image.height, &pixels).unwrap();
            let mut features = Features::default();
            detector
                .detect(&view, &mut Workspace::new(), &mut features)
                .unwrap();
            features
        };
        there.push(Frame {
            features: seen(0),
            odometry: driven(1.0).collect(),
            truth,
        });
        if frame >= until {
            back.push((seen(FLICKER), driven(-1.0).rev().collect::<Vec<_>>(), truth));
        }
    }
    // The last frame is not seen twice; the wheels that led to a frame lead back to the one before.
    for pair in back.windows(2).rev() {
        let [(features, _, truth), (_, odometry, _)] = pair else {
            unreachable!("pairs")
        };
        there.push(Frame {
            features: features.clone(),
            odometry: odometry.clone(),
            truth: *truth,
        });
    }
    there
}

/// Distance of an estimate from the truth: metres, and standard deviations.
pub(crate) fn error(report: &FrameReport, truth: &Se2) -> (f64, f64) {
    let pose = &report.estimate.pose;
    let d = Vector2::new(pose.x - truth.x, pose.y - truth.y);
    let covariance: Matrix2<f64> = report.estimate.covariance.fixed_view::<2, 2>(0, 0).into();
    let sigmas = covariance
        .cholesky()
        .map_or(0.0, |c| d.dot(&c.solve(&d)).sqrt());
    (d.norm(), sigmas)
}
