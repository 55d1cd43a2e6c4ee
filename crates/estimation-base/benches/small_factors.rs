//! The pieces that run once a landmark or once a particle: factor and solve of small covariances, SE(2) composition and
//! logarithm, a wrapped angle.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use estimation_base::{CholeskyFactor, Manifold, Se2, wrap};
use nalgebra::{SMatrix, SVector};

fn factor_and_solve<const N: usize>(criterion: &mut Criterion) {
    let matrix = SMatrix::<f64, N, N>::from_fn(|i, j| if i == j { 2.0 } else { 0.1 });
    let right = SVector::<f64, N>::from_fn(|i, _| i as f64);
    criterion.bench_function(&format!("factor and solve {N}x{N}"), |bencher| {
        bencher.iter(|| {
            CholeskyFactor::definite(black_box(&matrix)).map(|factor| factor.solve(&right))
        });
    });
}

fn poses(criterion: &mut Criterion) {
    let (a, b) = (Se2::new(1.0, 2.0, 3.0), Se2::new(1.5, 1.8, -3.0));
    criterion.bench_function("SE(2) local and retract", |bencher| {
        bencher.iter(|| a.retract(&black_box(a).local(&black_box(b))));
    });
    criterion.bench_function("wrap", |bencher| bencher.iter(|| wrap(black_box(40.0))));
}

fn factors(criterion: &mut Criterion) {
    factor_and_solve::<2>(criterion);
    factor_and_solve::<3>(criterion);
    factor_and_solve::<6>(criterion);
}

criterion_group!(benches, factors, poses);
criterion_main!(benches);
