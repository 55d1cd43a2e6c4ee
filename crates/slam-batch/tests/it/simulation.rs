//! A simulated drive through a cloud of points, with exactly the noise that the model states.

use mono_geometry::{Camera, Distortion, Mount, Pinhole, RobustLoss, Se2, world_from_tilted_body};
use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use slam_batch::{Constant, Constants, Keyframe, Model, Problem, Sighting, Track};
use slam_pipeline::config::Config;
use slam_pipeline::keypoint_sigma_px;
use slam_pipeline::{OdometryInterval, Rig};

/// Rows of odometry between two keyframes.
const ROWS: usize = 4;
const DT_S: f64 = 0.1;

/// The settings of a drive.
#[derive(Debug, Clone)]
pub(crate) struct Settings {
    pub(crate) keyframes: usize,
    pub(crate) points: usize,
    /// True constants, deviations from the rig that the problem is given.
    pub(crate) truth: Constants,
    pub(crate) model: Model,
    pub(crate) lens: Distortion,
}

pub(crate) fn settings() -> Settings {
    let config = Config::default().check().unwrap();
    let mut model = Model::of(&config);
    model.sigma_px = 0.4;
    model.loss = RobustLoss::None;
    model.scale_drift = 0.0;
    model.scale_bias = 0.0;
    model.odometry.forward_per_sqrt_m = 0.012;
    model.odometry.forward_per_sqrt_s = 0.0006;
    model.odometry.turn_per_sqrt_rad = 0.005;
    model.odometry.turn_per_sqrt_m = 0.0;
    model.odometry.turn_per_sqrt_s = 0.006;
    model.odometry.sideways_per_sqrt_m = 0.005;
    model.tilt_sigma = 0.005;
    model.tilt_time_s = 0.8;
    model.slope_sigma = 0.01;
    model.constants = Constants::ZERO;
    Settings {
        keyframes: 30,
        points: 400,
        truth: Constants::ZERO,
        model,
        lens: Distortion::None,
    }
}

/// A drive: the problem, and the true body poses of its keyframes.
pub(crate) struct Drive {
    pub(crate) problem: Problem,
    pub(crate) truth: Vec<Se2>,
    /// Poses that the wheels alone tell.
    pub(crate) dead_reckoning: Vec<Se2>,
}

fn nominal(lens: Distortion) -> Rig {
    let pinhole = Pinhole {
        width: 640,
        height: 480,
        fx: 420.0,
        fy: 425.0,
        cx: 322.0,
        cy: 238.0,
    };
    let forward = Mount::forward().body_from_camera.rotation;
    Rig {
        camera: Camera::new(pinhole, lens).unwrap(),
        mount: Mount::new(forward.matrix(), &Vector3::new(0.15, 0.03, 0.2)).unwrap(),
    }
}

impl Drive {
    pub(crate) fn new(settings: &Settings, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || rng.sample::<f64, _>(StandardNormal);
        let truth_of = |constant: Constant| settings.truth[constant];
        let model = &settings.model;
        let rig = nominal(settings.lens);
        let floor = 1e-4;

        let (mut body, mut wheels) = (Se2::identity(), Se2::identity());
        let (mut roll, mut pitch, mut height) = (
            model.tilt_sigma * normal(),
            model.tilt_sigma * normal(),
            0.0,
        );
        let (mut truth, mut dead_reckoning) = (vec![body], vec![wheels]);
        let mut attitudes = vec![(roll, pitch, height)];
        let mut keyframes = vec![Keyframe {
            start: Se2::identity(),
            motion: None,
        }];
        for k in 1..settings.keyframes {
            let mut rows = Vec::new();
            for r in 0..ROWS {
                let time = (k * ROWS + r) as f64 * DT_S;
                let row = OdometryInterval {
                    duration_s: DT_S,
                    v_mps: 0.6 + 0.1 * (0.7 * time).sin(),
                    omega_radps: 0.8 * (0.5 * time).sin(),
                };
                let noise = &model.odometry;
                // Standard deviation of the rate whose integral over a row has the stated one.
                let rate = |per_sqrt: f64, amount: f64| per_sqrt * amount.abs().sqrt() / DT_S;
                let (way, turn) = (row.v_mps * DT_S, row.omega_radps * DT_S);
                let v = row.v_mps * (1.0 + truth_of(Constant::WheelScale))
                    + normal()
                        * rate(noise.forward_per_sqrt_m, way)
                            .hypot(rate(noise.forward_per_sqrt_s, DT_S));
                let omega = row.omega_radps
                    + truth_of(Constant::TurnRateBias)
                    + normal()
                        * rate(noise.turn_per_sqrt_rad, turn)
                            .hypot(rate(noise.turn_per_sqrt_s, DT_S));
                let slip = truth_of(Constant::SlipAngle);
                let sideways = normal() * rate(noise.sideways_per_sqrt_m, way);
                body = body.compose(&Se2::exp(
                    &(Vector3::new(
                        v * slip.cos(),
                        v * slip.sin() + sideways - truth_of(Constant::TurningCentre) * omega,
                        omega,
                    ) * DT_S),
                ));
                wheels = wheels.compose(&Se2::exp(
                    &(Vector3::new(row.v_mps, 0.0, row.omega_radps) * DT_S),
                ));
                rows.push(row);
            }
            body.x += floor * normal();
            body.y += floor * normal();
            body.phi += floor * normal();
            let keep = (-(ROWS as f64) * DT_S / model.tilt_time_s).exp();
            let new = (model.tilt_sigma.powi(2) * (1.0 - keep * keep) + floor * floor).sqrt();
            roll = keep * roll + new * normal();
            pitch = keep * pitch + new * normal();
            let distance: f64 = rows.iter().map(|r| r.v_mps * r.duration_s).sum();
            height += normal() * (model.slope_sigma * distance).hypot(floor);
            truth.push(body);
            dead_reckoning.push(wheels);
            attitudes.push((roll, pitch, height));
            keyframes.push(Keyframe {
                start: wheels,
                motion: Some(rows),
            });
        }
        let problem = Problem {
            tracks: tracks(settings, &rig, &truth, &attitudes, &mut rng),
            rig,
            keyframes,
            model: model.clone(),
        };
        Self {
            problem,
            truth,
            dead_reckoning,
        }
    }
}

