//! Time of `check_motion` on a drive of forty frames.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use mono_geometry::motion::OdometrySample;
use mono_geometry::{Mount, Pinhole};
use motion_consistency::{FramePair, check_motion};
use nalgebra::Vector2;

fn drive() -> (Vec<FramePair>, Vec<OdometrySample>, Pinhole) {
    let camera = Pinhole {
        width: 640,
        height: 480,
        fx: 500.0,
        fy: 500.0,
        cx: 319.5,
        cy: 239.5,
    };
    // A camera that drives 0.2 m ahead between two frames: points at 3 to 9 m move away from the centre.
    let matches: Vec<[Vector2<f64>; 2]> = (0..150)
        .map(|i| {
            let depth = 3.0 + f64::from(i % 7);
            let from = Vector2::new(
                f64::from(i * 37 % 600) - 300.0,
                f64::from(i * 53 % 440) - 220.0,
            );
            let centre = Vector2::new(319.5, 239.5);
            [from + centre, from * (depth / (depth - 0.2)) + centre]
        })
        .collect();
    let pairs = (0..40)
        .map(|k| FramePair {
            from_s: 0.5 * f64::from(k),
            to_s: 0.5 * f64::from(k + 1),
            matches: matches.clone(),
        })
        .collect();
    let odometry = vec![OdometrySample {
        t_s: 0.0,
        v_mps: 0.4,
        omega_radps: 0.0,
    }];
    (pairs, odometry, camera)
}

fn bench(criterion: &mut Criterion) {
    let (pairs, odometry, camera) = drive();
    let mount = Mount::forward();
    criterion.bench_function("check_motion, 40 pairs of 150 matches", |bencher| {
        bencher.iter(|| check_motion(black_box(&pairs), black_box(&odometry), &camera, &mount));
    });
}

criterion_group!(benches, bench);
criterion_main!(benches);
