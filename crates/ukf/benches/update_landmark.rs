//! The landmark update of the frame loop, a pinhole camera and a 3-D point, and a pose prediction.

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use std::hint::black_box;
use ukf::{Manifold, Se2, SigmaPoints, Ukf, unscented_update};

fn project(point: &Vector3<f64>) -> Vector2<f64> {
    Vector2::new(
        368.8 * point.x / point.z + 159.7,
        369.9 * point.y / point.z + 121.5,
    )
}

fn benches(criterion: &mut Criterion) {
    let mean = Vector3::new(0.2, -0.1, 2.0);
    let covariance = Matrix3::new(0.01, 0.0, 0.002, 0.0, 0.01, -0.001, 0.002, -0.001, 0.04);
    let (noise, measured) = (Matrix2::identity() * 0.25, Vector2::new(197.5, 103.0));
    criterion.bench_function("landmark update, 3 by 2", |bencher| {
        bencher.iter(|| {
            unscented_update(
                black_box(&mean),
                &covariance,
                black_box(&measured),
                &noise,
                project,
            )
        });
    });

    let step = Vector3::new(0.1, 0.0, 0.02);
    let filter = Ukf::new(Se2::new(1.0, 2.0, 3.0), covariance, SigmaPoints::default());
    let filter = filter.expect("the covariance is positive definite");
    criterion.bench_function("pose prediction, SE(2)", |bencher| {
        bencher.iter(|| {
            let mut moved = black_box(filter);
            moved
                .predict(&(Matrix3::identity() * 1e-4), |pose| pose.retract(&step))
                .map(|()| moved)
        });
    });
}

criterion_group!(landmark, benches);
criterion_main!(landmark);
