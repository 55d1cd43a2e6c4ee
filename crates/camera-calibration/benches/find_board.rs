//! Time of the search for a board in an image of 640 x 480 pixels, with the board and without.

use std::hint::black_box;

use camera_calibration::{BoardSize, GreyView, find_board};
use criterion::{Criterion, criterion_group, criterion_main};

const SIZE: BoardSize = BoardSize {
    columns: 9,
    rows: 6,
};

/// Squares of 40 px with blurred edges, as a camera straight ahead would see them.
fn board() -> Vec<u8> {
    let wave = |x: f64| (20.0 * (x * std::f64::consts::PI / 40.0).sin()).clamp(-1.0, 1.0);
    (0..640 * 480)
        .map(|k| {
            let (x, y) = (f64::from(k % 640) - 120.0, f64::from(k / 640) - 100.0);
            let inside = (-40.0..=360.0).contains(&x) && (-40.0..=240.0).contains(&y);
            let level = if inside { wave(x) * wave(y) } else { 1.0 };
            (128.0 + 90.0 * level) as u8
        })
        .collect()
}

fn search(c: &mut Criterion) {
    for (name, pixels) in [("board", board()), ("grey wall", vec![128; 640 * 480])] {
        let view = GreyView {
            width: 640,
            height: 480,
            pixels: &pixels,
        };
        c.bench_function(&format!("640 x 480, {name}"), |b| {
            b.iter(|| find_board(black_box(view), SIZE));
        });
    }
}

criterion_group!(benches, search);
criterion_main!(benches);
