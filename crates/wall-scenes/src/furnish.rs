//! The furniture along a wall: boxes, shelves, doors and sheets.
//!
//! A wall is described in its own coordinates: s metres to the viewer's right, h metres up,
//! d metres into the room. It is cut into stretches of about a metre; each
//! gets a material and one kind of furniture (shelves, bench, cabinet, door, electrical
//! boxes, sheets only), never the same kind twice in a row. Relief stays within
//! half a metre of the wall. Bare places get sheets, cables and soft shadows.

use crate::skin::draw::{between, chance, pick};
use crate::skin::kind::Skin;
use crate::skin::paint::Paint;
use crate::skin::surface::Material;
use crate::skin::wall_plan::WallPlan;
use crate::world::World;
use nalgebra::{Point3, Vector3};
use rand_chacha::ChaCha8Rng;

/// Height of walls, metres.
pub(crate) const WALL_HEIGHT_M: f64 = 2.4;
/// Furniture keeps this far from the ends of a wall, so that corners stay free.
const CORNER_CLEARANCE_M: f64 = 0.6;

/// A wall's own coordinates in the world.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WallFrame {
    /// Lower left corner as seen from the room.
    pub(crate) origin: Point3<f64>,
    /// Unit axis into the room.
    pub(crate) inward: Vector3<f64>,
    /// Metres along the wall.
    pub(crate) length: f64,
}

/// A box in wall coordinates: `[low, high]` of s, h and d.
#[derive(Debug, Clone, Copy)]
struct Block {
    s: [f64; 2],
    h: [f64; 2],
    d: [f64; 2],
}

impl WallFrame {
    fn point(&self, s: f64, h: f64, d: f64) -> Point3<f64> {
        let right = (-self.inward).cross(&Vector3::z());
        self.origin + right * s + Vector3::z() * h + self.inward * d
    }
}

impl World {
    /// The five visible faces of a box that stands against a wall.
    fn block(&mut self, wall: &WallFrame, block: Block, front: Skin, rest: Skin) {
        let Block {
            s: [s0, s1],
            h: [h0, h1],
            d: [d0, d1],
        } = block;
        let right = (-wall.inward).cross(&Vector3::z());
        let up = Vector3::z();
        let p = |s, h, d| wall.point(s, h, d);
        let faces = [
            (p(s0, h0, d1), p(s1, h1, d1), wall.inward, front, 1.0),
            (p(s0, h0, d0), p(s0, h1, d1), -right, rest, 0.7),
            (p(s1, h0, d0), p(s1, h1, d1), right, rest, 0.85),
            (p(s0, h1, d0), p(s1, h1, d1), up, rest, 1.1),
            (p(s0, h0, d0), p(s1, h0, d1), -up, rest, 0.5),
        ];
        for (a, b, normal, skin, light) in faces {
            self.rectangle(a, b, normal, Paint::Skin { skin, light });
        }
    }

    /// Furnishes one wall.
    pub(crate) fn furnish(&mut self, wall: &WallFrame, rng: &mut ChaCha8Rng) {
        let mut plan = WallPlan::default();
        let clear = CORNER_CLEARANCE_M.min(wall.length / 4.0);
        let (mut s, mut last) = (0.0, usize::MAX);
        while s < wall.length {
            let corner = s < clear || s > wall.length - clear - 0.5;
            let width = if corner {
                clear
            } else {
                between(rng, 0.75, 1.25)
            };
            // The last stretch ends exactly at the wall's end.
            let end = if wall.length - s - width < 0.3 {
                wall.length
            } else {
                s + width
            };
            let material = [
                Material::Plaster,
                Material::Brick,
                Material::Tile,
                Material::Boards,
            ][pick(rng, 4)];
            plan.stretches.push((s, end, material));
            let mut kind = if corner { 5 } else { pick(rng, 6) };
            if kind == last && !corner {
                kind = (kind + 1) % 6;
            }
            last = kind;
            let (left, right) = (s + 0.03, end - 0.03);
            match kind {
                0 => self.shelves(wall, [left, right], &mut plan, rng),
                1 => self.bench(wall, [left, right], &mut plan, rng),
                2 => self.cabinet(wall, [left, right], &mut plan, rng),
                3 => self.door(wall, [left, right], &mut plan, rng),
                4 => self.services(wall, [left, right], &mut plan, rng),
                _ => {}
            }
            plan.hang_sheets([s, end], WALL_HEIGHT_M, rng);
            s = end;
        }
        plan.lay_cables(wall.length, rng);
        let (a, b) = (
            wall.point(0.0, 0.0, 0.0),
            wall.point(wall.length, WALL_HEIGHT_M, 0.0),
        );
        self.rectangle(a, b, wall.inward, Paint::Wall(plan));
    }

