//! Recorded logs as sequences: the small ones in `fixtures/logs` against the folder they were made from, and genuine ones.

use std::path::{Path, PathBuf};

use slam_io::{OdometrySource, OpenOptions, Sequence, SequenceFormat, Survey};

use super::common::data_folder;
use super::common::sequence::names_of;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../fixtures")
        .join(name)
}

fn survey(path: &Path) -> Survey {
    Survey::of(path, &OpenOptions::default()).unwrap()
}

/// The sentences about a log, without its path.
fn faults(path: &Path, options: &OpenOptions) -> Vec<String> {
    let survey = Survey::of(path, options).unwrap();
    let shown = path.display().to_string();
    survey
        .faults()
        .iter()
        .map(|fault| fault.to_string().replace(&shown, "LOG"))
        .collect()
}

#[test]
fn a_log_of_the_wall_is_the_wall() {
    let folder = Sequence::open(&fixture("wall")).unwrap();
    for (name, images) in [("logs/wall.bag", 4), ("logs/wall.mcap", 4)] {
        let log = Sequence::open(&fixture(name)).unwrap();
        assert_eq!(log.format, SequenceFormat::Log, "{name}");
        assert_eq!(names_of(&log.warnings), [""; 0], "{name}");
        assert_eq!(log.images.len(), images);
        // Times, speeds and turn rates to the bit.
        assert_eq!(log.times_s, folder.times_s[..images]);
        assert_eq!(log.odometry.len(), 18);
        assert_eq!(log.odometry, folder.odometry[..18]);
        assert_eq!(log.odometry_source, OdometrySource::Topic("/odom".into()));
        for index in 0..images {
            let (own, expected) = (log.load_image(index), folder.load_image(index));
            assert!(own.unwrap() == expected.unwrap(), "{name}, image {index}");
        }
        // Calibration and mount to the bit as well.
        assert_eq!(log.camera, folder.camera);
    }
}

