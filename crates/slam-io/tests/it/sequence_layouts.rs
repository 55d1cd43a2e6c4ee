//! Sequences in the layouts of public data sets, from genuine files.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::sequence::names_of;
use crate::common::{ScratchFolder, data_folder};
use image::{GrayImage, Luma};
use slam_io::{
    MountFile, OdometrySource, OpenOptions, Sequence, SequenceFormat, Survey, read_run_inputs,
};

fn survey(path: &Path) -> Survey {
    Survey::of(path, &OpenOptions::default()).unwrap()
}

/// The only fault of a survey: no odometry, and how to do without.
fn assert_lacks_odometry_alone(survey: &Survey) {
    let faults: Vec<String> = survey.faults().iter().map(ToString::to_string).collect();
    assert_eq!(faults.len(), 1, "{faults:?}");
    assert!(
        faults[0].contains("odometry.csv: not found")
            && faults[0].contains("--odometry-from-groundtruth")
            && faults[0].contains("--odometry none"),
        "{faults:?}"
    );
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap().path();
        let target = to.join(entry.file_name().unwrap());
        if entry.is_dir() {
            copy(&entry, &target);
        } else {
            fs::copy(entry, target).unwrap();
        }
    }
}

/// Rows that stand still, from the first image on.
fn add_odometry(root: &Path, first_s: f64) {
    let text = format!("t_s,v_mps,omega_radps\n{first_s},0,0\n");
    fs::write(root.join("odometry.csv"), text).unwrap();
}

#[test]
fn val_euroc_the_recording_is_read() {
    let Some(folder) = data_folder("euroc_v101_micro") else {
        return;
    };
    for root in [folder.clone(), folder.join("mav0")] {
        let survey = survey(&root);
        assert_eq!(survey.format, SequenceFormat::Euroc);
        assert_lacks_odometry_alone(&survey);
        let images = survey.images.as_ref().unwrap();
        assert_eq!((images.len(), images.size(0).unwrap()), (30, (752, 480)));
        let times_s = survey.times_s.as_ref().unwrap();
        assert!((times_s[0] - 1_403_715_273.262_143).abs() < 1e-6);
        assert!((times_s[29] - times_s[0] - 1.45).abs() < 1e-3);
        let camera = survey.camera.as_ref().unwrap();
        assert_eq!((camera.fx, camera.cy), (458.654, 248.375));
        // The camera would look along the IMU's z.
        assert_eq!(camera.mount, MountFile::default());
        assert_eq!(names_of(&survey.warnings), ["camera-taken-as-body"]);
        // The drone stands still: it moves 0.4 mm in these 1.5 s.
        let reference = survey.reference.as_ref().unwrap().as_ref().unwrap();
        assert_eq!(reference.len(), 31);
        let (_, last) = reference[30];
        let moved = last.x.hypot(last.y);
        assert!(moved > 1e-5 && moved < 6e-4, "{moved}");
    }
}

#[test]
fn val_euroc_is_a_sequence_once_it_has_odometry() {
    let Some(folder) = data_folder("euroc_v101_micro") else {
        return;
    };
    let scratch = ScratchFolder::new();
    copy(&folder.join("mav0"), &scratch.path().join("mav0"));
    add_odometry(scratch.path(), 1_403_715_273.0);
    let sequence = Sequence::open(scratch.path()).unwrap();
    assert_eq!(sequence.load_image(29).unwrap().width, 752);
    assert_eq!(
        sequence.odometry_source,
        OdometrySource::File("odometry.csv".into())
    );
    // A run keeps calibration and odometry in the native form, which read back as they are.
    let results = ScratchFolder::new();
    for (name, bytes) in sequence.input_files().unwrap() {
        fs::write(results.path().join(name), bytes).unwrap();
    }
    let (camera, rows) = read_run_inputs(results.path(), sequence.times_s[0]).unwrap();
    assert_eq!((camera, rows), (sequence.camera, sequence.odometry));
}

#[test]
fn val_euroc_images_that_are_listed_and_missing_are_counted() {
    let Some(folder) = data_folder("euroc_v101_micro") else {
        return;
    };
    let scratch = ScratchFolder::new();
    copy(&folder.join("mav0"), &scratch.path().join("mav0"));
    let list = scratch.path().join("mav0/cam0/data.csv");
    fs::copy(folder.join("cam0_data_as_found.csv"), list).unwrap();
    let message = survey(scratch.path()).times_s.unwrap_err().to_string();
    assert!(
        message.ends_with(
            "data.csv: expected 95 images that are on disk, found 65 of them missing, the first is \
             1403715274762142976.png"
        ),
        "{message}"
    );
}

