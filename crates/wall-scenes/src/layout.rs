//! The two experiments laid out: the course of the robot, and the walls around it.

use crate::course::Course;
use crate::furnish::{WALL_HEIGHT_M, WallFrame};
use crate::skin::kind::Skin;
use crate::skin::paint::Paint;
use crate::spec::{SceneKind, SceneSpec};
use crate::stream::{Purpose, stream};
use crate::walker::{self, Way};
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
/// Distance of somebody who walks from the walls, metres.
const WALK_INSET_M: f64 = 0.9;
/// Width and height of a poster's board, metres.
const POSTER_SIZE_M: [f64; 2] = [0.8, 1.1];
/// Height of its lower edge, metres.
const POSTER_LOW_M: f64 = 0.4;
/// Distance of a board from the wall, metres: in front of all relief.
const POSTER_BEFORE_M: f64 = 0.52;

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

/// Corners of the walls: low and high.
fn bounds(spec: &SceneSpec) -> (Point3<f64>, Point3<f64>) {
    let margin = 1.8;
    match spec.kind {
        SceneKind::Wall => {
            let carried = spec.mishaps.kidnap.map_or(0.0, |kidnap| kidnap.metres);
            let length = WALL_STEP_M * (spec.stops.driven(spec.frames - 1)) as f64 + carried;
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
    }
}

/// The way of somebody who walks between the robot and the walls.
pub(crate) fn walk(spec: &SceneSpec) -> Way {
    let (low, high) = bounds(spec);
    let inset = WALK_INSET_M;
    let y = match spec.kind {
        SceneKind::Wall => high.y - inset,
        SceneKind::Room => low.y + inset,
    };
    Way {
        low: [low.x + inset, y],
        high: [high.x - inset, high.y - inset],
    }
}

/// Two boards with the same poster, in front of all furniture: along a wall after a quarter and three quarters of it, in
/// the room on opposite sides, not quite opposite one another.
fn twin_posters(world: &mut World, spec: &SceneSpec) {
    let (low, high) = bounds(spec);
    let far = (high.y - POSTER_BEFORE_M, -Vector3::y());
    let places = match spec.kind {
        SceneKind::Wall => {
            let driven = high.x + low.x;
            [(0.25 * driven, far), (0.75 * driven, far)]
        }
        SceneKind::Room => {
            let near = (low.y + POSTER_BEFORE_M, Vector3::y());
            [(0.55, far), (0.2, near)]
        }
    };
    let [width, height] = POSTER_SIZE_M;
    for (x, (y, normal)) in places {
        world.rectangle(
            Point3::new(x - width / 2.0, y, POSTER_LOW_M),
            Point3::new(x + width / 2.0, y, POSTER_LOW_M + height),
            normal,
            Paint::Twin(Skin::Poster),
        );
    }
}

/// The walls of an experiment with everything on and before them; somebody who walks comes last.
pub(crate) fn furniture(spec: &SceneSpec) -> World {
    let mut world = World::default();
    let (low, high) = bounds(spec);
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
    if spec.twin_posters {
        twin_posters(&mut world, spec);
    }
    if spec.mishaps.walker {
        walker::add(&mut world);
    }
    world
}
