//! Time of finding the best level: small enough to be asked wherever an index or a detector is made.

use criterion::{Criterion, criterion_group, criterion_main};
use simd_level::SimdLevel;

fn best(criterion: &mut Criterion) {
    criterion.bench_function("best", |b| b.iter(SimdLevel::best));
}

criterion_group!(benches, best);
criterion_main!(benches);