#[test]
fn val_euroc_of_another_script_is_refused_in_one_sentence() {
    let Some(folder) = data_folder("format_samples/euroc_odd") else {
        return;
    };
    let scratch = ScratchFolder::new();
    let camera = scratch.path().join("mav0/cam0");
    fs::create_dir_all(camera.join("data")).unwrap();
    fs::copy(folder.join("cam0_sensor.yaml"), camera.join("sensor.yaml")).unwrap();
    fs::write(
        camera.join("data.csv"),
        "#timestamp [ns],filename\n1764757961901789696,01764757961901789696.png\n",
    )
    .unwrap();
    GrayImage::from_pixel(8, 6, Luma([7]))
        .save(camera.join("data/01764757961901789696.png"))
        .unwrap();
    let message = survey(scratch.path()).camera.unwrap_err().to_string();
    assert!(
        message.contains("expected the keys T_BS, resolution, intrinsics")
            && message.contains("found no T_BS: write")
            && message.ends_with("name it with --camera"),
        "{message}"
    );
}

#[test]
fn val_tum_rgbd_the_recording_is_read() {
    let Some(folder) = data_folder("format_samples/tum_fr1_rpy") else {
        return;
    };
    let without = survey(&folder);
    assert_eq!(without.format, SequenceFormat::TumRgbd);
    let message = without.camera.as_ref().unwrap_err().to_string();
    assert!(
        message.contains("--camera FILE (of freiburg1 for instance ORB-SLAM's TUM1.yaml)"),
        "{message}"
    );
    let times_s = without.times_s.as_ref().unwrap();
    assert_eq!((times_s.len(), times_s[0]), (8, 1_305_031_229.528_748));
    let images = without.images.as_ref().unwrap();
    assert_eq!(images.name(7), "1305031229.764848.png");
    let reference = without.reference.as_ref().unwrap().as_ref().unwrap();
    let at_first = reference
        .iter()
        .find(|pose| (pose.0 - times_s[0]).abs() < 0.01)
        .unwrap();
    assert!(at_first.1.x.hypot(at_first.1.y) < 0.01, "{at_first:?}");

    let Some(settings) = data_folder("format_samples/orbslam") else {
        return;
    };
    let options = OpenOptions {
        camera: Some(settings.join("orbslam2_TUM1.yaml")),
        ..OpenOptions::default()
    };
    let survey = Survey::of(&folder, &options).unwrap();
    assert_lacks_odometry_alone(&survey);
    let camera = survey.camera.unwrap();
    assert_eq!(
        (camera.width, camera.height, camera.fx),
        (640, 480, 517.306_408)
    );
}

#[test]
fn val_kitti_odometry_the_sequence_is_read() {
    let Some(folder) = data_folder("format_samples/kitti05_mini") else {
        return;
    };
    let survey = survey(&folder.join("sequences/05"));
    assert_eq!(survey.format, SequenceFormat::Kitti);
    assert_lacks_odometry_alone(&survey);
    let images = survey.images.as_ref().unwrap();
    assert_eq!(images.len(), 6);
    let camera = survey.camera.as_ref().unwrap();
    assert_eq!((camera.fx, camera.cx), (707.0912, 601.8873));
    assert_eq!(
        (camera.width, camera.height),
        images.size(0).unwrap(),
        "calib.txt says no size, the images do"
    );
    // 6 of the 2761 frames that the lists speak of.
    assert_eq!(
        names_of(&survey.warnings),
        ["frames-missing", "mount-unknown"]
    );
    assert_eq!(survey.times_s.as_ref().unwrap()[1], 0.104_228_3);
    let reference = survey.reference.as_ref().unwrap().as_ref().unwrap();
    assert_eq!(reference.len(), 6);
    // The second line of poses/05.txt: 0.565 m along z of the camera, 3.5 mm to its right.
    let (_, second) = reference[1];
    assert!((second.x - 0.565_351_1).abs() < 1e-6, "{second:?}");
    assert!((second.y + 0.003_499_7).abs() < 1e-6, "{second:?}");
}

#[test]
fn a_folder_above_sequences_names_them() {
    let scratch = ScratchFolder::new();
    for name in ["sequences/05/image_0", "sequences/06/image_0"] {
        fs::create_dir_all(scratch.path().join(name)).unwrap();
    }
    let message = Sequence::open(scratch.path()).unwrap_err().to_string();
    let below = |name: &str| scratch.path().join(name).display().to_string();
    assert!(
        message.ends_with(&format!(
            "found 2 in folders below: give one, {}, {}",
            below("sequences/05"),
            below("sequences/06")
        )),
        "{message}"
    );
}

