//! Skins: what the rectangles of the scene are painted with.
//!
//! Each skin fills a [`Canvas`] from its own random stream. Wall materials
//! (plaster, brick, tiles, boards) are mild; the detail that keypoints live on
//! comes from sheets: printed pages, charts, pictures, signs, maps of shapes.

use super::canvas::Canvas;
use super::draw::{Noise, between, chance, ink_on, letter, pick, text};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// How a rectangle is painted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Skin {
    /// One tone with stains and scratches.
    Worn { tone: f64 },
    /// Wood grain along x.
    Wood { tone: f64 },
    /// Spine of a book: bands and a title.
    Spine,
    /// Cardboard with a printed label and tape.
    Carton,
    /// Front of an instrument: knobs, displays, lettering.
    Instrument,
    /// Door leaf or cabinet front: panels, handle, notes.
    Leaf { tone: f64 },
    /// A sheet of paper or a picture.
    Sheet,
    /// A stretch of bare wall.
    Material(Material),
}

/// What a stretch of wall is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Material {
    /// Painted plaster.
    Plaster,
    /// Bricks, each with a tone of its own.
    Brick,
    /// Glazed tiles with dirty joints.
    Tile,
    /// Upright boards.
    Boards,
}

impl Skin {
    /// Paints a fresh canvas of this size.
    pub(super) fn canvas(self, width_m: f64, height_m: f64, rng: &mut ChaCha8Rng) -> Canvas {
        let mut canvas = Canvas::new(width_m, height_m, 0.5);
        match self {
            Self::Worn { tone } => worn(&mut canvas, rng, tone),
            Self::Wood { tone } => wood(&mut canvas, rng, tone),
            Self::Spine => spine(&mut canvas, rng),
            Self::Carton => carton(&mut canvas, rng),
            Self::Instrument => instrument(&mut canvas, rng),
            Self::Leaf { tone } => leaf(&mut canvas, rng, tone),
            Self::Sheet => sheet(&mut canvas, rng),
            Self::Material(material) => wall(&mut canvas, rng, material),
        }
        canvas
    }
}

fn full(canvas: &Canvas) -> [f64; 4] {
    [0.0, 0.0, canvas.width_m, canvas.height_m]
}

fn worn(canvas: &mut Canvas, rng: &mut ChaCha8Rng, tone: f64) {
    let noise = Noise::new(rng);
    canvas.paint(full(canvas), |x, y, _| {
        Some(tone + 0.035 * noise.octaves(x * 12.0, y * 12.0, 4, 0.6))
    });
    let area = canvas.width_m * canvas.height_m;
    for _ in 0..(area * 20.0).ceil() as usize {
        let a = [
            between(rng, 0.0, canvas.width_m),
            between(rng, 0.0, canvas.height_m),
        ];
        if chance(rng, 0.5) {
            let ink = (tone + between(rng, -0.25, 0.2)).clamp(0.02, 0.98);
            canvas.disc(a[0], a[1], between(rng, 0.003, 0.014), ink);
        } else {
            let b = [
                a[0] + between(rng, -0.08, 0.08),
                a[1] + between(rng, -0.05, 0.05),
            ];
            let ink = (tone + between(rng, -0.2, 0.2)).clamp(0.02, 0.98);
            canvas.stroke(a, b, between(rng, 0.002, 0.005), ink);
        }
    }
}

fn wood(canvas: &mut Canvas, rng: &mut ChaCha8Rng, tone: f64) {
    let noise = Noise::new(rng);
    canvas.paint(full(canvas), |x, y, _| {
        let bend = noise.octaves(x * 2.0, y * 6.0, 2, 0.5);
        Some(tone + 0.04 * noise.octaves(x * 3.0 + 9.0, y * 55.0 + 4.0 * bend, 3, 0.6))
    });
    for _ in 0..(canvas.width_m * canvas.height_m * 6.0).ceil() as usize {
        let (x, y) = (
            between(rng, 0.0, canvas.width_m),
            between(rng, 0.0, canvas.height_m),
        );
        let radius = between(rng, 0.005, 0.02);
        canvas.disc(x, y, radius, tone - 0.22);
        canvas.disc(x, y, radius * 0.5, tone - 0.3);
    }
}

