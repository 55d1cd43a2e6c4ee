//! The wall run, 38 poses and 1000 landmarks: the whole adjustment, one iteration of it, and the covariance.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use mono_geometry::RobustLoss;
use mono_geometry::bundle::{BundlePose, Options, Problem, adjust, covariance};

#[path = "../tests/it/common/wall_run.rs"]
mod wall_run;

use wall_run::WallRun;

fn benches(criterion: &mut Criterion) {
    let run = WallRun::full(1);
    bench(criterion, "planar", &wall_run::planar(&run).problem);
    bench(criterion, "spatial", &wall_run::spatial(&run).problem);
}

fn bench<P: BundlePose<D>, const D: usize>(
    criterion: &mut Criterion,
    kind: &str,
    problem: &Problem<P, D>,
) {
    let mut group = criterion.benchmark_group(format!("wall_run_{kind}"));
    group.sample_size(20);
    for (name, loss) in [
        ("adjust", RobustLoss::None),
        ("adjust_huber", RobustLoss::Huber { threshold: 2.0 }),
    ] {
        let options = Options {
            loss,
            ..Options::default()
        };
        group.bench_function(name, |b| b.iter(|| adjust(black_box(problem), &options)));
    }
    // With one iteration allowed: set-up, two costs, two linearisations, one solution.
    let once = Options {
        max_iterations: 1,
        ..Options::default()
    };
    group.bench_function("adjust_one_iteration", |b| {
        b.iter(|| adjust(black_box(problem), &once));
    });
    group.bench_function("covariance", |b| {
        b.iter(|| covariance(black_box(problem), &RobustLoss::None));
    });
    group.finish();
}

criterion_group!(bundle, benches);
criterion_main!(bundle);
