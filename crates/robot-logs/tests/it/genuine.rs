//! Genuine logs of other people (`format_samples` of the optional data): counts as rosbags and mcap give them.

use std::path::PathBuf;

use robot_logs::{LogFormat, Message, MessageKind, Pixels, RobotLog};

/// Name of a sample, its container, messages of some kinds, number of topics.
type Row = (
    &'static str,
    LogFormat,
    &'static [(MessageKind, usize)],
    usize,
);

/// A sample, where `MONO_SLAM_DATA` or `../shared/data` beside the workspace has it.
#[expect(clippy::print_stdout, reason = "a skipped test says so")]
fn sample(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("MONO_SLAM_DATA").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let path = root.join("format_samples").join(name);
    if path.exists() {
        return Some(path);
    }
    println!("skipped: no {}", path.display());
    None
}

/// Messages of the topics of one kind, all of them decoded.
fn count(log: &RobotLog, kind: MessageKind) -> usize {
    let topics: Vec<usize> = (0..log.topics().len())
        .filter(|&index| log.topics()[index].kind == Some(kind))
        .collect();
    let handles: Vec<_> = log.handles(&topics).collect();
    for handle in &handles {
        log.message(handle).unwrap();
    }
    handles.len()
}

#[test]
fn val_genuine_logs_have_the_counts_of_the_reference_readers() {
    use LogFormat::{Mcap, Rosbag1, Sqlite};
    use MessageKind::{CameraInfo, CompressedImage, Image, Odometry, Transforms, Twist};
    let rows: [Row; 11] = [
        (
            "ros1/example-bz2.bag",
            Rosbag1,
            &[(Twist, 565), (Transforms, 2689)],
            9,
        ),
        (
            "ros1/example-lz4.bag",
            Rosbag1,
            &[(Twist, 565), (Transforms, 2689)],
            9,
        ),
        (
            "ros1/image_compressed_imu.bag",
            Rosbag1,
            &[(Image, 3), (CompressedImage, 3)],
            3,
        ),
        (
            "ros1/odometry_real_robot.bag",
            Rosbag1,
            &[(Odometry, 200)],
            2,
        ),
        (
            "ros1/realsense_image_camerainfo.bag",
            Rosbag1,
            &[(Image, 3), (CameraInfo, 2)],
            70,
        ),
        (
            "ros1/tf_only.bag",
            Rosbag1,
            &[(Transforms, 518), (Image, 0)],
            2,
        ),
        (
            "ros2/image_and_compressed_no_metadata.db3",
            Sqlite,
            &[(Image, 1), (CompressedImage, 1)],
            5,
        ),
        (
            "ros2/image_compressed_imu",
            Sqlite,
            &[(Image, 3), (CompressedImage, 3)],
            3,
        ),
        (
            "ros2/jetacker_odom_tf",
            Sqlite,
            &[(Odometry, 217), (Transforms, 769)],
            6,
        ),
        (
            "ros2/odometry_amcl_tf.mcap",
            Mcap,
            &[(Odometry, 2639), (Transforms, 5423)],
            4,
        ),
        (
            "ros2/tf_example",
            Sqlite,
            &[(Transforms, 518), (Image, 0)],
            2,
        ),
    ];
    for (name, format, counts, topics) in rows {
        let Some(path) = sample(name) else { return };
        assert!(RobotLog::recognises(&path), "{name}");
        let log = RobotLog::open(&path).unwrap();
        assert_eq!(log.format(), format, "{name}");
        assert_eq!(log.notes(), [""; 0], "{name}");
        assert_eq!(log.topics().len(), topics, "{name}");
        for &(kind, expected) in counts {
            assert_eq!(count(&log, kind), expected, "{name}, {kind:?}");
        }
    }
}

#[test]
fn val_genuine_messages_have_the_numbers_of_the_reference_readers() {
    let first = |name: &str, kind: MessageKind| {
        let log = RobotLog::open(&sample(name)?).unwrap();
        let index = log
            .topics()
            .iter()
            .position(|topic| topic.kind == Some(kind) && topic.messages > 0);
        let handle = log.handles(&[index.unwrap()]).next().unwrap();
        Some((handle.log_time_ns(), log.message(&handle).unwrap()))
    };
    // Printed by rosbags 0.11.9.
    if let Some((time_ns, Message::Odometry(odometry))) =
        first("ros1/odometry_real_robot.bag", MessageKind::Odometry)
    {
        assert_eq!(time_ns, 1_724_184_535_683_075_364);
        assert_eq!(odometry.header.stamp_ns, 1_724_184_535_659_474_850);
        assert_eq!(odometry.pose.position[0], 0.103_086_377_134_669_75);
        assert_eq!(odometry.twist.linear[0], -0.000_232_959_579_164_311_94);
        assert_eq!(odometry.twist.angular[2], 0.659_504_836_286_358_3);
    }
    if let Some((time_ns, Message::Odometry(odometry))) =
        first("ros2/odometry_amcl_tf.mcap", MessageKind::Odometry)
    {
        assert_eq!(time_ns, 1_778_234_353_382_747_000);
        assert_eq!(odometry.header.stamp_ns, 928_800_000_000);
        assert_eq!(odometry.header.frame_id, "odom");
        assert_eq!(odometry.pose.position[0], -2.801_916_634_061_231_2);
    }
    if let Some((_, Message::Odometry(odometry))) =
        first("ros2/jetacker_odom_tf", MessageKind::Odometry)
    {
        assert_eq!(odometry.header.stamp_ns, 1_773_982_693_862_372_377);
        assert_eq!(odometry.twist.angular[2], -1.023_019_654_087_879_5e-5);
    }
    if let Some((_, Message::CompressedImage(image))) = first(
        "ros1/image_compressed_imu.bag",
        MessageKind::CompressedImage,
    ) {
        assert_eq!((image.format.as_str(), image.data.len()), ("jpeg", 634));
        assert_eq!(image.header.frame_id, "camera");
    }
}

#[test]
fn val_genuine_images_have_pixels() {
    for name in [
        "ros1/image_compressed_imu.bag",
        "ros1/realsense_image_camerainfo.bag",
        "ros2/image_and_compressed_no_metadata.db3",
        "ros2/image_compressed_imu",
    ] {
        let Some(path) = sample(name) else { return };
        let log = RobotLog::open(&path).unwrap();
        let all: Vec<usize> = (0..log.topics().len()).collect();
        for handle in log.handles(&all) {
            if let Message::Image(image) = log.message(&handle).unwrap() {
                let count = (image.width * image.height) as usize;
                let found = match image.pixels().unwrap() {
                    Pixels::Grey8(pixels) => pixels.len(),
                    Pixels::Grey16(pixels) => pixels.len(),
                    Pixels::Rgb8(pixels) => pixels.len() / 3,
                };
                assert_eq!(found, count, "{name}");
            }
        }
    }
}
