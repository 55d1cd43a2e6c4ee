//! Time of one frame's evolution of 100 genomes in three dimensions, with a fitness of one and of a hundred terms (500
//! evaluations of the mover), and of a generation of the optimiser on the sphere.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use es_evolve::{
    MoveParams, OptimiseParams, PaperParams, StepAdaptation, StepFactors, evolve_paper, optimise,
    resample_move,
};
use nalgebra::{Matrix3, SVector, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

const FACTOR: Matrix3<f64> = Matrix3::new(1.0, 0.0, 0.0, 0.2, 1.0, 0.0, 0.0, 0.1, 1.0);

fn stream(step: usize, slot: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    rng.set_stream((step as u64) << 32 | slot as u64);
    rng
}

fn evolve_population(criterion: &mut Criterion) {
    let start: Vec<Vector3<f64>> = (0..100)
        .map(|i| Vector3::x() * 0.01 * f64::from(i))
        .collect();
    let mut group = criterion.benchmark_group("evolve_population");
    for terms in [1_u32, 100] {
        let fitness = move |_: usize, x: &Vector3<f64>| -> f64 {
            (0..terms)
                .map(|k| -0.5 * (x[0] - f64::from(k) * x[1].cos() + x[2]).powi(2))
                .sum()
        };
        // The first look and four steps.
        group.throughput(Throughput::Elements(500));
        group.bench_function(BenchmarkId::new("resample_move", terms), |bencher| {
            bencher.iter(|| {
                let mut population = start.clone();
                let factors = StepFactors::Common(&FACTOR);
                let params = MoveParams::default();
                resample_move(&mut population, &fitness, factors, &params, &stream)
            });
        });
        group.bench_function(BenchmarkId::new("paper", terms), |bencher| {
            bencher.iter(|| {
                let mut population = start.clone();
                let factors = StepFactors::Common(&FACTOR);
                let params = PaperParams::default();
                evolve_paper(&mut population, &fitness, factors, &params, &stream)
            });
        });
    }
    group.finish();
}

/// Ten generations of 4 D offspring.
fn sphere<const D: usize>(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group(format!("optimise_sphere_{D}"));
    let fitness = |_: usize, x: &SVector<f64, D>| -x.norm_squared();
    for adaptation in [
        StepAdaptation::Isotropic,
        StepAdaptation::PerCoordinate,
        StepAdaptation::Covariance,
    ] {
        let params = OptimiseParams {
            adaptation,
            max_evaluations: 40 * D,
            ..OptimiseParams::self_adaptive(D)
        };
        group.throughput(Throughput::Elements(params.max_evaluations as u64));
        group.bench_function(format!("{adaptation:?}"), |bencher| {
            bencher.iter(|| {
                optimise(
                    &SVector::repeat(1.0),
                    &SVector::repeat(0.3),
                    &fitness,
                    &params,
                    &stream,
                )
            });
        });
    }
    group.finish();
}

criterion_group!(benches, evolve_population, sphere::<10>, sphere::<100>);
criterion_main!(benches);
