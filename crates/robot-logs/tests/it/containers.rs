//! Every container and compression gives back the messages that were written, also without its index.

use std::fs;
use std::path::PathBuf;

use robot_logs::{LogError, LogFormat, Message, MessageKind, RobotLog};

use crate::writer::{Packing, Topics, Written, bag, mcap, twist_stamped};

const TOPICS: Topics<'static> = &[
    ("/twist", "geometry_msgs/TwistStamped"),
    ("/other", "my_msgs/Unknown"),
    ("/late", "geometry_msgs/msg/TwistStamped"),
];

/// 40 messages: three topics in turn; `/late` is written later than its times say.
fn messages(ros1: bool) -> Vec<Written<'static>> {
    (0..40_i32)
        .map(|k| {
            let topic = TOPICS[usize::try_from(k % 3).unwrap()].0;
            let late = if topic == "/late" { 15_000_000 } else { 0 };
            let time_ns = 1_700_000_000_000_000_000 + 10_000_000 * i64::from(k) - late;
            (
                topic,
                time_ns,
                twist_stamped(ros1, time_ns - 1000, f64::from(k)),
            )
        })
        .collect()
}

/// All speeds of two topics in the order of the log times, and that the times rise.
fn speeds(log: &RobotLog) -> Vec<f64> {
    let handles: Vec<_> = log.handles(&[0, 1, 2]).collect();
    assert!(handles.is_sorted_by_key(|handle| handle.log_time_ns()));
    let speeds = handles.iter().map(|handle| {
        assert_eq!(
            log.stamp_ns(handle).unwrap(),
            Some(handle.log_time_ns() - 1000)
        );
        match log.message(handle).unwrap() {
            Message::Twist(twist) => {
                assert_eq!(twist.header.frame_id, "base");
                assert_eq!(twist.twist.angular[2], -0.5 * twist.twist.linear[0]);
                twist.twist.linear[0]
            }
            other => panic!("{other:?}"),
        }
    });
    speeds.collect()
}

/// The speeds of `messages` in the order of their times.
fn expected() -> Vec<f64> {
    let mut written: Vec<(i64, f64)> = messages(true)
        .iter()
        .enumerate()
        .filter(|(_, message)| message.0 != "/other")
        .map(|(k, message)| (message.1, k as f64))
        .collect();
    written.sort_by_key(|(time_ns, _)| *time_ns);
    written.iter().map(|(_, speed)| *speed).collect()
}

#[test]
fn every_container_and_compression_gives_back_what_was_written() {
    let wanted = expected();
    assert_eq!(wanted.len(), 27);
    for (packing, indexed, per_chunk) in [
        (Packing::None, true, 7),
        (Packing::None, false, 7),
        (Packing::Lz4, true, 7),
        (Packing::Lz4, false, 1),
        (Packing::Bz2, true, 40),
        (Packing::Bz2, false, 7),
    ] {
        let bytes = bag(TOPICS, &messages(true), packing, per_chunk, indexed);
        let log = RobotLog::from_bytes("test.bag", bytes).unwrap();
        assert_eq!(
            speeds(&log),
            wanted,
            "bag, {packing:?}, {indexed}, {per_chunk}"
        );
        assert_eq!(log.format(), LogFormat::Rosbag1);
        assert_eq!(log.notes(), [""; 0]);
    }
    for (packing, indexed, per_chunk) in [
        (Packing::None, true, 0),
        (Packing::None, true, 7),
        (Packing::None, false, 7),
        (Packing::Lz4, true, 7),
        (Packing::Zstd, true, 7),
        (Packing::Zstd, false, 40),
    ] {
        let bytes = mcap(TOPICS, &messages(false), packing, per_chunk, indexed);
        let log = RobotLog::from_bytes("test.mcap", bytes).unwrap();
        assert_eq!(
            speeds(&log),
            wanted,
            "MCAP, {packing:?}, {indexed}, {per_chunk}"
        );
        assert_eq!(log.format(), LogFormat::Mcap);
        assert_eq!(log.notes(), [""; 0]);
    }
}

#[test]
fn topics_have_counts_times_and_the_types_that_are_read() {
    let bytes = mcap(TOPICS, &messages(false), Packing::Lz4, 7, true);
    let log = RobotLog::from_bytes("test.mcap", bytes).unwrap();
    let found: Vec<_> = log
        .topics()
        .iter()
        .map(|topic| (topic.name.as_str(), topic.messages, topic.kind))
        .collect();
    let kind = Some(MessageKind::TwistStamped);
    assert_eq!(
        found,
        [
            ("/twist", 14, kind),
            ("/other", 13, None),
            ("/late", 13, kind)
        ]
    );
    let first = &log.topics()[0];
    assert_eq!(first.first_ns, 1_700_000_000_000_000_000);
    assert_eq!(first.last_ns - first.first_ns, 390_000_000);
}

