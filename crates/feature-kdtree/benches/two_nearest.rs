//! Time of the two nearest of a query, and recall of the forest, on clustered descriptors.
//!
//! Queries are entries seen again with noise of 10 a component. Recall is printed once for each size: how often the
//! forest's nearest is the scan's, and how often both neighbours are.

#[path = "../tests/support/mod.rs"]
mod support;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use feature_kdtree::{Descriptor, DescriptorIndex, ExactScan, KdForest, KdForestParams};
use std::hint::black_box;
use support::Scene;

const QUERIES: usize = 500;
const NOISE: f64 = 10.0;

fn two_nearest(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("two_nearest");
    group.sample_size(10);
    for entries in [1_500, 10_000, 100_000] {
        let mut scene = Scene::new(1, entries / 25);
        let descriptors = scene.entries(entries);
        let queries: Vec<Descriptor> = (0..QUERIES)
            .map(|_| {
                let entry = scene.position(entries);
                scene.seen_again(&descriptors[entry], NOISE)
            })
            .collect();
        let mut scan = ExactScan::new();
        for (id, descriptor) in (0..).zip(&descriptors) {
            scan.insert(id, descriptor).expect("ids are unique");
        }
        run(&mut group, "scan", entries, &scan, &queries);
        for max_leaves in [16, 32, 64, 128] {
            let params = KdForestParams {
                max_leaves,
                ..KdForestParams::default()
            };
            let mut forest = KdForest::new(params).expect("parameters are in range");
            for (id, descriptor) in (0..).zip(&descriptors) {
                forest.insert(id, descriptor).expect("ids are unique");
            }
            report_recall(entries, max_leaves, &forest, &scan, &queries);
            run(
                &mut group,
                &format!("forest_{max_leaves}"),
                entries,
                &forest,
                &queries,
            );
        }
    }
    group.finish();
}

fn run(
    group: &mut criterion::BenchmarkGroup<'_, criterion::measurement::WallTime>,
    name: &str,
    entries: usize,
    index: &impl DescriptorIndex,
    queries: &[Descriptor],
) {
    let mut next = queries.iter().cycle();
    group.bench_function(BenchmarkId::new(name, entries), |bencher| {
        bencher.iter(|| next.next().map(|query| index.two_nearest(black_box(query))));
    });
}

#[expect(clippy::print_stdout, reason = "the recall belongs beside the times")]
fn report_recall(
    entries: usize,
    max_leaves: usize,
    forest: &KdForest,
    scan: &ExactScan,
    queries: &[Descriptor],
) {
    let mut nearest = 0;
    let mut both = 0;
    for query in queries {
        let (Some(found), Some(truth)) = (forest.two_nearest(query), scan.two_nearest(query))
        else {
            continue;
        };
        nearest += usize::from(found.first == truth.first);
        both += usize::from(found == truth);
    }
    let percent = |count: usize| 100.0 * count as f64 / queries.len() as f64;
    println!(
        "{entries} entries, {max_leaves} leaves: nearest found {:.1} %, both found {:.1} %, {:.1} bytes an entry",
        percent(nearest),
        percent(both),
        forest.memory_usage() as f64 / entries as f64,
    );
}

fn growth(criterion: &mut Criterion) {
    let mut scene = Scene::new(2, 400);
    let descriptors = scene.entries(10_000);
    let mut group = criterion.benchmark_group("insert");
    group.sample_size(10);
    group.bench_function("forest/10000", |bencher| {
        bencher.iter(|| {
            let mut forest =
                KdForest::new(KdForestParams::default()).expect("parameters are in range");
            for (id, descriptor) in (0..).zip(&descriptors) {
                forest.insert(id, descriptor).expect("ids are unique");
            }
            forest.len()
        });
    });
    group.finish();
}

criterion_group!(benches, two_nearest, growth);
criterion_main!(benches);
