//! Time of 300 queries for the two nearest, of insertion and of matching, on clustered descriptors.
//!
//! Queries are entries seen again with noise of 10 a component. `scan_<level>` is the exact scan on each level of
//! instructions, as one batch and one by one; `forest` is the approximate forest with its default parameters, whose
//! recall is printed once for each size. All run on one thread but `match`.

#[path = "../tests/it/scene.rs"]
mod scene;

use criterion::measurement::WallTime;
use criterion::{
    BatchSize, BenchmarkGroup, BenchmarkId, Criterion, criterion_group, criterion_main,
};
use feature_kdtree::{
    Descriptor, DescriptorIndex, ExactScan, Hamming, KdForest, KdForestParams, LinearScan,
    SquaredEuclidean, match_descriptors, match_mutual,
};
use scene::Scene;
use simd_level::SimdLevel;
use std::hint::black_box;

const QUERIES: usize = 300;
const NOISE: f64 = 10.0;

/// Entries of a repetitive scene and queries that see some of them again.
fn data(entries: usize) -> (Vec<Descriptor>, Vec<Descriptor>) {
    let mut scene = Scene::new(1, entries / 25);
    let descriptors = scene.entries(entries);
    let queries = (0..QUERIES)
        .map(|_| {
            let entry = scene.position(entries);
            scene.seen_again(&descriptors[entry], NOISE)
        })
        .collect();
    (descriptors, queries)
}

fn fill(mut index: impl DescriptorIndex, descriptors: &[Descriptor]) -> impl DescriptorIndex {
    for (id, descriptor) in (0..).zip(descriptors) {
        index.insert(id, descriptor).expect("ids are unique");
    }
    index
}

fn forest() -> KdForest {
    KdForest::new(KdForestParams::default()).expect("parameters are in range")
}

fn two_nearest(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("two_nearest_of_300");
    group.sample_size(10);
    for entries in [1_500, 10_000, 100_000] {
        let (descriptors, queries) = data(entries);
        for level in SimdLevel::available() {
            let scan = fill(ExactScan::with_level(level), &descriptors);
            let name = format!("scan_{level}");
            run(&mut group, &name, entries, &scan, &queries);
        }
        let scan = fill(ExactScan::new(), &descriptors);
        let forest = fill(forest(), &descriptors);
        report_recall(entries, &forest, &scan, &queries);
        run(&mut group, "forest", entries, &forest, &queries);
    }
    group.finish();
}

/// The scan of any descriptor: ORB's 256 bits and 64 floats, ten thousand of each.
fn linear_scan(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("linear_scan_of_10000");
    group.sample_size(10);
    let (descriptors, queries) = data(10_000);
    let floats = |d: &Descriptor| -> [f32; 64] { std::array::from_fn(|i| f32::from(d[i])) };
    let bits = |d: &Descriptor| -> [u8; 32] { std::array::from_fn(|i| d[i] ^ d[i + 64]) };
    for level in SimdLevel::available() {
        let mut of_floats = LinearScan::<[f32; 64], SquaredEuclidean>::with_level(level);
        let mut of_bits = LinearScan::<[u8; 32], Hamming>::with_level(level);
        for (id, descriptor) in (0..).zip(&descriptors) {
            of_floats.insert(id, &floats(descriptor)).expect("finite");
            of_bits
                .insert(id, &bits(descriptor))
                .expect("ids are unique");
        }
        let (float, bit) = (floats(&queries[0]), bits(&queries[0]));
        group.bench_function(BenchmarkId::new("floats", level), |b| {
            b.iter(|| of_floats.nearest(black_box(&float), 2));
        });
        group.bench_function(BenchmarkId::new("bits", level), |b| {
            b.iter(|| of_bits.nearest(black_box(&bit), 2));
        });
    }
    group.finish();
}

fn run(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    entries: usize,
    index: &impl DescriptorIndex,
    queries: &[Descriptor],
) {
    let mut found = Vec::new();
    group.bench_function(BenchmarkId::new(format!("{name}/batch"), entries), |b| {
        b.iter(|| index.two_nearest_batch(black_box(queries), &mut found));
    });
    group.bench_function(BenchmarkId::new(format!("{name}/single"), entries), |b| {
        b.iter(|| {
            for query in queries {
                black_box(index.two_nearest(black_box(query)));
            }
        });
    });
}

