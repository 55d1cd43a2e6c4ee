//! Time of a frame against the size of the map: a thousand and a hundred thousand landmarks along one row of shelves.

use std::hint::black_box;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use slam_pipeline::FrameInput;

mod large_map;

use large_map::{driven, frame, map, odometry, rig};

/// Frames driven before the one that is timed.
const BEFORE: usize = 12;

fn map_size(criterion: &mut Criterion) {
    let Some(rig) = rig() else { return };
    for landmarks in [1_000, 100_000] {
        let map = map(&rig, landmarks, usize::MAX);
        let slam = driven(&rig, &map, 30, BEFORE).expect("an ordinary drive");
        let features = frame(&rig, &map, BEFORE);
        let odometry = odometry(BEFORE);
        let input = FrameInput {
            features: &features,
            odometry: &odometry,
        };
        criterion.bench_function(&format!("frame_in_a_map_of_{landmarks}"), |b| {
            b.iter_batched_ref(
                || slam.clone(),
                |slam| slam.step(black_box(&input), &mut |_| {}),
                BatchSize::LargeInput,
            );
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = map_size
}
criterion_main!(benches);
