//! What a particle set costs: copying shared maps, updating a few landmarks, choosing ancestors.

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use rbpf_core::{CowMap, Purpose, Resampler, Streams};
use std::hint::black_box;

/// The size of a landmark: mean, covariance, bookkeeping.
type Landmark = [f64; 14];

fn benches(criterion: &mut Criterion) {
    for landmarks in [1_000, 100_000] {
        let map: CowMap<Landmark> = (0..landmarks).map(|id| (id, [0.0; 14])).collect();
        criterion.bench_function(
            &format!("copy a map of {landmarks} to 100 particles"),
            |bencher| {
                bencher.iter(|| vec![black_box(&map).clone(); 100]);
            },
        );
        criterion.bench_function(
            &format!("write 100 of {landmarks} shared landmarks"),
            |bencher| {
                bencher.iter_batched(
                    || map.clone(),
                    |mut copy| {
                        for id in 0..100 {
                            if let Some(landmark) = copy.get_mut(id) {
                                landmark[0] += 1.0;
                            }
                        }
                        copy
                    },
                    BatchSize::SmallInput,
                );
            },
        );
    }
    let log_weights: Vec<f64> = (0..1000).map(|i| -f64::from(i % 37)).collect();
    let streams = Streams::new(1);
    criterion.bench_function("systematic resampling of 1000", |bencher| {
        bencher.iter(|| {
            let mut rng = streams.shared(0, Purpose::Resampling);
            Resampler::Systematic.resample(black_box(&log_weights), 1000, &mut rng)
        });
    });
}

criterion_group!(set, benches);
criterion_main!(set);