#[expect(clippy::print_stdout, reason = "the recall belongs beside the times")]
fn report_recall(
    entries: usize,
    index: &impl DescriptorIndex,
    scan: &impl DescriptorIndex,
    queries: &[Descriptor],
) {
    let (mut found, mut truth) = (Vec::new(), Vec::new());
    index.two_nearest_batch(queries, &mut found);
    scan.two_nearest_batch(queries, &mut truth);
    let nearest = |all: &[Option<feature_kdtree::TwoNearest>], i: usize| all[i].map(|n| n.first);
    let first = (0..queries.len()).filter(|&i| nearest(&found, i) == nearest(&truth, i));
    let both = (0..queries.len()).filter(|&i| found[i] == truth[i]);
    let percent = |count: usize| 100.0 * count as f64 / queries.len() as f64;
    println!(
        "{entries} entries: nearest found {:.1} %, both found {:.1} %; bytes an entry {:.1}, scan {:.1}",
        percent(first.count()),
        percent(both.count()),
        index.memory_usage() as f64 / entries as f64,
        scan.memory_usage() as f64 / entries as f64,
    );
}

/// A hundred insertions into a map of 10 000, the map's copy not counted; filtering a map to 300 known entries.
fn growth(criterion: &mut Criterion) {
    let (descriptors, queries) = data(10_100);
    let (present, new) = descriptors.split_at(10_000);
    let mut scan = ExactScan::new();
    let mut full = forest();
    for (id, descriptor) in (0..).zip(present) {
        scan.insert(id, descriptor).expect("ids are unique");
        full.insert(id, descriptor).expect("ids are unique");
    }
    let add = |index: &mut dyn DescriptorIndex| {
        for (id, descriptor) in (10_000..).zip(new) {
            index.insert(id, descriptor).expect("ids are unique");
        }
    };
    let mut group = criterion.benchmark_group("insert_100");
    group.sample_size(20);
    group.bench_function("scan/10000", |b| {
        b.iter_batched_ref(|| scan.clone(), |scan| add(scan), BatchSize::PerIteration);
    });
    group.bench_function("forest/10000", |b| {
        b.iter_batched_ref(|| full.clone(), |full| add(full), BatchSize::PerIteration);
    });
    group.finish();

    let mut group = criterion.benchmark_group("visible_300_of_10000");
    group.sample_size(20);
    let visible: Vec<u32> = (0..300).map(|i| 33 * i).collect();
    let mut found = Vec::new();
    group.bench_function("collected", |b| {
        b.iter(|| {
            let entries = visible.iter().map(|&id| (id, &descriptors[id as usize]));
            let part: ExactScan = entries.collect();
            part.two_nearest_batch(&queries, &mut found);
        });
    });
    group.bench_function("where", |b| {
        b.iter(|| {
            for query in &queries {
                black_box(scan.two_nearest_where(query, &|id| visible.binary_search(&id).is_ok()));
            }
        });
    });
    group.finish();
}

fn matching(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("match");
    group.sample_size(10);
    let (descriptors, queries) = data(1_500);
    let scan = {
        let mut scan = ExactScan::new();
        for (id, descriptor) in (0..).zip(&descriptors) {
            scan.insert(id, descriptor).expect("ids are unique");
        }
        scan
    };
    group.bench_function("map/300_to_1500", |b| {
        b.iter(|| match_descriptors(black_box(&queries), &scan, 0.7));
    });
    group.bench_function("mutual/1500_to_1500", |b| {
        let mut scene = Scene::new(5, 60);
        let other: Vec<Descriptor> = descriptors
            .iter()
            .map(|descriptor| scene.seen_again(descriptor, NOISE))
            .collect();
        b.iter(|| match_mutual(black_box(&other), &descriptors, 0.7));
    });
    group.finish();
}

criterion_group!(benches, two_nearest, linear_scan, growth, matching);
criterion_main!(benches);
