//! Time of the whole chain, from files to a record, over the rendered sequence of the fixtures.

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use mono_slam::run::run_sequence;
use slam_io::Sequence;
use slam_pipeline::config::Config;

fn fixture(c: &mut Criterion) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/wall");
    let (Ok(sequence), Ok(config)) = (Sequence::open(&folder), Config::default().check()) else {
        return;
    };
    c.bench_function("rendered wall, default configuration", |b| {
        b.iter(|| run_sequence(black_box(&sequence), &config, &|| 0.0, &mut |_| {}));
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = fixture
}
criterion_main!(benches);