fn spine(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let ground = between(rng, 0.08, 0.92);
    let (w, h) = (canvas.width_m, canvas.height_m);
    worn(canvas, rng, ground);
    for _ in 0..1 + pick(rng, 3) {
        let y = between(rng, 0.02, 0.95) * h;
        let ink = ink_on(rng, ground);
        canvas.rect([0.0, y, w, y + between(rng, 0.008, 0.05)], ink);
    }
    // The title runs downwards: small letters stacked.
    let ink = ink_on(rng, ground);
    let size = (w * 0.6).min(0.03);
    let mut y = between(rng, 0.08, 0.25) * h;
    let end = between(rng, 0.6, 0.9) * h;
    while y + size < end {
        if !chance(rng, 0.12) {
            letter(canvas, rng, [(w - size) / 2.0, y], size, size * 0.9, ink);
        }
        y += size * 1.15;
    }
}

fn carton(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let ground = between(rng, 0.4, 0.68);
    let (w, h) = (canvas.width_m, canvas.height_m);
    worn(canvas, rng, ground);
    if chance(rng, 0.7) {
        let x = between(rng, 0.2, 0.7) * w;
        canvas.rect([x, 0.0, x + 0.05_f64.min(0.3 * w), h], ground + 0.14);
    }
    let label = Skin::Sheet.canvas(between(rng, 0.35, 0.6) * w, between(rng, 0.3, 0.5) * h, rng);
    let (x, y) = (between(rng, 0.05, 0.35) * w, between(rng, 0.1, 0.45) * h);
    let angle = between(rng, -0.06, 0.06);
    canvas.paste(&label, x, y, angle);
    let ink = ink_on(rng, ground);
    text(
        canvas,
        rng,
        [0.08 * w, 0.75 * h, 0.95 * w, 0.97 * h],
        (0.14 * h).min(0.05),
        ink,
    );
}

fn instrument(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let ground = between(rng, 0.15, 0.8);
    let (w, h) = (canvas.width_m, canvas.height_m);
    worn(canvas, rng, ground);
    let screen = [
        0.06 * w,
        0.12 * h,
        between(rng, 0.35, 0.55) * w,
        between(rng, 0.55, 0.85) * h,
    ];
    canvas.rect(
        [
            screen[0] - 0.008,
            screen[1] - 0.008,
            screen[2] + 0.008,
            screen[3] + 0.008,
        ],
        ink_on(rng, ground),
    );
    canvas.rect(screen, 0.12);
    let noise = Noise::new(rng);
    let mut last = [screen[0], (screen[1] + screen[3]) / 2.0];
    for step in 1..24 {
        let x = screen[0] + (screen[2] - screen[0]) * f64::from(step) / 24.0;
        let y = (screen[1] + screen[3]) / 2.0
            + 0.4 * (screen[3] - screen[1]) * noise.octaves(f64::from(step) * 0.4, 0.0, 2, 0.5);
        canvas.stroke(last, [x, y], 0.005, 0.85);
        last = [x, y];
    }
    let pitch = between(rng, 0.035, 0.055);
    let mut y = 0.1 * h + pitch / 2.0;
    while y + pitch / 2.0 < 0.95 * h {
        let mut x = screen[2] + pitch;
        while x + pitch / 2.0 < w {
            let ink = ink_on(rng, ground);
            match pick(rng, 5) {
                0 | 1 => {
                    let radius = pitch * between(rng, 0.22, 0.42);
                    let turn = between(rng, 0.0, 6.3);
                    canvas.disc(x, y, radius, ink);
                    canvas.stroke(
                        [x, y],
                        [x + radius * turn.cos(), y + radius * turn.sin()],
                        0.004,
                        ground,
                    );
                }
                2 => canvas.rect(
                    [
                        x - pitch * 0.35,
                        y - pitch * 0.2,
                        x + pitch * 0.3,
                        y + pitch * 0.25,
                    ],
                    ink,
                ),
                3 => letter(
                    canvas,
                    rng,
                    [x - pitch * 0.3, y - pitch * 0.3],
                    pitch * 0.55,
                    pitch * 0.6,
                    ink,
                ),
                _ => {}
            }
            x += pitch * between(rng, 0.95, 1.3);
        }
        y += pitch * between(rng, 1.0, 1.2);
    }
}

