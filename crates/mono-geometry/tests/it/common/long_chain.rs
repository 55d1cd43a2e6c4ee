//! A robot that drives once around a circle of landmarks, for bundles of thousands of poses.

use mono_geometry::bundle::{OdometryFactor, PixelObservation, PlanarProblem};
use mono_geometry::{Mount, NoiseShape, Pinhole, Se2};
use nalgebra::{Matrix3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

/// Landmarks that each pose is the first to see, and the poses that see each.
const LANDMARKS: usize = 3;
const SEEN_BY: usize = 8;
/// Metres between two poses, and the noise of the odometry on the way.
const STEP_M: f64 = 0.1;
const SIGMA_M: f64 = 0.002;
const SIGMA_RAD: f64 = 2e-4;

/// `count` poses, the first of them fixed, that start where the odometry puts them; and the true poses. Pixels are exact.
pub(crate) fn circle(count: usize, seed: u64) -> (PlanarProblem, Vec<Se2>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let turn = std::f64::consts::TAU / count as f64;
    let step = Se2::exp(&Vector3::new(STEP_M, 0.0, turn));
    let pinhole = Pinhole {
        width: 640,
        height: 480,
        fx: 400.0,
        fy: 400.0,
        cx: 319.5,
        cy: 239.5,
    };
    let mount = Mount::forward();
    let mut problem = PlanarProblem::new(pinhole, mount.body_from_camera);
    problem.fixed_poses = vec![0];
    let mut truth = vec![Se2::identity()];
    problem.poses = truth.clone();
    for k in 1..count {
        truth.push(truth[k - 1].compose(&step));
        let mut noise = |sigma: f64| -> f64 {
            let value: f64 = StandardNormal.sample(&mut rng);
            sigma * value
        };
        let error = Vector3::new(noise(SIGMA_M), noise(SIGMA_M), noise(SIGMA_RAD));
        let motion = step.compose(&Se2::exp(&error));
        problem.poses.push(problem.poses[k - 1].compose(&motion));
        problem.odometry.push(OdometryFactor {
            from: k - 1,
            to: k,
            motion,
            covariance: Matrix3::from_diagonal(&Vector3::new(
                SIGMA_M * SIGMA_M,
                SIGMA_M * SIGMA_M,
                SIGMA_RAD * SIGMA_RAD,
            )),
        });
    }
    let camera_of = |pose: &Se2| mount.world_from_camera(pose, 0.0, 0.0, 0.0).inverse();
    for k in 0..count {
        for _ in 0..LANDMARKS {
            let in_body = Vector3::new(
                rng.random_range(3.0..6.0),
                rng.random_range(-1.5..1.5),
                rng.random_range(-1.0..1.0),
            );
            let placed = |pose: &Se2| {
                let there = pose.act(&in_body.xy());
                Vector3::new(there.x, there.y, in_body.z)
            };
            let landmark = problem.landmarks.len();
            let point = placed(&truth[k]);
            problem.landmarks.push(placed(&problem.poses[k]));
            for j in 0..SEEN_BY {
                let pose = (k + j) % count;
                let in_camera = camera_of(&truth[pose]).transform_point(&point);
                if let Some(pixel_ideal) = pinhole.project(&in_camera) {
                    problem.observations.push(PixelObservation {
                        pose,
                        landmark,
                        pixel_ideal,
                        sigma_px: 0.5,
                        shape: NoiseShape::ROUND,
                    });
                }
            }
        }
    }
    (problem, truth)
}
