//! Time to draw a line of a hundred thousand points and two thousand marks.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use slam_report::{Colour, Layer, Plot};

fn draw(c: &mut Criterion) {
    let mut plot = Plot::new("walk", "x", "y");
    let walk = |k: u32| {
        let x = f64::from(k);
        (x, (0.001 * x).sin() + 0.1 * (0.37 * x).sin())
    };
    plot.layers.push(Layer::line(
        "line",
        Colour::Blue,
        (0..100_000).map(walk).collect(),
    ));
    plot.layers.push(Layer::Dots {
        label: "marks".into(),
        colour: Colour::Green,
        radius: 2.0,
        points: (0..2000).map(walk).collect(),
    });
    c.bench_function("line of 100000 points, 2000 dots", |b| {
        b.iter(|| black_box(&plot).to_svg());
    });
}

criterion_group!(benches, draw);
criterion_main!(benches);
