//! A simulated drive along a wall, without images: features are points of the wall with persistent random descriptors,
//! pixel noise and wrong matches.

use mono_geometry::motion::exact_arc;
use mono_geometry::{Camera, Distortion, Mount, Pinhole, Se2};
use nalgebra::{Matrix3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use slam_pipeline::config::{Config, ValidConfig};
use slam_pipeline::{FrameInput, OdometryInterval, Rig};
use vision_sift::{Features, Keypoint};

pub(crate) const FRAMES: usize = 38;
pub(crate) const STEP_M: f64 = 0.10;
pub(crate) const WALL_M: f64 = 2.0;
pub(crate) const SIGMA_PX: f64 = 0.5;
pub(crate) const SIGMA_V: f64 = 0.05;
pub(crate) const SIGMA_TURN: f64 = 0.012;
pub(crate) const WRONG: f64 = 0.03;
pub(crate) const POINTS_PER_M2: f64 = 35.0;

fn pinhole() -> Pinhole {
    Pinhole {
        width: 320,
        height: 240,
        fx: 368.826_20,
        fy: 369.902_39,
        cx: 159.670_29,
        cy: 121.541_36,
    }
}

/// A camera at the body's origin that looks to the left of the body.
pub(crate) fn rig() -> Rig {
    let sideways = Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0);
    Rig {
        camera: Camera::new(pinhole(), Distortion::None).unwrap(),
        mount: Mount::new(&sideways, &Vector3::zeros()).unwrap(),
    }
}

/// One drive along the wall: the truth, the odometry and the features of each frame.
pub(crate) struct Drive {
    pub(crate) truth: Vec<Se2>,
    pub(crate) odometry: Vec<OdometryInterval>,
    pub(crate) features: Vec<Features>,
}

impl Drive {
    pub(crate) fn new(seed: u64) -> Self {
        Self::made(seed, None)
    }

    /// The drive of `seed` once more, with other noise and other wrong matches.
    pub(crate) fn again(seed: u64, noise: u64) -> Self {
        Self::made(seed, Some(noise))
    }

    fn made(seed: u64, noise: Option<u64>) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let normal = |rng: &mut ChaCha8Rng| rng.sample::<f64, _>(StandardNormal);
        let length = STEP_M * FRAMES as f64;
        let (from, to, half) = (-1.5, length + 1.5, 0.8);
        let count = ((to - from) * 2.0 * half * POINTS_PER_M2) as usize;
        let points: Vec<(Vector3<f64>, [u8; 128])> = (0..count)
            .map(|_| {
                let at = Vector3::new(
                    rng.random_range(from..to),
                    WALL_M + rng.random_range(-0.15..0.15),
                    rng.random_range(-half..half),
                );
                (at, core::array::from_fn(|_| rng.random_range(0..120_u8)))
            })
            .collect();
        if let Some(noise) = noise {
            rng = ChaCha8Rng::seed_from_u64(noise);
        }
        let mut at = Se2::identity();
        let (mut truth, mut odometry, mut features) = (Vec::new(), Vec::new(), Vec::new());
        for frame in 0..FRAMES {
            if frame > 0 {
                let turn = 0.01 * (frame as f64 * 0.5).sin();
                at = at.compose(&exact_arc(STEP_M, turn, 1.0));
                odometry.push(OdometryInterval {
                    duration_s: 1.0,
                    v_mps: STEP_M * (1.0 + SIGMA_V * normal(&mut rng)),
                    omega_radps: turn + SIGMA_TURN * normal(&mut rng),
                });
            }
            truth.push(at);
            let k = pinhole();
            let mut seen = Features::default();
            for (p, descriptor) in &points {
                let body = at.inverse().act(&Vector2::new(p.x, p.y));
                let q = Vector3::new(body.x, -p.z, body.y);
                let mut pixel = Vector2::new(k.fx * q.x / q.z + k.cx, k.fy * q.y / q.z + k.cy);
                let inside =
                    |p: &Vector2<f64>| p.x > 0.0 && p.y > 0.0 && p.x < 319.0 && p.y < 239.0;
                if q.z < 0.1 || !inside(&pixel) {
                    continue;
                }
                pixel += Vector2::new(normal(&mut rng), normal(&mut rng)) * SIGMA_PX;
                if rng.random::<f64>() < WRONG {
                    pixel =
                        Vector2::new(rng.random_range(0.0..319.0), rng.random_range(0.0..239.0));
                }
                seen.keypoints.push(Keypoint {
                    x: pixel.x as f32,
                    y: pixel.y as f32,
                    sigma: 2.0,
                    angle: 0.0,
                    response: 0.05,
                });
                seen.descriptors
                    .push(descriptor.map(|v| v.saturating_add(rng.random_range(0..8))));
            }
            features.push(seen);
        }
        Self {
            truth,
            odometry,
            features,
        }
    }

    /// Positions of the robot as the wheels alone tell them.
    pub(crate) fn dead_reckoning(&self) -> Vec<Vector2<f64>> {
        let mut at = Se2::identity();
        let mut path = vec![Vector2::zeros()];
        for o in &self.odometry {
            at = at.compose(&exact_arc(o.v_mps, o.omega_radps, o.duration_s));
            path.push(Vector2::new(at.x, at.y));
        }
        path
    }

    /// The input of frame `index`.
    pub(crate) fn input(&self, index: usize) -> FrameInput<'_> {
        FrameInput {
            features: &self.features[index],
            odometry: if index == 0 {
                &[]
            } else {
                &self.odometry[index - 1..index]
            },
        }
    }

    pub(crate) fn rmse(&self, path: &[Vector2<f64>]) -> f64 {
        let sum: f64 = path
            .iter()
            .zip(&self.truth)
            .map(|(p, t)| (p - Vector2::new(t.x, t.y)).norm_squared())
            .sum();
        (sum / FRAMES as f64).sqrt()
    }

    /// Length from first to last pose over the true one, less one.
    pub(crate) fn scale_error(&self, path: &[Vector2<f64>]) -> f64 {
        let end = self.truth[FRAMES - 1];
        path[FRAMES - 1].norm() / end.x.hypot(end.y) - 1.0
    }
}

/// The configuration that states the noise of the drive.
pub(crate) fn config(particles: u32, seed: u64) -> ValidConfig {
    let mut config = Config::default();
    config.filter.particles = particles;
    config.filter.seed = seed;
    // One row of a second a frame, a tenth of a metre long.
    config.odometry.forward_per_sqrt_m = SIGMA_V * STEP_M.sqrt();
    config.odometry.forward_per_sqrt_s = 0.0;
    config.odometry.turn_per_sqrt_rad = 0.0;
    config.odometry.turn_per_sqrt_s = SIGMA_TURN;
    config.odometry.sideways_per_sqrt_m = 0.0;
    config.odometry.scale_bias = 0.0;
    config.carrier.tilt_sigma = 0.0;
    config.carrier.slope_sigma = 0.0;
    config.carrier.turn_bias_sigma = 0.0;
    config.carrier.turning_centre_sigma_m = 0.0;
    config.features.sigma_px = SIGMA_PX;
    config.check().unwrap()
}
