//! Surfaces: worn paint, wood, and the materials of walls.
//!
//! They are mild on purpose; what stands or hangs in front of them carries the contrast.

use super::canvas::Canvas;
use super::draw::{Noise, between, chance};
use rand_chacha::ChaCha8Rng;

/// The material of a stretch of wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Material {
    /// Painted plaster.
    Plaster,
    /// Bricks, each with a tone of its own.
    Brick,
    /// Glazed tiles with dirty joints.
    Tile,
    /// Upright boards.
    Boards,
}

/// One tone with stains and scratches.
pub(super) fn worn(canvas: &mut Canvas, rng: &mut ChaCha8Rng, tone: f64) {
    let noise = Noise::new(rng);
    canvas.paint(canvas.bounds(), |x, y, _| {
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

/// Wood grain along x.
pub(super) fn wood(canvas: &mut Canvas, rng: &mut ChaCha8Rng, tone: f64) {
    let noise = Noise::new(rng);
    canvas.paint(canvas.bounds(), |x, y, _| {
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

/// A stretch of bare wall of one material.
pub(super) fn wall(canvas: &mut Canvas, rng: &mut ChaCha8Rng, material: Material) {
    let tone = between(rng, 0.55, 0.8);
    let (w, h) = (canvas.width_m, canvas.height_m);
    match material {
        Material::Plaster => worn(canvas, rng, tone),
        Material::Brick => {
            let (noise, grain) = (Noise::new(rng), Noise::new(rng));
            let base = tone - 0.2;
            canvas.paint(canvas.bounds(), |x, y, _| {
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
            canvas.paint(canvas.bounds(), |x, y, _| {
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
                let tone = tone + between(rng, -0.2, 0.05);
                let mut board = Canvas::new(h, width, 0.5);
                wood(&mut board, rng, tone);
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
    fn every_material_has_contrast() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for material in [
            Material::Plaster,
            Material::Brick,
            Material::Tile,
            Material::Boards,
        ] {
            let mut canvas = Canvas::new(0.5, 0.4, 0.5);
            wall(&mut canvas, &mut rng, material);
            let done = canvas.finish();
            let tones = (0..400).map(|k| {
                done.sample(
                    0.5 * f64::from(k % 20) / 20.0,
                    0.4 * f64::from(k / 20) / 20.0,
                )
            });
            let (low, high) = tones.fold((255.0_f32, 0.0_f32), |(l, u), t| (l.min(t), u.max(t)));
            assert!(high > low, "{material:?} is blank");
        }
    }
}
