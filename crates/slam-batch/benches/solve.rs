//! Time of a whole solution with its covariance: a room's worth of keyframes, and a long drive.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use slam_batch::solve;

#[expect(
    dead_code,
    clippy::unwrap_used,
    reason = "shared with the tests, which use all of it"
)]
#[path = "../tests/it/simulation.rs"]
mod simulation;

use simulation::{Drive, settings};

fn solution(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("solve");
    group.sample_size(10);
    for (keyframes, points) in [(60, 800), (500, 3500)] {
        let mut settings = settings();
        settings.keyframes = keyframes;
        settings.points = points;
        let problem = Drive::new(&settings, 1).problem;
        let sightings: usize = problem.tracks.iter().map(|t| t.sightings.len()).sum();
        group.bench_function(
            format!("{keyframes}_keyframes_{sightings}_sightings"),
            |b| {
                b.iter(|| solve(black_box(&problem)));
            },
        );
    }
    group.finish();
}

criterion_group!(benches, solution);
criterion_main!(benches);
