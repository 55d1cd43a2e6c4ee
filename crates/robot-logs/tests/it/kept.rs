//! The small logs in `fixtures/logs`, which the formats' own libraries wrote (`xtask/scripts/make_bags.py`).

use std::fs;
use std::path::{Path, PathBuf};

use robot_logs::{Message, Pixels, RobotLog};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../fixtures")
        .join(name)
}

/// Index of a topic.
fn topic(log: &RobotLog, name: &str) -> usize {
    let found = log.topics().iter().position(|topic| topic.name == name);
    found.unwrap_or_else(|| panic!("no {name} among {:?}", log.topics()))
}

#[test]
fn val_rosbags_bag_holds_the_numbers_of_the_wall() {
    let log = RobotLog::open(&fixture("logs/wall.bag")).unwrap();
    assert_eq!(log.notes(), [""; 0]);
    let images: Vec<_> = log.handles(&[topic(&log, "/camera/image_raw")]).collect();
    assert_eq!(images.len(), 4);
    for (index, handle) in images.iter().enumerate() {
        let stamp_ns = 500_000_000 * i64::try_from(index).unwrap();
        assert_eq!(log.stamp_ns(handle).unwrap(), Some(stamp_ns));
        assert_eq!(handle.log_time_ns(), stamp_ns + 3_000_000);
        let Message::Image(image) = log.message(handle).unwrap() else {
            panic!("no image");
        };
        assert_eq!(
            (image.width, image.height, image.encoding.as_str()),
            (320, 240, "mono8")
        );
        assert_eq!(image.header.frame_id, "camera_optical_frame");
        assert!(matches!(image.pixels(), Ok(Pixels::Grey8(pixels)) if pixels.len() == 76_800));
    }
    let handle = log
        .handles(&[topic(&log, "/camera/camera_info")])
        .next()
        .unwrap();
    let Message::CameraInfo(info) = log.message(&handle).unwrap() else {
        panic!("no calibration");
    };
    assert_eq!(
        info.k,
        [
            368.8262, 0.0, 159.67029, 0.0, 369.90239, 121.54136, 0.0, 0.0, 1.0
        ]
    );
    assert_eq!(
        (info.width, info.height, info.d.as_slice()),
        (320, 240, &[0.0; 5][..])
    );
}

#[test]
fn val_mcap_file_holds_the_odometry_and_the_images_of_the_wall() {
    let log = RobotLog::open(&fixture("logs/wall.mcap")).unwrap();
    let rows = fs::read_to_string(fixture("wall/odometry.csv")).unwrap();
    let handles: Vec<_> = log.handles(&[topic(&log, "/odom")]).collect();
    assert_eq!(handles.len(), 18);
    for (handle, row) in handles.iter().zip(rows.lines().skip(1)) {
        let numbers: Vec<f64> = row.split(',').map(|text| text.parse().unwrap()).collect();
        let Message::Odometry(odometry) = log.message(handle).unwrap() else {
            panic!("no odometry");
        };
        assert_eq!(odometry.header.stamp_ns as f64 / 1e9, numbers[0]);
        assert_eq!(odometry.twist.linear[0], numbers[1]);
        assert_eq!(odometry.twist.angular[2], numbers[2]);
        assert_eq!(odometry.child_frame_id, "base_link");
    }
    let images: Vec<_> = log
        .handles(&[topic(&log, "/camera/image_raw/compressed")])
        .collect();
    for (index, handle) in images.iter().enumerate() {
        let Message::CompressedImage(image) = log.message(handle).unwrap() else {
            panic!("no image");
        };
        let file = fs::read(fixture(&format!("wall/images/{index:06}.png"))).unwrap();
        assert!(image.data == file, "image {index}");
    }
    let handle = log.handles(&[topic(&log, "/tf_static")]).next().unwrap();
    let Message::Transforms(transforms) = log.message(&handle).unwrap() else {
        panic!("no transforms");
    };
    let frames: Vec<_> = transforms
        .iter()
        .map(|one| (one.header.frame_id.as_str(), one.child_frame_id.as_str()))
        .collect();
    assert_eq!(
        frames,
        [
            ("camera_link", "camera_optical_frame"),
            ("base_link", "camera_link")
        ]
    );
    assert_eq!(
        transforms[1].transform.position,
        [0.1001742, -0.0021039, 0.9]
    );
}

#[test]
fn val_sqlite_pages_of_the_write_ahead_log_are_read() {
    let path = fixture("logs/unfinished.db3");
    let log = RobotLog::open(&path).unwrap();
    let counts: Vec<_> = log
        .topics()
        .iter()
        .map(|topic| (topic.name.as_str(), topic.messages))
        .collect();
    assert_eq!(
        counts,
        [("/tf_static", 1), ("/odom", 18), ("/camera/camera_info", 4)]
    );
    for handle in log.handles(&[0, 1, 2]) {
        log.message(&handle).unwrap();
    }
    // The database alone ends earlier, and a frame with a changed byte ends what counts of the write-ahead log.
    let bytes = fs::read(&path).unwrap();
    let alone = RobotLog::from_bytes("alone.db3", bytes.clone()).unwrap();
    let count = |log: &RobotLog| log.handles(&[0, 1, 2]).count();
    assert!((10..20).contains(&count(&alone)), "{}", count(&alone));
    let folder = std::env::temp_dir().join(format!("robot-logs-wal-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let copy = folder.join("copy.db3");
    fs::write(&copy, bytes).unwrap();
    let mut wal = fs::read(fixture("logs/unfinished.db3-wal")).unwrap();
    wal[32 + 24 + 10] ^= 1;
    fs::write(folder.join("copy.db3-wal"), wal).unwrap();
    let changed = RobotLog::open(&copy).unwrap();
    assert_eq!(count(&changed), count(&alone));
    fs::remove_dir_all(&folder).unwrap();
}