fn leaf(canvas: &mut Canvas, rng: &mut ChaCha8Rng, tone: f64) {
    let (w, h) = (canvas.width_m, canvas.height_m);
    worn(canvas, rng, tone);
    let mut y = 0.06;
    while y < h - 0.2 {
        let bottom = (y + between(rng, 0.25, 0.6)).min(h - 0.05);
        let frame = [0.05, y, w - 0.05, bottom];
        for inset in [0.0, 0.012] {
            let edge = tone - 0.16 + 8.0 * inset;
            canvas.rect(
                [
                    frame[0] + inset,
                    frame[1] + inset,
                    frame[2] - inset,
                    frame[3] - inset,
                ],
                edge,
            );
        }
        let panel = tone + between(rng, -0.05, 0.07);
        let noise = Noise::new(rng);
        canvas.paint(
            [
                frame[0] + 0.02,
                frame[1] + 0.02,
                frame[2] - 0.02,
                frame[3] - 0.02,
            ],
            |x, y, _| Some(panel + 0.04 * noise.octaves(x * 9.0, y * 9.0, 4, 0.6)),
        );
        for _ in 0..1 + pick(rng, 2) {
            stick_on(canvas, rng, frame);
        }
        y = bottom + between(rng, 0.03, 0.07);
    }
    let handle_y = between(rng, 0.4, 0.6) * h;
    canvas.rect([w - 0.04, handle_y, w - 0.015, handle_y + 0.13], 0.12);
    canvas.disc(w - 0.028, handle_y + 0.16, 0.011, 0.85);
}

/// A small note somewhere in a rectangle.
fn stick_on(canvas: &mut Canvas, rng: &mut ChaCha8Rng, [x0, y0, x1, y1]: [f64; 4]) {
    let (w, h) = (x1 - x0, y1 - y0);
    if w.min(h) < 0.03 {
        return;
    }
    let note = Skin::Sheet.canvas(
        between(rng, 0.25, 0.6) * w,
        between(rng, 0.25, 0.6) * h,
        rng,
    );
    let x = between(rng, x0, x1 - note.width_m);
    let y = between(rng, y0, y1 - note.height_m);
    let angle = between(rng, -0.12, 0.12);
    canvas.paste(&note, x, y, angle);
}

fn sheet(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let (w, h) = (canvas.width_m, canvas.height_m);
    let ground = if chance(rng, 0.7) {
        between(rng, 0.72, 0.95)
    } else {
        between(rng, 0.12, 0.5)
    };
    canvas.rect(full(canvas), ground);
    let ink = ink_on(rng, ground);
    let margin = 0.06 * w.min(h);
    let inner = [margin, margin, w - margin, h - margin];
    if w.min(h) < 0.12 {
        let size = between(rng, 0.18, 0.4) * w.min(h);
        return text(canvas, rng, inner, size, ink);
    }
    match pick(rng, 6) {
        0 => page(canvas, rng, inner, ink),
        1 => picture(canvas, rng, inner),
        2 => shapes(canvas, rng, inner, ground),
        3 => chart(canvas, rng, inner, ground),
        4 => table(canvas, rng, inner, ground),
        _ => sign(canvas, rng, inner, ink),
    }
}

fn page(canvas: &mut Canvas, rng: &mut ChaCha8Rng, [x0, y0, x1, y1]: [f64; 4], ink: f64) {
    let (w, h) = (x1 - x0, y1 - y0);
    let title = (0.11 * h).clamp(0.03, 0.08);
    text(canvas, rng, [x0, y0, x1, y0 + 1.5 * title], title, ink);
    let top = y0 + 1.9 * title;
    let split = top + (y1 - top) * between(rng, 0.35, 0.65);
    let middle = x0 + w * between(rng, 0.4, 0.6);
    let figure = Canvas::new(w * 0.4, (y1 - split) * 0.9, 0.9);
    let mut drawn = figure.clone();
    let inner = [0.0, 0.0, figure.width_m, figure.height_m];
    if chance(rng, 0.5) {
        picture(&mut drawn, rng, inner);
    } else {
        shapes(&mut drawn, rng, inner, 0.9);
    }
    let small = between(rng, 0.014, 0.03);
    text(canvas, rng, [x0, top, x1, split - small], small, ink);
    canvas.paste(&drawn, x0, split, 0.0);
    let larger = between(rng, 0.02, 0.04);
    text(canvas, rng, [middle + 0.02, split, x1, y1], larger, ink);
}

