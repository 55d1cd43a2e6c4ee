//! Bytes that nobody meant as a log, and genuine ones that were cut or changed: an error or a shorter log, never a panic.

use std::path::Path;
use std::sync::LazyLock;

use proptest::prelude::*;
use robot_logs::{Message, RobotLog};

use crate::writer::{Packing, bag, mcap, twist_stamped};

/// A small log of each kind.
static LOGS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let topics = &[
        ("/twist", "geometry_msgs/TwistStamped"),
        ("/joints", "sensor_msgs/JointState"),
        ("/tf", "tf2_msgs/msg/TFMessage"),
        ("/image", "sensor_msgs/Image"),
        ("/info", "sensor_msgs/msg/CameraInfo"),
    ];
    let messages = |ros1| -> Vec<_> {
        (0..20_i32)
            .map(|k| {
                let topic = topics[usize::try_from(k % 5).unwrap()].0;
                let time_ns = 1_000_000 * i64::from(k);
                (topic, time_ns, twist_stamped(ros1, time_ns, f64::from(k)))
            })
            .collect()
    };
    let database = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/logs/unfinished.db3");
    vec![
        bag(topics, &messages(true), Packing::None, 8, true),
        bag(topics, &messages(true), Packing::Lz4, 8, false),
        bag(topics, &messages(true), Packing::Bz2, 8, true),
        mcap(topics, &messages(false), Packing::None, 0, true),
        mcap(topics, &messages(false), Packing::Lz4, 8, false),
        mcap(topics, &messages(false), Packing::Zstd, 8, true),
        std::fs::read(database).unwrap(),
    ]
});

/// Opens a log and reads everything in it.
fn exhaust(bytes: Vec<u8>) {
    let Ok(log) = RobotLog::from_bytes("x", bytes) else {
        return;
    };
    let topics: Vec<usize> = (0..log.topics().len()).collect();
    for handle in log.handles(&topics) {
        let _ = log.stamp_ns(&handle);
        if let Ok(Message::Image(image)) = log.message(&handle) {
            let _ = image.pixels();
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn arbitrary_bytes_behind_a_magic_never_panic(
        kind in 0_usize..4,
        tail in proptest::collection::vec(any::<u8>(), 0..400),
    ) {
        let magic: &[u8] = [
            &b"#ROSBAG V2.0\n"[..],
            b"\x89MCAP0\r\n",
            b"SQLite format 3\0\x02\0\x01\x01\0@  ",
            b"",
        ][kind];
        exhaust([magic, &tail].concat());
    }

    #[test]
    fn cut_and_changed_logs_never_panic(
        kind in 0_usize..7,
        cut in 0.0..1.2_f64,
        changes in proptest::collection::vec((0.0..1.0_f64, any::<u8>()), 0..6),
        lengths in proptest::collection::vec((0.0..1.0_f64, prop::sample::select(vec![0_u32, 1, u32::MAX, 1 << 31])), 0..2),
    ) {
        let mut bytes = LOGS[kind].clone();
        let size = bytes.len() as f64;
        for (place, byte) in changes {
            bytes[(place * size) as usize] = byte;
        }
        for (place, length) in lengths {
            let at = (place * (size - 4.0)) as usize;
            bytes[at..at + 4].copy_from_slice(&length.to_le_bytes());
        }
        bytes.truncate((cut * size) as usize);
        exhaust(bytes);
    }
}

#[test]
fn whole_logs_are_read_to_the_end_by_the_same_walk() {
    for bytes in LOGS.iter() {
        let log = RobotLog::from_bytes("x", bytes.clone()).unwrap();
        let twists = log
            .handles(&(0..5).collect::<Vec<_>>())
            .filter(|handle| log.message(handle).is_ok())
            .count();
        assert!(twists >= 4, "{twists}");
        exhaust(bytes.clone());
    }
}
