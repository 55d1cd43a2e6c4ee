//! A person-sized block that walks between the robot and the walls.
//!
//! Along a wall it walks to and fro; in the room it walks around against the robot's sense, so that they meet several
//! times a round. The block does not turn, which keeps its faces axis-aligned; it is painted like the things on the walls,
//! because a moving thing without texture would deceive nobody. It is at a place of its own at every time, whatever the
//! robot does.

use crate::facet::Facet;
use crate::skin::kind::Skin;
use crate::skin::paint::Paint;
use crate::world::World;
use nalgebra::{Point3, Vector3};

/// Half width and height of the block, metres.
const HALF_M: f64 = 0.22;
const HEIGHT_M: f64 = 1.75;
/// Speed, metres per second.
const SPEED_MPS: f64 = 0.5;
/// Faces of the block; it stands on the floor.
pub(crate) const FACES: usize = 5;

/// The way of the block: to and fro between two corners that lie on a line, or around the rectangle between them,
/// counterclockwise from the first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Way {
    pub(crate) low: [f64; 2],
    pub(crate) high: [f64; 2],
}

impl Way {
    /// Centre of the block at a time.
    pub(crate) fn at(self, time_s: f64) -> [f64; 2] {
        let [width, depth] = [self.high[0] - self.low[0], self.high[1] - self.low[1]];
        let mut rest = (SPEED_MPS * time_s).rem_euclid(2.0 * (width + depth));
        let [mut x, mut y] = self.low;
        for (length, [dx, dy]) in [
            (width, [1.0, 0.0]),
            (depth, [0.0, 1.0]),
            (width, [-1.0, 0.0]),
            (depth, [0.0, -1.0]),
        ] {
            let part = rest.min(length);
            x += dx * part;
            y += dy * part;
            rest -= part;
        }
        [x, y]
    }
}

/// Adds the faces of the block, at the origin.
pub(crate) fn add(world: &mut World) {
    let (low, high) = ([-HALF_M, -HALF_M, 0.0], [HALF_M, HALF_M, HEIGHT_M]);
    let p = |x: usize, y: usize, z: usize| {
        let pick = |k: usize, side: usize| if side == 0 { low[k] } else { high[k] };
        Point3::new(pick(0, x), pick(1, y), pick(2, z))
    };
    for (a, b, normal, skin, light) in [
        (p(1, 0, 0), p(1, 1, 1), Vector3::x(), Skin::Sheet, 1.0),
        (p(0, 0, 0), p(0, 1, 1), -Vector3::x(), Skin::Sheet, 0.9),
        (p(0, 1, 0), p(1, 1, 1), Vector3::y(), Skin::Carton, 1.0),
        (p(0, 0, 0), p(1, 0, 1), -Vector3::y(), Skin::Instrument, 0.9),
        (
            p(0, 0, 1),
            p(1, 1, 1),
            Vector3::z(),
            Skin::Worn { tone: 0.2 },
            1.0,
        ),
    ] {
        world.rectangle(a, b, normal, Paint::Skin { skin, light });
    }
}

/// Moves the faces of the block, which are the last ones, from the origin to a place.
pub(crate) fn place(facets: &mut [Facet], [x, y]: [f64; 2]) {
    let shift = [x, y, 0.0];
    let first = facets.len().saturating_sub(FACES);
    for facet in &mut facets[first..] {
        facet.offset += shift[facet.axis];
        for k in 0..2 {
            let along = shift[(facet.axis + 1 + k) % 3];
            facet.low[k] += along;
            facet.high[k] += along;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_block_walks_at_its_speed_and_comes_back() {
        for way in [
            Way {
                low: [-2.0, 1.0],
                high: [4.0, 1.0],
            },
            Way {
                low: [-2.0, -2.0],
                high: [2.0, 1.0],
            },
        ] {
            let round_s = 2.0 * (way.high[0] - way.low[0] + way.high[1] - way.low[1]) / SPEED_MPS;
            let [x, y] = way.at(round_s);
            assert!((x - way.low[0]).abs() < 1e-9 && (y - way.low[1]).abs() < 1e-9);
            for k in 0..100 {
                let time_s = f64::from(k) * 0.37;
                let ([x0, y0], [x1, y1]) = (way.at(time_s), way.at(time_s + 0.1));
                // The city-block distance does not shrink in corners; on a turn back it does.
                let step = (x1 - x0).abs() + (y1 - y0).abs();
                assert!(step < 0.1 * SPEED_MPS + 1e-9);
                assert!((way.low[0]..=way.high[0]).contains(&x0));
                assert!((way.low[1]..=way.high[1]).contains(&y0));
            }
        }
    }

    #[test]
    fn a_placed_block_stands_about_its_centre_on_the_floor() {
        let mut world = World::default();
        add(&mut world);
        place(&mut world.facets, [3.0, -1.0]);
        let corners = || world.facets.iter().flat_map(Facet::corners);
        for (axis, low, high) in [
            (0, 3.0 - HALF_M, 3.0 + HALF_M),
            (1, -1.0 - HALF_M, -1.0 + HALF_M),
            (2, 0.0, HEIGHT_M),
        ] {
            let least = corners().map(|c| c[axis]).fold(f64::INFINITY, f64::min);
            let most = corners().map(|c| c[axis]).fold(f64::NEG_INFINITY, f64::max);
            assert!((least - low).abs() < 1e-12 && (most - high).abs() < 1e-12);
        }
    }
}