fn picture(canvas: &mut Canvas, rng: &mut ChaCha8Rng, bounds: [f64; 4]) {
    let noise = Noise::new(rng);
    let coarse = between(rng, 5.0, 14.0);
    let steps = between(rng, 3.0, 6.0);
    let [x0, y0, x1, y1] = bounds;
    canvas.paint(bounds, |x, y, _| {
        let value = 0.5 + 0.42 * noise.octaves(x * coarse, y * coarse, 5, 0.55);
        let banded = (value * steps).floor() / steps;
        Some((0.6 * banded + 0.4 * value).clamp(0.03, 0.97))
    });
    for _ in 0..2 + pick(rng, 5) {
        let radius = between(rng, 0.01, 0.12) * (x1 - x0).min(y1 - y0);
        let (x, y) = (
            between(rng, x0 + radius, x1 - radius),
            between(rng, y0 + radius, y1 - radius),
        );
        let tone = between(rng, 0.03, 0.97);
        canvas.disc(x, y, radius, tone);
    }
}

fn shapes(canvas: &mut Canvas, rng: &mut ChaCha8Rng, [x0, y0, x1, y1]: [f64; 4], ground: f64) {
    let size = (x1 - x0).min(y1 - y0);
    let count = 6 + ((x1 - x0) * (y1 - y0) * 180.0) as usize;
    for _ in 0..count.min(70) {
        let reach = size * between(rng, 0.02, 0.2).powf(1.15);
        let (x, y) = (
            between(rng, x0 + reach, x1 - reach),
            between(rng, y0 + reach, y1 - reach),
        );
        let tone = if chance(rng, 0.8) {
            ink_on(rng, ground)
        } else {
            between(rng, 0.03, 0.97)
        };
        match pick(rng, 4) {
            0 => canvas.disc(x, y, reach, tone),
            1 => {
                let inner = reach * between(rng, 0.4, 0.8);
                canvas.ring(x, y, inner, reach, tone);
            }
            2 => {
                let start = between(rng, 0.0, 6.3);
                let sides = 3 + pick(rng, 4);
                let corners: Vec<[f64; 2]> = (0..sides)
                    .map(|k| {
                        let angle = start + TAU * k as f64 / sides as f64;
                        let far = reach * between(rng, 0.6, 1.0);
                        [x + far * angle.cos(), y + far * angle.sin()]
                    })
                    .collect();
                canvas.polygon(&corners, tone);
            }
            _ => letter(
                canvas,
                rng,
                [x - 0.6 * reach, y - 0.8 * reach],
                1.2 * reach,
                1.6 * reach,
                tone,
            ),
        }
    }
}

fn chart(canvas: &mut Canvas, rng: &mut ChaCha8Rng, [x0, y0, x1, y1]: [f64; 4], ground: f64) {
    let ink = ink_on(rng, ground);
    let (left, floor) = (x0 + 0.05, y1 - 0.05);
    canvas.stroke([left, y0], [left, floor], 0.006, ink);
    canvas.stroke([left, floor], [x1, floor], 0.006, ink);
    let bars = 3 + pick(rng, 6);
    let pitch = (x1 - left) / bars as f64;
    for bar in 0..bars {
        let x = left + pitch * (bar as f64 + between(rng, 0.1, 0.25));
        let top = floor - (floor - y0) * between(rng, 0.1, 0.8);
        let width = pitch * between(rng, 0.3, 0.7);
        let tone = ink_on(rng, ground);
        canvas.rect([x, top, x + width, floor], tone);
        letter(canvas, rng, [x, floor + 0.008], 0.025, 0.035, ink);
    }
    for _ in 0..1 + pick(rng, 2) {
        let mut last = [left, between(rng, y0, floor)];
        let tone = ink_on(rng, ground);
        for point in 1..=7 {
            let next = [
                left + (x1 - left) * f64::from(point) / 7.0,
                between(rng, y0, floor),
            ];
            canvas.stroke(last, next, 0.007, tone);
            canvas.disc(next[0], next[1], between(rng, 0.008, 0.016), tone);
            last = next;
        }
    }
    text(canvas, rng, [left + 0.02, y0, x1, y0 + 0.06], 0.035, ink);
}

fn table(canvas: &mut Canvas, rng: &mut ChaCha8Rng, [x0, y0, x1, y1]: [f64; 4], ground: f64) {
    let ink = ink_on(rng, ground);
    let mut y = y0;
    while y < y1 - 0.03 {
        let bottom = (y + between(rng, 0.04, 0.11)).min(y1);
        let mut x = x0;
        while x < x1 - 0.03 {
            let right = (x + between(rng, 0.04, 0.14)).min(x1);
            let fill = if chance(rng, 0.35) {
                between(rng, 0.1, 0.95)
            } else {
                ground
            };
            canvas.rect([x, y, right, bottom], ink);
            canvas.rect([x + 0.004, y + 0.004, right - 0.004, bottom - 0.004], fill);
            let mark = ink_on(rng, fill);
            let size = (bottom - y) * between(rng, 0.4, 0.75);
            if chance(rng, 0.8) {
                text(
                    canvas,
                    rng,
                    [x + 0.008, y + 0.008, right - 0.006, bottom - 0.004],
                    size,
                    mark,
                );
            }
            x = right;
        }
        y = bottom;
    }
}

