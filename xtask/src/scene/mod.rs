//! A synthetic laboratory: a textured scene, a robot's path through it, the
//! paper's camera, and exact truth for everything.
//!
//! One [`SceneSpec`] fixes a sequence to the last bit: each use of randomness has
//! a ChaCha stream of its own, keyed by seed, purpose and index, so neither
//! threads nor the order of work can change a pixel. The library answers what an
//! evaluation asks: the true pose of a frame, and which 3-D point a pixel saw.
//!
//! World axes: x forward along the first heading, y left, z up; the origin is the first body
//! pose, on the floor. `wall` is the paper's first experiment (a wall 2 m to the left,
//! parallel to the path), `room` its second (a closed loop inside four walls).

pub mod camera;
mod canvas;
mod draw;
mod furnish;
pub mod geometry;
mod paint;
mod render;
mod texture;
pub mod trajectory;
mod write;

use anyhow::ensure;
use furnish::{WALL_HEIGHT_M, WallFrame};
use geometry::World;
use nalgebra::{Isometry3, Point3, Vector3};
use paint::{Paint, paint_world};

pub use paint::Skins;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use texture::Skin;
use trajectory::{Course, OdometryNoise, OdometryRow, Path};

/// Distance from the path to the wall in the wall scene, metres.
const WALL_DISTANCE_M: f64 = 2.0;
/// Metres a frame in the wall scene.
const WALL_STEP_M: f64 = 0.1;
/// Inner size of the room along x and y, metres.
const ROOM_SIZE_M: [f64; 2] = [6.0, 5.0];
/// Distance from the room loop to the walls, metres.
const ROOM_INSET_M: f64 = 1.9;
/// Frames that drive the start of the room loop again.
const ROOM_OVERLAP: usize = 14;
/// Largest number of frames of one sequence.
const MOST_FRAMES: usize = 5000;

/// The two experiments of the paper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SceneKind {
    /// Straight along a wall.
    Wall,
    /// A closed loop in a room.
    Room,
}

/// Everything that determines a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SceneSpec {
    /// Which experiment.
    pub kind: SceneKind,
    /// Seed of geometry, skins, steering and noise.
    pub seed: u64,
    /// Number of images, 2 to 5000.
    pub frames: usize,
    /// Standard deviation of the pixel noise at mid grey, in grey levels.
    pub noise_px: f64,
    /// Errors of the wheel odometry.
    pub odometry: OdometryNoise,
}

impl SceneSpec {
    /// The paper's wall run: 38 frames.
    pub fn wall(seed: u64) -> Self {
        Self {
            kind: SceneKind::Wall,
            seed,
            frames: 38,
            noise_px: 2.0,
            odometry: OdometryNoise::PAPER,
        }
    }

    /// The paper's room run: 186 frames.
    pub fn room(seed: u64) -> Self {
        Self {
            kind: SceneKind::Room,
            frames: 186,
            ..Self::wall(seed)
        }
    }

    /// Whether a scene can be built.
    ///
    /// # Errors
    /// Too few or too many frames, or a noise that is negative or not finite.
    pub fn check(&self) -> anyhow::Result<()> {
        ensure!(
            (2..=MOST_FRAMES).contains(&self.frames),
            "a scene has 2 to {MOST_FRAMES} frames, not {}",
            self.frames
        );
        let noise = self.odometry;
        let levels = [
            ("pixel noise", self.noise_px),
            ("odometry speed noise", noise.speed_ratio),
            ("odometry heading noise", noise.heading_rad),
            ("odometry speed bias", noise.speed_bias_ratio),
            ("odometry turn bias", noise.turn_bias_radps),
        ];
        for (name, level) in levels {
            ensure!(
                (0.0..=64.0).contains(&level),
                "{name} must be in 0 to 64, not {level}"
            );
        }
        Ok(())
    }
}

/// What a random stream is for; part of its key.
#[derive(Debug, Clone, Copy)]
enum Purpose {
    Layout = 1,
    Skin = 2,
    Light = 3,
    Path = 4,
    Odometry = 5,
    Exposure = 6,
    Sensor = 7,
}

/// The stream of one (seed, purpose, index).
fn stream(seed: u64, purpose: Purpose, index: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream((purpose as u64) << 48 | index);
    rng
}

/// A built scene: geometry, the true path, the odometry. Skins are painted apart.
#[derive(Debug, Clone)]
pub struct Scene {
    spec: SceneSpec,
    world: World,
    path: Path,
    odometry: Vec<OdometryRow>,
}

impl Scene {
    /// Builds the scene of a specification, without painting it: quick.
    ///
    /// # Errors
    /// As [`SceneSpec::check`].
    pub fn new(spec: SceneSpec) -> anyhow::Result<Self> {
        spec.check()?;
        let path = Path::drive(
            spec.course(),
            spec.frames,
            &mut stream(spec.seed, Purpose::Path, 0),
        );
        let odometry = path.odometry(&spec.odometry, &mut stream(spec.seed, Purpose::Odometry, 0));
        let world = spec.furniture();
        Ok(Self {
            spec,
            world,
            path,
            odometry,
        })
    }

