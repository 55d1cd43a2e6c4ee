//! Time to resample a set: shared maps against plain vectors, and the choice of the ancestors.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use rbpf_core::{CowMap, Purpose, Resampler, Streams};
use std::hint::black_box;

const PARTICLES: usize = 100;
const UPDATED: u32 = 10;

/// A landmark in the plane, 56 bytes.
#[derive(Clone, Copy)]
struct Landmark {
    _mean: [f64; 2],
    _covariance: [f64; 4],
    existence: f64,
}

fn landmark(id: u32) -> Landmark {
    let angle = f64::from(id % 997) * 0.01;
    Landmark {
        _mean: [5.0 + 3.0 * angle.cos(), 3.0 * angle.sin()],
        _covariance: [0.01, 0.0, 0.0, 0.01],
        existence: 0.0,
    }
}

/// Ids of landmarks in leaves of their own, for every map of at least a thousand.
fn updated() -> impl Iterator<Item = u32> {
    (0..UPDATED).map(|k| k * 97)
}

fn resampling(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("resample 100 maps");
    group.sample_size(10);
    for landmarks in [1_000, 10_000, 100_000] {
        let shared: CowMap<Landmark> = (0..landmarks).map(|id| (id, landmark(id))).collect();
        let plain: Vec<Landmark> = (0..landmarks).map(landmark).collect();
        group.bench_function(BenchmarkId::new("shared", landmarks), |bencher| {
            bencher.iter_with_large_drop(|| vec![black_box(&shared).clone(); PARTICLES]);
        });
        group.bench_function(
            BenchmarkId::new("shared, 10 updates each", landmarks),
            |bencher| {
                bencher.iter_with_large_drop(|| {
                    let mut maps = vec![black_box(&shared).clone(); PARTICLES];
                    for map in &mut maps {
                        for id in updated() {
                            if let Some(landmark) = map.get_mut(id) {
                                landmark.existence += 1.0;
                            }
                        }
                    }
                    maps
                });
            },
        );
        group.bench_function(BenchmarkId::new("plain", landmarks), |bencher| {
            bencher.iter(|| {
                let one = black_box(&plain);
                (0..PARTICLES).map(|_| one.clone()).collect::<Vec<_>>()
            });
        });
    }
    group.finish();
}

fn ancestors(criterion: &mut Criterion) {
    let log_weights: Vec<f64> = (0..1000).map(|i| -f64::from(i % 37)).collect();
    let streams = Streams::new(1);
    criterion.bench_function("systematic resampling of 1000", |bencher| {
        bencher.iter(|| {
            let mut rng = streams.shared(0, Purpose::Resampling);
            Resampler::Systematic.resample(black_box(&log_weights), 1000, &mut rng)
        });
    });
}

criterion_group!(set, resampling, ancestors);
criterion_main!(set);