fn sign(canvas: &mut Canvas, rng: &mut ChaCha8Rng, [x0, y0, x1, y1]: [f64; 4], ink: f64) {
    let large = (y1 - y0) * between(rng, 0.2, 0.38);
    text(canvas, rng, [x0, y0, x1, y0 + 1.2 * large], large, ink);
    let medium = large * between(rng, 0.35, 0.6);
    text(canvas, rng, [x0, y0 + 1.4 * large, x1, y1], medium, ink);
}

fn wall(canvas: &mut Canvas, rng: &mut ChaCha8Rng, material: Material) {
    let tone = between(rng, 0.55, 0.8);
    let (w, h) = (canvas.width_m, canvas.height_m);
    match material {
        Material::Plaster => worn(canvas, rng, tone),
        Material::Brick => {
            let (noise, grain) = (Noise::new(rng), Noise::new(rng));
            let base = tone - 0.2;
            canvas.paint(full(canvas), |x, y, _| {
                let course = (y / 0.075).floor();
                let shifted =
                    x + 0.125 * course.rem_euclid(2.0) + 0.02 * noise.node(course as i64, 7);
                let brick = (shifted / 0.25).floor();
                let edge_x = shifted - 0.25 * brick + 0.004 * grain.at(x * 40.0, y * 40.0);
                let edge_y = y - 0.075 * course + 0.004 * grain.at(x * 40.0 + 50.0, y * 40.0);
                let joint = edge_x < 0.012 || edge_y < 0.012;
                let own = 0.17 * noise.node(brick as i64, course as i64);
                let rough = 0.04 * grain.octaves(x * 30.0, y * 30.0, 4, 0.7);
                Some(if joint { base + 0.22 } else { base + own } + rough)
            });
        }
        Material::Tile => {
            let (noise, grain) = (Noise::new(rng), Noise::new(rng));
            canvas.paint(full(canvas), |x, y, _| {
                let (column, row) = ((x / 0.15).floor(), (y / 0.15).floor());
                let joint = x - 0.15 * column < 0.006 || y - 0.15 * row < 0.006;
                let own = 0.12 * noise.node(column as i64, row as i64);
                let dirt = 0.03 * grain.octaves(x * 8.0, y * 8.0, 5, 0.65);
                Some(if joint { tone - 0.3 } else { tone + own } + dirt)
            });
        }
        Material::Boards => {
            let mut x = 0.0;
            while x < w {
                let width = between(rng, 0.08, 0.16);
                let board = Skin::Wood {
                    tone: tone + between(rng, -0.2, 0.05),
                }
                .canvas(h, width, rng);
                // Grain runs along the board: turned upright about its centre.
                canvas.paste(
                    &board,
                    x + (width - h) / 2.0,
                    (h - width) / 2.0,
                    std::f64::consts::FRAC_PI_2,
                );
                canvas.rect([x, 0.0, x + 0.005, h], 0.15);
                x += width;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn every_skin_paints_any_size_with_contrast() {
        let skins = [
            Skin::Worn { tone: 0.5 },
            Skin::Wood { tone: 0.5 },
            Skin::Spine,
            Skin::Carton,
            Skin::Instrument,
            Skin::Leaf { tone: 0.6 },
            Skin::Sheet,
            Skin::Material(Material::Plaster),
            Skin::Material(Material::Brick),
            Skin::Material(Material::Tile),
            Skin::Material(Material::Boards),
        ];
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for skin in skins {
            for (w, h) in [(0.5, 0.4), (0.02, 0.3), (0.3, 0.02)] {
                let done = skin.canvas(w, h, &mut rng).finish();
                let tones = (0..400).map(|k| {
                    done.sample(w * f64::from(k % 20) / 20.0, h * f64::from(k / 20) / 20.0)
                });
                let (low, high) =
                    tones.fold((255.0_f32, 0.0_f32), |(l, u), t| (l.min(t), u.max(t)));
                assert!(high > low, "{skin:?} {w} {h} is blank");
            }
        }
    }
}