#[test]
fn a_log_that_is_cut_is_read_up_to_the_cut_and_says_so() {
    let whole = bag(TOPICS, &messages(true), Packing::Lz4, 10, true);
    let log = RobotLog::from_bytes("cut.bag", whole[..whole.len() - 500].to_vec()).unwrap();
    let read: usize = log.topics().iter().map(|topic| topic.messages).sum();
    assert!((10..40).contains(&read), "{read}");
    assert_eq!(log.notes().len(), 1);
    let note = &log.notes()[0];
    assert!(
        note.starts_with("cut.bag, byte ") && note.contains("`rosbag reindex`"),
        "{note}"
    );

    let whole = mcap(TOPICS, &messages(false), Packing::Zstd, 10, true);
    let log = RobotLog::from_bytes("cut.mcap", whole[..whole.len() - 30].to_vec()).unwrap();
    assert_eq!(speeds(&log), expected(), "only the end record is missing");
    let note = &log.notes()[0];
    assert!(note.contains("`mcap recover`"), "{note}");

    let nothing = RobotLog::from_bytes("cut.mcap", whole[..200].to_vec()).unwrap_err();
    let text = nothing.to_string();
    assert!(
        text.starts_with("cut.mcap: expected a log with messages, found none that can be read"),
        "{text}"
    );
}

#[test]
fn the_chunk_that_a_killed_recorder_was_filling_is_read() {
    // Its header still has length zero, so its records follow as records of the file.
    let one = bag(TOPICS, &messages(true)[..6], Packing::None, 6, false);
    let at = one.windows(5).position(|five| five == b"size=").unwrap();
    let size = u32::from_le_bytes(one[at + 5..at + 9].try_into().unwrap());
    let mut killed = one;
    killed[at + 5..at + 13].fill(0);
    assert!(size > 0);
    let log = RobotLog::from_bytes("killed.bag", killed).unwrap();
    assert_eq!(log.handles(&[0, 2]).count(), 4);
    let handle = log.handles(&[0]).next().unwrap();
    assert!(matches!(log.message(&handle), Ok(Message::Twist(_))));
}

#[test]
fn a_changed_byte_of_a_chunk_is_found_by_its_checksum() {
    let mut bytes = mcap(TOPICS, &messages(false), Packing::Zstd, 40, true);
    // The checksum is behind the magic, the header record, and 9 + 24 bytes of the chunk.
    let chunk = 8 + 9 + 4 + 4 + 4 + 5;
    bytes[chunk + 9 + 24] ^= 1;
    let log = RobotLog::from_bytes("flip.mcap", bytes);
    let text = match log {
        // The channels stand in the chunk only, which is then left out.
        Ok(log) => format!("{:?}", log.notes()),
        Err(error) => error.to_string(),
    };
    assert!(text.contains("a chunk with CRC"), "{text}");
}

#[test]
fn files_that_are_no_log_are_refused_by_name() {
    for (bytes, found) in [
        (&b""[..], "an empty file"),
        (b"PK\x03\x04", "other bytes"),
        (
            b"\x28\xb5\x2f\xfd1234",
            "a file compressed as a whole by zstd; `zstd -d` unpacks it",
        ),
        (
            b"#ROSBAG V1.2\nabc",
            "version \"1.2\"; `rosbag fix` writes the new one",
        ),
    ] {
        match RobotLog::from_bytes("x", bytes.to_vec()) {
            Err(LogError::Kind { found: own, .. }) => assert_eq!(own, found),
            other => panic!("{other:?}"),
        }
    }
}

/// A folder of this test.
fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("robot-logs-{name}-{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
fn a_log_in_several_files_is_one_log() {
    let folder = folder("split");
    let all = messages(false);
    for (part, range) in [(2, 0..15), (10, 15..40)] {
        let bytes = mcap(TOPICS, &all[range], Packing::Lz4, 7, true);
        fs::write(folder.join(format!("drive_{part}.mcap")), bytes).unwrap();
    }
    let log = RobotLog::open(&folder).unwrap();
    assert_eq!(speeds(&log), expected());
    assert_eq!(log.topics().len(), 3);
    let names: Vec<_> = log.files().map(|path| path.file_name().unwrap()).collect();
    assert_eq!(names, ["drive_2.mcap", "drive_10.mcap"]);

    // metadata.yaml chooses and orders; early recorders wrote the folder into the names.
    let metadata = "rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n    - elsewhere/drive_10.mcap\n  \
                    compression_format: \"\"\n  compression_mode: \"\"\n";
    fs::write(folder.join("metadata.yaml"), metadata).unwrap();
    assert!(RobotLog::recognises(&folder));
    for path in [folder.clone(), folder.join("metadata.yaml")] {
        assert_eq!(RobotLog::open(&path).unwrap().files().count(), 1);
    }
    let missing = metadata.replace("drive_10", "drive_11");
    fs::write(folder.join("metadata.yaml"), missing).unwrap();
    let error = RobotLog::open(&folder).unwrap_err().to_string();
    assert!(error.contains("drive_11.mcap: cannot be read"), "{error}");
    fs::write(folder.join("metadata.yaml"), "a: b\n").unwrap();
    assert!(!RobotLog::recognises(&folder));
    let error = RobotLog::open(&folder).unwrap_err().to_string();
    assert!(
        error.ends_with("expected rosbag2_bagfile_information, found another text"),
        "{error}"
    );
    fs::remove_dir_all(&folder).unwrap();
}