    /// Planks with books, cartons and instruments.
    fn shelves(
        &mut self,
        wall: &WallFrame,
        [s0, s1]: [f64; 2],
        plan: &mut WallPlan,
        rng: &mut ChaCha8Rng,
    ) {
        let depth = between(rng, 0.2, 0.3);
        let wood = Skin::Wood {
            tone: between(rng, 0.3, 0.7),
        };
        let mut h = between(rng, 0.25, 0.45);
        let bottom = h;
        while h < 1.75 {
            let rise = between(rng, 0.34, 0.48);
            let plank = Block {
                s: [s0, s1],
                h: [h, h + 0.028],
                d: [0.0, depth],
            };
            self.block(wall, plank, wood, wood);
            plan.cover([s0, h - 0.02, s1, h + 0.03], 0.05);
            self.stand_things(
                wall,
                [s0 + 0.02, s1 - 0.02],
                h + 0.028,
                [rise - 0.05, depth],
                plan,
                rng,
            );
            h += rise;
        }
        if chance(rng, 0.6) {
            for s in [s0 - 0.012, s1 - 0.012] {
                let board = Block {
                    s: [s, s + 0.024],
                    h: [bottom, h],
                    d: [0.0, depth],
                };
                self.block(wall, board, wood, wood);
            }
        }
    }

    /// Fills a length with things that stand on a surface at height `h`.
    /// `room` is the free height and depth.
    fn stand_things(
        &mut self,
        wall: &WallFrame,
        [s0, s1]: [f64; 2],
        h: f64,
        [height, depth]: [f64; 2],
        plan: &mut WallPlan,
        rng: &mut ChaCha8Rng,
    ) {
        let mut s = s0 + between(rng, 0.0, 0.06);
        while s < s1 - 0.06 {
            let kind = pick(rng, 5);
            let start = s;
            if kind <= 1 {
                for _ in 0..3 + pick(rng, 5) {
                    let width = between(rng, 0.025, 0.06);
                    if s + width > s1 {
                        break;
                    }
                    let tall = height * between(rng, 0.6, 0.95);
                    let front = depth - between(rng, 0.01, 0.06);
                    let book = Block {
                        s: [s, s + width],
                        h: [h, h + tall],
                        d: [0.02, front],
                    };
                    let tone = between(rng, 0.2, 0.8);
                    self.block(wall, book, Skin::Spine, Skin::Worn { tone });
                    s += width + between(rng, 0.0, 0.004);
                }
            } else {
                let width = between(rng, 0.1, 0.34).min(s1 - s);
                let tall = height * between(rng, 0.45, 0.95);
                let deep = (depth - between(rng, 0.0, 0.08)).max(0.06);
                let thing = Block {
                    s: [s, s + width],
                    h: [h, h + tall],
                    d: [0.02, deep],
                };
                let skin = match kind {
                    2 => Skin::Instrument,
                    3 => Skin::Carton,
                    _ => Skin::Sheet,
                };
                let tone = between(rng, 0.3, 0.7);
                self.block(wall, thing, skin, Skin::Worn { tone });
                s += width;
            }
            plan.cover([start, h, s, h + 0.8 * height], 0.08);
            s += between(rng, 0.015, 0.1);
        }
    }

    /// A table top on legs with instruments on and cartons under it.
    fn bench(
        &mut self,
        wall: &WallFrame,
        [s0, s1]: [f64; 2],
        plan: &mut WallPlan,
        rng: &mut ChaCha8Rng,
    ) {
        let top = between(rng, 0.62, 0.76);
        let depth = between(rng, 0.4, 0.5);
        let wood = Skin::Wood {
            tone: between(rng, 0.4, 0.75),
        };
        self.block(
            wall,
            Block {
                s: [s0, s1],
                h: [top - 0.035, top],
                d: [0.0, depth],
            },
            wood,
            wood,
        );
        let metal = Skin::Worn {
            tone: between(rng, 0.15, 0.4),
        };
        for s in [s0 + 0.02, s1 - 0.06] {
            let leg = Block {
                s: [s, s + 0.04],
                h: [0.0, top - 0.035],
                d: [depth - 0.07, depth - 0.03],
            };
            self.block(wall, leg, metal, metal);
        }
        plan.cover([s0, top - 0.1, s1, top], 0.12);
        self.stand_things(wall, [s0, s1], top, [0.42, depth - 0.05], plan, rng);
        self.stand_things(
            wall,
            [s0 + 0.08, s1 - 0.08],
            0.0,
            [0.5, depth - 0.1],
            plan,
            rng,
        );
    }

