//! Messages per second out of logs made in memory: ten thousand velocities.

#![expect(clippy::unwrap_used, reason = "a bench that fails is seen")]

#[path = "../tests/it/writer.rs"]
mod writer;

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use robot_logs::RobotLog;
use writer::{Packing, bag, mcap, twist_stamped};

fn read_all(log: &RobotLog) -> usize {
    log.handles(&[0])
        .filter(|handle| log.message(black_box(handle)).is_ok())
        .count()
}

fn velocities(c: &mut Criterion) {
    let topics = &[("/twist", "geometry_msgs/TwistStamped")];
    let messages = |ros1| -> Vec<_> {
        (0..10_000_i32)
            .map(|k| {
                let time_ns = 10_000_000 * i64::from(k);
                (
                    "/twist",
                    time_ns,
                    twist_stamped(ros1, time_ns, f64::from(k)),
                )
            })
            .collect()
    };
    let logs = [
        (
            "bag, plain",
            bag(topics, &messages(true), Packing::None, 1000, true),
        ),
        (
            "bag, lz4",
            bag(topics, &messages(true), Packing::Lz4, 1000, true),
        ),
        (
            "bag, bz2",
            bag(topics, &messages(true), Packing::Bz2, 1000, true),
        ),
        (
            "MCAP, plain",
            mcap(topics, &messages(false), Packing::None, 1000, true),
        ),
        (
            "MCAP, lz4",
            mcap(topics, &messages(false), Packing::Lz4, 1000, true),
        ),
        (
            "MCAP, zstd",
            mcap(topics, &messages(false), Packing::Zstd, 1000, true),
        ),
    ];
    let mut group = c.benchmark_group("open and decode 10000 velocities");
    group.throughput(Throughput::Elements(10_000));
    for (name, bytes) in logs {
        group.bench_function(name, |b| {
            b.iter(|| read_all(&RobotLog::from_bytes("bench", bytes.clone()).unwrap()));
        });
    }
    group.finish();
}

criterion_group!(benches, velocities);
criterion_main!(benches);
