//! A prediction and an update: 3 states with 2 measurements (a robot and a beacon), 15 with 6 (an inertial
//! navigation's error state), plain and square-root.

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{SMatrix, SVector};
use std::hint::black_box;
use ukf::{CholeskyFactor, SigmaPoints, SquareRootUkf, Ukf};

/// Each state drifts with the next one's sine: every entry of the covariance fills.
fn drift<const L: usize>(x: &SVector<f64, L>) -> SVector<f64, L> {
    SVector::from_fn(|k, _| x[k] + 0.1 * x[(k + 1) % L].sin())
}

/// Distances from the origin of neighbouring pairs.
fn see<const L: usize, const M: usize>(x: &SVector<f64, L>) -> SVector<f64, M> {
    SVector::from_fn(|k, _| x[k].hypot(1.0 + x[(k + 1) % L]))
}

fn step<const L: usize, const M: usize>(
    criterion: &mut Criterion,
) -> Result<(), Box<dyn std::error::Error>> {
    let q = SMatrix::<f64, L, L>::from_fn(|i, j| if i == j { 0.01 } else { 0.001 });
    let r = SMatrix::<f64, M, M>::from_fn(|i, j| if i == j { 0.1 } else { 0.01 });
    let start = SVector::<f64, L>::from_fn(|k, _| 0.1 * k as f64);
    let z = see::<L, M>(&start);
    let mut plain = Ukf::new(start, SMatrix::identity(), SigmaPoints::default())?;
    let root = CholeskyFactor::definite(&SMatrix::identity())?;
    let mut square_root = SquareRootUkf::new(start, root, SigmaPoints::default())?;
    let q_root = CholeskyFactor::definite(&q)?;
    let r_root = CholeskyFactor::definite(&r)?;

    criterion.bench_function(&format!("plain {L} states {M} measurements"), |bencher| {
        bencher.iter(|| {
            let told = plain
                .predict(&q, drift)
                .and_then(|()| plain.update(black_box(&z), &r, see));
            black_box(told.map(|told| told.nis))
        });
    });
    criterion.bench_function(
        &format!("square-root {L} states {M} measurements"),
        |bencher| {
            bencher.iter(|| {
                let told = square_root
                    .predict(&q_root, drift)
                    .and_then(|()| square_root.update(black_box(&z), &r_root, see));
                black_box(told.map(|told| told.nis))
            });
        },
    );
    Ok(())
}

fn steps(criterion: &mut Criterion) {
    let outcome = step::<3, 2>(criterion).and_then(|()| step::<15, 6>(criterion));
    assert!(outcome.is_ok(), "{outcome:?}");
}

criterion_group!(benches, steps);
criterion_main!(benches);
