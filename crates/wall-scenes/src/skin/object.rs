//! Objects that stand before a wall: books, cartons, instruments, doors.

use super::canvas::Canvas;
use super::draw::{Noise, between, chance, ink_on, letter, pick, text};
use super::sheet::sheet_canvas;
use super::surface::worn;
use rand_chacha::ChaCha8Rng;

/// The spine of a book: bands and a title.
pub(super) fn spine(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
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

/// A carton with a printed label and tape.
pub(super) fn carton(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
    let ground = between(rng, 0.4, 0.68);
    let (w, h) = (canvas.width_m, canvas.height_m);
    worn(canvas, rng, ground);
    if chance(rng, 0.7) {
        let x = between(rng, 0.2, 0.7) * w;
        canvas.rect([x, 0.0, x + 0.05_f64.min(0.3 * w), h], ground + 0.14);
    }
    let label = sheet_canvas(between(rng, 0.35, 0.6) * w, between(rng, 0.3, 0.5) * h, rng);
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

/// The front of an instrument: a display, knobs, lettering.
pub(super) fn instrument(canvas: &mut Canvas, rng: &mut ChaCha8Rng) {
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

/// A door leaf or cabinet front: panels, a handle, notes.
pub(super) fn leaf(canvas: &mut Canvas, rng: &mut ChaCha8Rng, tone: f64) {
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
    let note = sheet_canvas(
        between(rng, 0.25, 0.6) * w,
        between(rng, 0.25, 0.6) * h,
        rng,
    );
    let x = between(rng, x0, x1 - note.width_m);
    let y = between(rng, y0, y1 - note.height_m);
    let angle = between(rng, -0.12, 0.12);
    canvas.paste(&note, x, y, angle);
}
