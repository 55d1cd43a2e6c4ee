//! A robot that weaves through a hall of points, its camera, and its odometry.

use mono_geometry::motion::{OdometrySample, exact_arc};
use mono_geometry::{Mount, Pinhole, Se2, Se3, world_from_tilted_body};
use motion_consistency::FramePair;
use nalgebra::{Rotation3, Vector2, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

pub(crate) const CAMERA: Pinhole = Pinhole {
    width: 640,
    height: 480,
    fx: 500.0,
    fy: 500.0,
    cx: 319.5,
    cy: 239.5,
};
/// Seconds between two frames, and frames.
const STEP_S: f64 = 0.5;
const FRAMES: usize = 40;
/// Rows of odometry in a step.
const ROWS: usize = 5;

pub(crate) struct Drive {
    pub(crate) mount: Mount,
    pub(crate) odometry: Vec<OdometrySample>,
    pub(crate) pairs: Vec<FramePair>,
    /// True body poses at the frames.
    pub(crate) path: Vec<(f64, Se2)>,
}

/// A camera that looks to the left of the robot.
pub(crate) fn looking_left() -> Mount {
    turned(&Mount::forward(), 90.0, 0.0)
}

/// `mount` turned about the body's vertical and about the optical axis, degrees.
pub(crate) fn turned(mount: &Mount, yaw_degrees: f64, roll_degrees: f64) -> Mount {
    let about_z =
        |degrees: f64| Rotation3::from_axis_angle(&Vector3::z_axis(), degrees.to_radians());
    Mount {
        body_from_camera: Se3 {
            rotation: about_z(yaw_degrees)
                * mount.body_from_camera.rotation
                * about_z(roll_degrees),
            translation: mount.body_from_camera.translation,
        },
    }
}

impl Drive {
    /// The drive number `seed`: odometry with 2 % and 0.01 rad per root second of noise, half a pixel of noise in the image,
    /// a tenth of the matches wrong.
    pub(crate) fn new(seed: u64, mount: Mount) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let points: Vec<Vector3<f64>> = (0..6000)
            .map(|_| {
                Vector3::new(
                    random.random_range(-5.0..13.0),
                    random.random_range(-4.0..4.0),
                    random.random_range(-1.0..2.0),
                )
            })
            .collect();
        let dt = STEP_S / ROWS as f64;
        let mut pose = Se2::identity();
        let mut path = vec![(0.0, pose)];
        let mut odometry = Vec::new();
        for row in 0..(FRAMES - 1) * ROWS {
            let t_s = row as f64 * dt;
            let (v, omega) = (0.4 + 0.1 * (0.3 * t_s).sin(), 0.35 * (0.9 * t_s).sin());
            pose = pose.compose(&exact_arc(v, omega, dt));
            odometry.push(OdometrySample {
                t_s,
                v_mps: v * (1.0 + 0.02 * normal(&mut random)),
                omega_radps: omega + 0.01 / dt.sqrt() * normal(&mut random),
            });
            if (row + 1) % ROWS == 0 {
                path.push(((row + 1) as f64 * dt, pose));
            }
        }
        let views: Vec<Vec<Option<Vector2<f64>>>> = path
            .iter()
            .map(|(_, pose)| {
                let world_from_camera =
                    world_from_tilted_body(pose, 0.0, 0.0, 0.0).compose(&mount.body_from_camera);
                let camera_from_world = world_from_camera.inverse();
                points
                    .iter()
                    .map(|point| {
                        let pixel = CAMERA.project(&camera_from_world.transform_point(point))?;
                        let noisy =
                            pixel + 0.5 * Vector2::new(normal(&mut random), normal(&mut random));
                        let inside =
                            (0.0..640.0).contains(&noisy.x) && (0.0..480.0).contains(&noisy.y);
                        inside.then_some(noisy)
                    })
                    .collect()
            })
            .collect();
        let pairs = (1..path.len())
            .map(|later| {
                let mut matches: Vec<[Vector2<f64>; 2]> = views[later - 1]
                    .iter()
                    .zip(&views[later])
                    .filter_map(|(from, to)| Some([(*from)?, (*to)?]))
                    .take(150)
                    .collect();
                for wrong in matches.iter_mut().step_by(10) {
                    wrong[1] = Vector2::new(
                        random.random_range(0.0..640.0),
                        random.random_range(0.0..480.0),
                    );
                }
                FramePair {
                    from_s: path[later - 1].0,
                    to_s: path[later].0,
                    matches,
                }
            })
            .collect();
        Self {
            mount,
            odometry,
            pairs,
            path,
        }
    }

    /// The odometry with speed and turn rate multiplied, and moved in time.
    pub(crate) fn spoiled(&self, v: f64, omega: f64, later_s: f64) -> Vec<OdometrySample> {
        self.odometry
            .iter()
            .map(|row| OdometrySample {
                t_s: row.t_s + later_s,
                v_mps: v * row.v_mps,
                omega_radps: omega * row.omega_radps,
            })
            .collect()
    }
}

/// A standard normal number (Box and Muller).
fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (a, b): (f64, f64) = (1.0 - random.random::<f64>(), random.random());
    (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}