fn tracks(
    settings: &Settings,
    rig: &Rig,
    truth: &[Se2],
    attitudes: &[(f64, f64, f64)],
    rng: &mut ChaCha8Rng,
) -> Vec<Track> {
    let constants = &settings.truth;
    let mut parameters = rig.camera.parameters();
    parameters[0] *= 1.0 + constants[Constant::FocalScale];
    parameters[1] *= 1.0 + constants[Constant::FocalScale];
    parameters[2] += constants[Constant::PrincipalX];
    parameters[3] += constants[Constant::PrincipalY];
    if parameters.len() > 4 {
        parameters[4] += constants[Constant::Lens];
    }
    let camera = rig.camera.with_parameters(parameters.as_slice()).unwrap();
    let yaw = Se2::new(0.0, 0.0, constants[Constant::MountYaw]);
    let turned =
        world_from_tilted_body(&yaw, 0.0, 0.0, 0.0).rotation * rig.mount.body_from_camera.rotation;
    let mount = Mount::new(
        turned.matrix(),
        &(rig.mount.body_from_camera.translation
            + Vector3::new(
                constants[Constant::LeverX],
                constants[Constant::LeverY],
                0.0,
            )),
    )
    .unwrap();
    // Points around places of the way, so that each is seen for a while.
    let mut all = Vec::new();
    for id in 0..settings.points {
        let near = &truth[rng.random_range(0..truth.len())];
        let planar = near.act(&Vector2::new(
            rng.random_range(1.0..5.0),
            rng.random_range(-2.5..2.5),
        ));
        let point = Vector3::new(planar.x, planar.y, rng.random_range(-0.8..1.2));
        let mut sightings = Vec::new();
        for (keyframe, (body, (roll, pitch, height))) in truth.iter().zip(attitudes).enumerate() {
            let camera_from_world = mount
                .world_from_camera(body, *roll, *pitch, *height)
                .inverse();
            let q = camera_from_world.transform_point(&point);
            if !(0.4..8.0).contains(&q.z) {
                continue;
            }
            let Some(pixel) = camera.project(&q).filter(|p| camera.contains(p, 2.0)) else {
                continue;
            };
            let size_px = f64::from(1 + id as u32 % 4);
            let noise = Vector2::new(
                rng.sample::<f64, _>(StandardNormal),
                rng.sample::<f64, _>(StandardNormal),
            );
            sightings.push(Sighting {
                keyframe,
                pixel: pixel + noise * keypoint_sigma_px(settings.model.sigma_px, size_px),
                size_px,
            });
        }
        all.push(Track {
            landmark: id as u32,
            sightings,
        });
    }
    all
}

/// Root of the mean squared distance of positions, metres.
pub(crate) fn rmse(poses: impl Iterator<Item = Se2>, truth: &[Se2]) -> f64 {
    let sum: f64 = poses
        .zip(truth)
        .map(|(p, t)| (p.x - t.x).powi(2) + (p.y - t.y).powi(2))
        .sum();
    (sum / truth.len() as f64).sqrt()
}