#[test]
fn a_log_keeps_its_inputs_beside_a_run() {
    let log = Sequence::open(&fixture("logs/wall.mcap")).unwrap();
    let folder = super::common::ScratchFolder::new();
    for (name, bytes) in log.input_files().unwrap() {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let (camera, odometry) = slam_io::read_run_inputs(folder.path(), log.times_s[0]).unwrap();
    assert_eq!(camera, log.camera);
    assert_eq!(odometry, log.odometry);
}

#[test]
fn a_calibration_given_beside_the_log_takes_its_place() {
    let options = OpenOptions {
        camera: Some(fixture("wall/camera.toml")),
        ..OpenOptions::default()
    };
    let log = Sequence::open_with(&fixture("logs/wall.mcap"), &options).unwrap();
    let folder = Sequence::open(&fixture("wall")).unwrap();
    assert_eq!(log.camera, folder.camera, "the mount of the file too");
    // A file without [mount] leaves it to the transforms of the log.
    let scratch = super::common::ScratchFolder::new();
    let bare = scratch.path().join("camera.toml");
    let text = std::fs::read_to_string(fixture("wall/camera.toml")).unwrap();
    std::fs::write(&bare, text.split("[mount]").next().unwrap()).unwrap();
    let options = OpenOptions {
        camera: Some(bare),
        ..OpenOptions::default()
    };
    let log = Sequence::open_with(&fixture("logs/wall.mcap"), &options).unwrap();
    let position = folder.camera.mount.position_in_body;
    assert_eq!(log.camera.mount.position_in_body, position);
}

#[test]
fn a_log_without_images_says_which_topics_it_has() {
    let path = fixture("logs/unfinished.db3");
    assert_eq!(
        faults(&path, &OpenOptions::default()),
        [
            "LOG: expected an image topic (sensor_msgs/Image or sensor_msgs/CompressedImage), found only /tf_static, \
          /odom, /camera/camera_info"
        ]
    );
    assert_eq!(survey(&path).odometry.unwrap().rows.len(), 18);
}

#[test]
fn a_topic_that_is_named_must_be_there() {
    let path = fixture("logs/wall.bag");
    let options = |image: Option<&str>, odometry: Option<&str>| OpenOptions {
        image_topic: image.map(str::to_string),
        odometry_topic: odometry.map(str::to_string),
        ..OpenOptions::default()
    };
    let named = options(Some("/camera/image_raw"), Some("/odom"));
    assert_eq!(faults(&path, &named), [""; 0]);
    assert_eq!(
        faults(&path, &options(Some("/cam0/image"), None))[0],
        "LOG: expected messages of sensor_msgs/Image or sensor_msgs/CompressedImage on /cam0/image (--image-topic), found \
         only /camera/image_raw"
    );
    assert_eq!(
        faults(&path, &options(None, Some("/camera/image_raw"))),
        [
            "LOG: expected messages of nav_msgs/Odometry, geometry_msgs/Twist(Stamped) or, with robot.toml beside the log, sensor_msgs/JointState on /camera/image_raw (--odometry-topic), found a topic of type sensor_msgs/Image; without odometry, `--odometry none` \
          finds the motion from the images, up to scale"
        ]
    );
}

#[test]
fn a_file_that_is_no_log_is_one_sentence() {
    let scratch = super::common::ScratchFolder::new();
    let path = scratch.path().join("drive.mcap");
    std::fs::write(&path, "not a log").unwrap();
    let message = Sequence::open(&path).unwrap_err().to_string();
    assert!(
        message.ends_with(
            "drive.mcap: expected a ROS 1 bag, an MCAP file or an SQLite file of a ROS 2 bag, found other bytes"
        ),
        "{message}"
    );
}

#[test]
fn val_genuine_logs_are_surveyed_and_say_what_is_missing() {
    let Some(samples) = data_folder("format_samples") else {
        return;
    };
    let default = OpenOptions::default();
    // /tf and /tf_static only.
    for name in ["ros1/tf_only.bag", "ros2/tf_example"] {
        let found = faults(&samples.join(name), &default);
        assert_eq!(found.len(), 3, "{found:?}");
        assert!(
            found[0].starts_with("LOG: expected an image topic"),
            "{}",
            found[0]
        );
        assert!(
            found[0].ends_with("found only /tf_static, /tf"),
            "{}",
            found[0]
        );
    }
    let robot = survey(&samples.join("ros1/odometry_real_robot.bag"));
    let odometry = robot.odometry.unwrap();
    assert_eq!(odometry.source, OdometrySource::Topic("/odom".into()));
    assert_eq!(odometry.rows.len(), 100);
    assert!(names_of(&robot.warnings).contains(&"odometry-topic-chosen"));
    let amcl = survey(&samples.join("ros2/odometry_amcl_tf.mcap"));
    let rows = amcl.odometry.unwrap().rows;
    assert!((2600..=2639).contains(&rows.len()), "{}", rows.len());
    // Images without odometry and calibration; two topics of the same number, the raw one is taken.
    for name in ["ros1/image_compressed_imu.bag", "ros2/image_compressed_imu"] {
        let survey = survey(&samples.join(name));
        assert_eq!(survey.images.as_ref().unwrap().len(), 3);
        assert_eq!(survey.times_s.as_ref().unwrap().len(), 3);
        assert_eq!(names_of(&survey.warnings)[0], "image-topic-chosen");
        assert!(survey.warnings[0].message.contains("/camera/raw with 3"));
        assert!(survey.odometry.is_err() && survey.camera.is_err());
    }
    // The colour camera of three image topics, and its own calibration of two.
    let realsense = survey(&samples.join("ros1/realsense_image_camerainfo.bag"));
    assert_eq!(
        realsense.camera_name,
        "/device_0/sensor_1/Color_0/info/camera_info"
    );
    assert_eq!(realsense.camera.unwrap().width, 640);
    assert!(realsense.sizes.is_ok());
}