    /// The specification it was built from.
    pub fn spec(&self) -> &SceneSpec {
        &self.spec
    }

    /// Paints the skins that [`Self::render`] looks at; a second or so.
    pub fn skins(&self) -> Skins {
        paint_world(&self.world, self.spec.seed)
    }

    /// The geometry.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// True path and control.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What the wheels report.
    pub fn odometry(&self) -> &[OdometryRow] {
        &self.odometry
    }

    /// True camera pose of a frame.
    ///
    /// # Panics
    /// When `frame` is not below the number of frames.
    pub fn world_from_camera(&self, frame: usize) -> Isometry3<f64> {
        camera::world_from_camera(&self.path.poses[frame])
    }

    /// Depth (camera z, metres) of the surface seen at a pixel position of a frame;
    /// `None` outside the image or where the ray leaves the scene.
    ///
    /// # Panics
    /// When `frame` is not below the number of frames.
    pub fn depth_at(&self, frame: usize, u: f64, v: f64) -> Option<f64> {
        if !camera::on_image(u, v) {
            return None;
        }
        let pose = self.world_from_camera(frame);
        let origin = Point3::from(pose.translation.vector);
        // The ray has unit camera depth, so its parameter is the depth.
        self.world
            .cast(&origin, &(pose * camera::ray(u, v)))
            .map(|hit| hit.distance)
    }

    /// World point seen at a pixel position of a frame, as [`Self::depth_at`].
    ///
    /// # Panics
    /// When `frame` is not below the number of frames.
    pub fn point_at(&self, frame: usize, u: f64, v: f64) -> Option<Point3<f64>> {
        let depth = self.depth_at(frame, u, v)?;
        Some(self.world_from_camera(frame) * Point3::from(camera::ray(u, v) * depth))
    }

    /// Pixel at which a frame would see a world point if nothing hid it; `None`
    /// behind the camera or outside the image.
    ///
    /// # Panics
    /// When `frame` is not below the number of frames.
    pub fn project(&self, frame: usize, point: &Point3<f64>) -> Option<[f64; 2]> {
        let seen = self.world_from_camera(frame).inverse() * point;
        camera::project(&seen).filter(|&[u, v]| camera::on_image(u, v))
    }
}

impl SceneSpec {
    fn course(&self) -> Course {
        match self.kind {
            SceneKind::Wall => Course::Straight {
                step_m: WALL_STEP_M,
            },
            SceneKind::Room => Course::Loop {
                long_m: ROOM_SIZE_M[0] - 2.0 * ROOM_INSET_M,
                short_m: ROOM_SIZE_M[1] - 2.0 * ROOM_INSET_M,
                overlap: ROOM_OVERLAP,
            },
        }
    }

    fn furniture(&self) -> World {
        let mut furniture = World::default();
        let margin = 1.8;
        let (low, high) = match self.kind {
            SceneKind::Wall => {
                let length = WALL_STEP_M * (self.frames - 1) as f64;
                (
                    Point3::new(-margin, 0.0, 0.0),
                    Point3::new(length + margin, WALL_DISTANCE_M, WALL_HEIGHT_M),
                )
            }
            SceneKind::Room => {
                let [x, y] = ROOM_SIZE_M;
                (
                    Point3::new(-x / 2.0, ROOM_INSET_M - y, 0.0),
                    Point3::new(x / 2.0, ROOM_INSET_M, WALL_HEIGHT_M),
                )
            }
        };
        // Lower left corner as seen from inside, inward normal, length.
        let size = high - low;
        let mut walls = vec![(Point3::new(low.x, high.y, 0.0), -Vector3::y(), size.x)];
        if self.kind == SceneKind::Room {
            walls.push((Point3::new(high.x, high.y, 0.0), -Vector3::x(), size.y));
            walls.push((Point3::new(high.x, low.y, 0.0), Vector3::y(), size.x));
            walls.push((Point3::new(low.x, low.y, 0.0), Vector3::x(), size.y));
        }
        for (index, (origin, inward, length)) in walls.into_iter().enumerate() {
            let wall = WallFrame {
                origin,
                inward,
                length,
            };
            furniture.furnish(&wall, &mut stream(self.seed, Purpose::Layout, index as u64));
        }
        // The camera sees neither from within two metres of a wall.
        if self.kind == SceneKind::Room {
            let floor = Paint::Skin {
                skin: Skin::Worn { tone: 0.35 },
                light: 0.9,
            };
            let floor_far = Point3::new(high.x, high.y, 0.0);
            furniture.rectangle(low, floor_far, Vector3::z(), floor);
            let ceiling = Paint::Skin {
                skin: Skin::Worn { tone: 0.85 },
                light: 0.9,
            };
            let ceiling_near = Point3::new(low.x, low.y, WALL_HEIGHT_M);
            furniture.rectangle(ceiling_near, high, -Vector3::z(), ceiling);
        }
        furniture
    }
}

#[cfg(test)]
mod tests;
