//! Time of the comparison of two trajectories of ten thousand poses.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use trajectory_eval::{Alignment, StampedPose, absolute_error};

fn absolute(c: &mut Criterion) {
    let path = |offset: f64| -> Vec<StampedPose> {
        (0..10_000)
            .map(|k| {
                let t_s = 0.1 * f64::from(k);
                StampedPose::planar(t_s, t_s.sin() + offset, t_s.cos(), t_s)
            })
            .collect()
    };
    let (estimate, reference) = (path(0.01), path(0.0));
    for alignment in [Alignment::None, Alignment::Se2] {
        c.bench_function(&format!("absolute error, 10000 poses, {alignment}"), |b| {
            b.iter(|| absolute_error(black_box(&estimate), &reference, alignment));
        });
    }
}

criterion_group!(benches, absolute);
criterion_main!(benches);
