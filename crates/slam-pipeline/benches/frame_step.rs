//! Time of one frame of the exact filter, after detection: a keyframe with resampling open, and a frame between.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use slam_pipeline::Slam;

#[expect(
    dead_code,
    clippy::unwrap_used,
    reason = "shared with the tests, which use all of it"
)]
#[path = "../tests/it/drive.rs"]
mod drive;

use drive::{Drive, config, rig};

/// Frames driven before the one that is timed.
const BEFORE: usize = 12;

fn frame(criterion: &mut Criterion) {
    let drive = Drive::new(1);
    for particles in [10, 50] {
        let mut slam = Slam::new(rig(), &config(particles, 1)).expect("a valid configuration");
        for i in 0..BEFORE {
            slam.step(&drive.input(i), &mut |_| {})
                .expect("an ordinary frame");
        }
        criterion.bench_function(&format!("keyframe_{particles}_particles"), |b| {
            b.iter_batched(
                || slam.clone(),
                |mut slam| slam.step(black_box(&drive.input(BEFORE)), &mut |_| {}),
                BatchSize::SmallInput,
            );
        });
    }
}

criterion_group!(benches, frame);
criterion_main!(benches);
