//! Time to read a map of ten thousand landmarks.

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::{Matrix3, Vector3};
use slam_io::{RunRecord, read_map, write_run};
use slam_pipeline::MapLandmark;

fn run(landmarks: u32) -> RunRecord {
    RunRecord {
        sequence: "bench".into(),
        warnings: Vec::new(),
        scale: slam_io::RunScale::Metric,
        predicted: Vec::new(),
        frames: Vec::new(),
        smoothed: Vec::new(),
        smoother: None,
        tracks: Vec::new(),
        landmarks: (0..landmarks)
            .map(|id| MapLandmark {
                id,
                position: Vector3::new(f64::from(id), 1.0, 2.0),
                covariance: Matrix3::identity(),
                observations: 3,
                descriptor: Some(Box::new([7; 128])),
            })
            .collect(),
        known_map: None,
        dead_reckoning: Vec::new(),
        reference: None,
        snapshots: Vec::new(),
        configuration: String::new(),
        seed: 1,
        particles: 1,
        method: "exact".into(),
        wall_s: 0.0,
    }
}

fn map(c: &mut Criterion) {
    let folder = std::env::temp_dir().join(format!("slam-io-bench-{}", std::process::id()));
    if write_run(&run(10_000), &folder, &[]).is_err() {
        return;
    }
    c.bench_function("read a map of 10000 landmarks", |b| {
        b.iter(|| read_map(black_box(&folder.join(Path::new("map.slam")))));
    });
    // Leaving a folder behind is no reason to fail.
    drop(std::fs::remove_dir_all(&folder));
}

criterion_group!(benches, map);
criterion_main!(benches);
