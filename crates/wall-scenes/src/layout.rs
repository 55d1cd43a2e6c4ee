//! The two experiments laid out: the course of the robot, and the walls around it.

use crate::course::Course;
use crate::furnish::{WALL_HEIGHT_M, WallFrame};
use crate::skin::kind::Skin;
use crate::skin::paint::Paint;
use crate::spec::{SceneKind, SceneSpec};
use crate::stream::{Purpose, stream};
use crate::world::World;
use nalgebra::{Point3, Vector3};

/// Distance from the path to the wall in the wall scene, metres.
const WALL_DISTANCE_M: f64 = 2.0;
/// Metres a frame in the wall scene.
const WALL_STEP_M: f64 = 0.1;
/// Metres after which the slope of the wall scene's floor comes again.
const WALL_WAVE_M: f64 = 4.0;
/// Inner size of the room along x and y, metres.
const ROOM_SIZE_M: [f64; 2] = [6.0, 5.0];
/// Distance from the room loop to the walls, metres.
const ROOM_INSET_M: f64 = 1.9;
/// Frames that drive the start of the room loop again.
const ROOM_OVERLAP: usize = 14;

/// The course of an experiment.
pub(crate) fn course(spec: &SceneSpec) -> Course {
    match spec.kind {
        SceneKind::Wall => Course::Straight {
            step_m: WALL_STEP_M,
            wave_m: WALL_WAVE_M,
        },
        SceneKind::Room => Course::Loop {
            long_m: ROOM_SIZE_M[0] - 2.0 * ROOM_INSET_M,
            short_m: ROOM_SIZE_M[1] - 2.0 * ROOM_INSET_M,
            laps: spec.laps,
            overlap: ROOM_OVERLAP,
        },
    }
}

/// The walls of an experiment with everything on and before them.
pub(crate) fn furniture(spec: &SceneSpec) -> World {
    let mut world = World::default();
    let margin = 1.8;
    let (low, high) = match spec.kind {
        SceneKind::Wall => {
            let length = WALL_STEP_M * (spec.frames - 1) as f64;
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
    if spec.kind == SceneKind::Room {
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
        world.furnish(&wall, &mut stream(spec.seed, Purpose::Layout, index as u64));
    }
    // The camera sees neither from within two metres of a wall.
    if spec.kind == SceneKind::Room {
        let floor = Paint::Skin {
            skin: Skin::Worn { tone: 0.35 },
            light: 0.9,
        };
        let floor_far = Point3::new(high.x, high.y, 0.0);
        world.rectangle(low, floor_far, Vector3::z(), floor);
        let ceiling = Paint::Skin {
            skin: Skin::Worn { tone: 0.85 },
            light: 0.9,
        };
        let ceiling_near = Point3::new(low.x, low.y, WALL_HEIGHT_M);
        world.rectangle(ceiling_near, high, -Vector3::z(), ceiling);
    }
    world
}