    /// A closed cupboard with things on top.
    fn cabinet(
        &mut self,
        wall: &WallFrame,
        [s0, s1]: [f64; 2],
        plan: &mut WallPlan,
        rng: &mut ChaCha8Rng,
    ) {
        let top = between(rng, 0.85, 1.25);
        let depth = between(rng, 0.35, 0.48);
        let tone = between(rng, 0.45, 0.8);
        let middle = s0 + (s1 - s0) * between(rng, 0.4, 0.6);
        for s in [[s0, middle - 0.004], [middle + 0.004, s1]] {
            let tone = tone + between(rng, -0.12, 0.1);
            let half = Block {
                s,
                h: [0.0, top],
                d: [0.0, depth],
            };
            self.block(wall, half, Skin::Leaf { tone }, Skin::Worn { tone });
            let handle = Block {
                s: [s[0] + 0.05, s[0] + 0.07],
                h: [0.5 * top, 0.5 * top + 0.14],
                d: [depth, depth + 0.02],
            };
            self.block(
                wall,
                handle,
                Skin::Worn { tone: 0.15 },
                Skin::Worn { tone: 0.2 },
            );
        }
        plan.cover([s0, 0.0, s1, top], 0.1);
        self.stand_things(wall, [s0, s1], top, [0.4, depth - 0.04], plan, rng);
    }

    /// A door leaf in a frame that stands out of the wall.
    fn door(
        &mut self,
        wall: &WallFrame,
        [s0, s1]: [f64; 2],
        plan: &mut WallPlan,
        rng: &mut ChaCha8Rng,
    ) {
        let tone = between(rng, 0.35, 0.8);
        let frame_skin = Skin::Wood {
            tone: between(rng, 0.2, 0.6),
        };
        let jamb = between(rng, 0.06, 0.09);
        let deep = between(rng, 0.05, 0.09);
        let top = between(rng, 2.0, 2.1);
        let leaf = Block {
            s: [s0 + jamb, s1 - jamb],
            h: [0.01, top],
            d: [0.0, 0.015],
        };
        self.block(wall, leaf, Skin::Leaf { tone }, Skin::Worn { tone });
        for s in [s0, s1 - jamb] {
            let post = Block {
                s: [s, s + jamb],
                h: [0.0, top],
                d: [0.0, deep],
            };
            self.block(wall, post, frame_skin, frame_skin);
        }
        let lintel = Block {
            s: [s0, s1],
            h: [top, top + jamb],
            d: [0.0, deep],
        };
        self.block(wall, lintel, frame_skin, frame_skin);
        plan.cover([s0, 0.0, s1, top + jamb], 0.03);
    }

    /// Electrical boxes and cable ducts.
    fn services(
        &mut self,
        wall: &WallFrame,
        [s0, s1]: [f64; 2],
        plan: &mut WallPlan,
        rng: &mut ChaCha8Rng,
    ) {
        let duct = Skin::Worn {
            tone: between(rng, 0.5, 0.85),
        };
        let s = between(rng, s0 + 0.02, s1 - 0.1);
        let upright = Block {
            s: [s, s + 0.05],
            h: [0.0, WALL_HEIGHT_M],
            d: [0.0, 0.045],
        };
        self.block(wall, upright, duct, duct);
        plan.cover([s, 0.0, s + 0.05, WALL_HEIGHT_M], 0.03);
        let h = between(rng, 0.55, 0.8);
        let level = Block {
            s: [s0, s1],
            h: [h, h + 0.08],
            d: [0.0, 0.06],
        };
        self.block(wall, level, Skin::Instrument, duct);
        plan.cover([s0, h, s1, h + 0.08], 0.03);
        for _ in 0..7 {
            let (w, tall) = (between(rng, 0.12, 0.36), between(rng, 0.12, 0.42));
            let (left, low) = (between(rng, s0, s1 - w), between(rng, 0.25, 1.55 - tall));
            let deep = between(rng, 0.06, 0.2);
            let bounds = [left, low, left + w, low + tall];
            if !plan.is_free(bounds) {
                continue;
            }
            let housing = Block {
                s: [left, left + w],
                h: [low, low + tall],
                d: [0.0, deep],
            };
            let tone = between(rng, 0.3, 0.8);
            self.block(wall, housing, Skin::Instrument, Skin::Worn { tone });
            plan.cover(bounds, 0.05);
        }
    }
}