/// A drive of KITTI raw: three images at 10 Hz, the unit's readings, 10 m/s to the east, turning left.
pub(crate) fn write_kitti_raw(day: &Path, width: u32, height: u32) -> PathBuf {
    let drive = day.join("2011_09_26_drive_0001_sync");
    let stamps = "2011-09-26 13:02:25.000000000\n2011-09-26 13:02:25.100000000\n2011-09-26 13:02:25.200000000\n";
    for folder in ["image_00/data", "oxts/data"] {
        fs::create_dir_all(drive.join(folder)).unwrap();
        fs::write(drive.join(folder).with_file_name("timestamps.txt"), stamps).unwrap();
    }
    for index in 0..3 {
        GrayImage::from_fn(width, height, |x, y| Luma([(x * 3 + y * 5 + index) as u8]))
            .save(drive.join(format!("image_00/data/{index:010}.png")))
            .unwrap();
        // One metre a reading to the east, at 49 degrees north.
        let longitude =
            8.0 + (f64::from(index) / (6_378_137.0 * 49.0_f64.to_radians().cos())).to_degrees();
        let mut values = [0.0; 30];
        (values[0], values[1], values[2]) = (49.0, longitude, 115.0);
        (values[8], values[22]) = (10.0, 0.25);
        let text: Vec<String> = values.iter().map(ToString::to_string).collect();
        fs::write(
            drive.join(format!("oxts/data/{index:010}.txt")),
            text.join(" "),
        )
        .unwrap();
    }
    drive
}

#[test]
fn val_kitti_raw_calibration_and_readings_are_read() {
    let Some(folder) = data_folder("format_samples/kitti_raw_calib") else {
        return;
    };
    let scratch = ScratchFolder::new();
    copy(&folder, scratch.path());
    let sequence = Sequence::open(&write_kitti_raw(scratch.path(), 1242, 375)).unwrap();
    assert_eq!(sequence.format, SequenceFormat::KittiRaw);
    assert_eq!(sequence.warnings, []);
    assert_eq!(
        (sequence.camera.fx, sequence.camera.cy),
        (721.5377, 172.854)
    );
    assert_eq!(sequence.times_s[0], 1_317_042_145.0);
    let row = sequence.odometry[1];
    assert_eq!((row.v_mps, row.omega_radps), (10.0, 0.25));
    assert!((row.t_s - sequence.times_s[1]).abs() < 1e-6);
    // The published chain of IMU, laser scanner and camera: 1.1 m before the unit, 0.3 m to its right, 0.7 m above it.
    let [x, y, z] = sequence.camera.mount.position_in_body;
    assert!((x - 1.09).abs() < 0.03, "{x}");
    assert!((y + 0.32).abs() < 0.03, "{y}");
    assert!((z - 0.72).abs() < 0.04, "{z}");
    let [forward, left, up] = sequence.camera.mount.rotation_body_from_camera;
    assert!(forward[2] > 0.999 && left[0] < -0.999 && up[1] < -0.999);
    let reference = sequence.reference.unwrap();
    let (_, last) = reference[2];
    // One metre a reading to the east, which is x of the projection.
    assert!(
        (last.x - 2.0).abs() < 1e-3 && last.y.abs() < 1e-6,
        "{last:?}"
    );
}

#[test]
fn val_kitti_raw_images_that_are_not_rectified_have_the_raw_camera() {
    let Some(folder) = data_folder("format_samples/kitti_raw_calib") else {
        return;
    };
    let scratch = ScratchFolder::new();
    copy(&folder, scratch.path());
    let survey = survey(&write_kitti_raw(scratch.path(), 1392, 512));
    assert!(survey.faults().is_empty(), "{:?}", survey.faults());
    let camera = survey.camera.unwrap();
    assert_eq!((camera.fx, camera.fy), (984.2439, 980.8141));
    assert_eq!(camera.distortion.parameters()[0], -0.372_875_5);
}

#[test]
fn kitti_raw_without_calibration_says_where_it_belongs() {
    let scratch = ScratchFolder::new();
    let survey = survey(&write_kitti_raw(scratch.path(), 64, 48));
    let message = survey.camera.unwrap_err().to_string();
    assert!(
        message.contains("calib_cam_to_cam.txt, belongs"),
        "{message}"
    );
}
