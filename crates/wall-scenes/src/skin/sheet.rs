//! Sheets of paper: the detail that keypoints live on.
//!
//! A sheet is one of six kinds: a printed page, a picture, a collection of shapes, a chart, a table or a sign. Small
//! sheets carry text only.

use super::canvas::Canvas;
use super::draw::{Noise, between, chance, ink_on, letter, pick, text};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// A sheet of this size, metres.
pub(super) fn sheet_canvas(width_m: f64, height_m: f64, rng: &mut ChaCha8Rng) -> Canvas {
    let mut canvas = Canvas::new(width_m, height_m, 0.5);
    sheet(&mut canvas, rng);
    canvas
}

/// Six sheets on one board, two by three.
pub(super) fn poster(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    canvas.rect(canvas.bounds(), 0.9);
    let (width, height) = (canvas.width_m / 2.0, canvas.height_m / 3.0);
    for cell in 0..6_u8 {
        let part = sheet_canvas(0.94 * width, 0.94 * height, rng);
        let (column, row) = (f64::from(cell % 2), f64::from(cell / 2));
        canvas.paste(&part, (column + 0.03) * width, (row + 0.03) * height, 0.0);
    }
}

/// Paints one of the kinds of sheet, drawn at random.
pub(super) fn sheet(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let (w, h) = (canvas.width_m, canvas.height_m);
    let ground = if chance(rng, 0.7) {
        between(rng, 0.72, 0.95)
    } else {
        between(rng, 0.12, 0.5)
    };
    canvas.rect(canvas.bounds(), ground);
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
