//! Time of one frame's evolution of 100 genomes in three dimensions, with a fitness of one and of a hundred terms.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use es_evolve::{MoveParams, PaperParams, Space, StepFactors, evolve_paper, resample_move};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

struct Flat;

impl Space<3> for Flat {
    type Genome = [f64; 3];
    fn retract(&self, at: &[f64; 3], step: &[f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| at[i] + step[i])
    }
    fn local(&self, from: &[f64; 3], to: &[f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| to[i] - from[i])
    }
}

const FACTOR: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.2, 1.0, 0.0], [0.0, 0.1, 1.0]];

fn stream(step: usize, slot: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    rng.set_stream((step as u64) << 32 | slot as u64);
    rng
}

fn evolve_population(criterion: &mut Criterion) {
    let start: Vec<[f64; 3]> = (0..100).map(|i| [0.01 * f64::from(i), 0.0, 0.0]).collect();
    let mut group = criterion.benchmark_group("evolve_population");
    for terms in [1_u32, 100] {
        let fitness = move |_: usize, x: &[f64; 3]| -> f64 {
            (0..terms)
                .map(|k| -0.5 * (x[0] - f64::from(k) * x[1].cos() + x[2]).powi(2))
                .sum()
        };
        group.bench_function(BenchmarkId::new("resample_move", terms), |bencher| {
            bencher.iter(|| {
                let mut population = start.clone();
                let factors = StepFactors::Common(&FACTOR);
                let params = MoveParams::default();
                resample_move(&Flat, &mut population, &fitness, factors, &params, &stream)
            });
        });
        group.bench_function(BenchmarkId::new("paper", terms), |bencher| {
            bencher.iter(|| {
                let mut population = start.clone();
                let factors = StepFactors::Common(&FACTOR);
                let params = PaperParams::default();
                evolve_paper(&Flat, &mut population, &fitness, factors, &params, &stream)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, evolve_population);
criterion_main!(benches);
