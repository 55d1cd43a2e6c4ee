//! The files of a sequence, in every layout; a file at a time is not what it was.

use std::fs;
use std::path::Path;

use image::{GrayImage, Luma};
use slam_io::{OpenOptions, Survey};

use super::mutations::{Memory, attack};
use super::unsealed;
use crate::common::ScratchFolder;
use crate::sequence_layouts::write_kitti_raw;

/// As for other texts, and the images of the sequence with what their decoders need.
const SEQUENCE: Memory = Memory {
    per_byte: 400,
    always: 2 << 20,
};

const CAMERA: &str =
    "width = 8\nheight = 6\nmodel = \"pinhole\"\nfx = 10.0\nfy = 11\ncx = 3.5\ncy = 2.5\n";
const ROBOT: &str =
    "[wheels]\nmetres_per_tick = 0.001\nbase_m = 0.2\n[steering]\nwheelbase_m = 2.5\nratio = 15\n";
const SPEEDS: &str = "t_s,v_mps,omega_radps\n0,1.0,0.1\n0.4,2.0,0.2\n1.2,3.0,-0.3\n";
const EUROC: &str = "%YAML:1.0\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [0, 0, 1, 0.1, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0, \
    1]\nresolution: [8, 6]\ncamera_model: pinhole\nintrinsics: [10, 11, 3.5, 2.5]\ndistortion_model: radial-tangential\n\
    distortion_coefficients: [0, 0, 0, 0]\n";

/// Images below `folder` with these names.
fn images(folder: &Path, names: &[&str]) {
    fs::create_dir_all(folder).unwrap();
    for (index, name) in names.iter().enumerate() {
        GrayImage::from_fn(8, 6, |x, y| Luma([(30 * x + 5 * y) as u8 + index as u8]))
            .save(folder.join(name))
            .unwrap();
    }
}

/// A sequence with these files beside its images.
fn sequence(files: &[(&str, &str)]) -> ScratchFolder {
    let folder = ScratchFolder::new();
    images(&folder.path().join("images"), &["0.png", "1.png", "2.png"]);
    fs::write(folder.path().join("camera.toml"), CAMERA).unwrap();
    fs::write(folder.path().join("times.txt"), "0\n0.5\n1\n").unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }
    folder
}

/// Attacks one file of a sequence, which is read without a fault as it is.
fn attack_part(root: &Path, name: &str, others: &[&str]) {
    let path = root.join(name);
    let mut genuine = vec![fs::read(&path).unwrap()];
    let survey = || Survey::of(root, &OpenOptions::default());
    let whole = survey().unwrap();
    for (part, fault) in [
        ("images", whole.images.err()),
        ("times", whole.times_s.err()),
        ("camera", whole.camera.err()),
        ("odometry", whole.odometry.err()),
        ("reference", whole.reference.err()),
    ] {
        assert!(fault.is_none(), "{name}: {part}: {}", fault.unwrap());
    }
    genuine.extend(others.iter().map(|text| text.as_bytes().to_vec()));
    attack(name, &genuine, SEQUENCE, unsealed, |bytes| {
        fs::write(&path, bytes).unwrap();
        drop(survey());
    });
}

#[test]
fn times_of_any_bytes() {
    let folder = sequence(&[("odometry.csv", SPEEDS)]);
    let named = "0 0.png\n0.5 1.png\n1 2.png\n";
    let nanoseconds = "1403636580838555648\n1403636580888555648\n1403636580938555648\n";
    attack_part(folder.path(), "times.txt", &[named, nanoseconds]);
}

#[test]
fn cameras_of_any_bytes() {
    let folder = sequence(&[("odometry.csv", SPEEDS)]);
    attack_part(folder.path(), "camera.toml", &[]);
}

#[test]
fn speeds_and_poses_of_any_bytes() {
    let folder = sequence(&[("odometry.csv", SPEEDS)]);
    let others = [
        "t_s,x_m,y_m,phi_rad\n0,0,0,0\n0.5,0.5,0,0.1\n1,1,0,0.2\n",
        "0 0 0 0 0 0 0 1\n0.5 0.5 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n",
        "time;speed;yaw_rate\n0;1;0\n1;1;0\n",
        "t_s,v_mps,steering_rad\n0,2,0.2\n1,2,0.2\n",
    ];
    attack_part(folder.path(), "odometry.csv", &others);
}

#[test]
fn wheels_gyroscopes_and_robots_of_any_bytes() {
    let wheels = "t_s,left_ticks,right_ticks\n0,0,0\n0.5,100,90\n1,200,180\n";
    let gyro = "t_s,omega_radps\n-0.1,0.3\n0.2,0.3\n0.5,0.3\n0.8,0.3\n1.1,0.3\n";
    let robot =
        "[wheels]\nticks_per_turn = 360\ndiameter_m = 0.1\nbase_m = 0.2\ncounter_bits = 16\n";
    let folder = sequence(&[
        ("wheels.csv", wheels),
        ("gyro.csv", gyro),
        ("robot.toml", ROBOT),
    ]);
    for name in ["wheels.csv", "gyro.csv", "robot.toml"] {
        let whole = fs::read(folder.path().join(name)).unwrap();
        attack_part(folder.path(), name, &[robot]);
        fs::write(folder.path().join(name), whole).unwrap();
    }
}

#[test]
fn steering_of_any_bytes() {
    let steering = "t_s,v_mps,steering_rad\n0,2,0.2\n0.5,2,0.2\n1,2,0.2\n";
    let folder = sequence(&[("steering.csv", steering), ("robot.toml", ROBOT)]);
    attack_part(
        folder.path(),
        "steering.csv",
        &["t_s,v_mps,steering_wheel_deg\n0,2,90\n1,2,90\n"],
    );
}

#[test]
fn references_of_any_bytes() {
    let planar = "frame,t_s,x_m,y_m,phi_rad\n0,0,0,0,0\n1,0.5,0.5,0,0\n2,1,1,0,0\n";
    let camera = "# t x y z qx qy qz qw\n0 0 0 0 0 0 0 1\n0.5 0 0 0.5 0 0 0 1\n1 0 0 1 0 0 0 1\n";
    for (name, text) in [
        ("groundtruth_planar.csv", planar),
        ("groundtruth.txt", camera),
    ] {
        let folder = sequence(&[("odometry.csv", SPEEDS), (name, text)]);
        attack_part(folder.path(), name, &[]);
    }
}

#[test]
fn euroc_of_any_bytes() {
    let folder = ScratchFolder::new();
    let root = folder.path();
    let stamps = [
        "1403636579763555584",
        "1403636579813555456",
        "1403636579863555584",
    ];
    let names = stamps.map(|stamp| format!("{stamp}.png"));
    images(
        &root.join("mav0/cam0/data"),
        &names.each_ref().map(String::as_str),
    );
    let list: String = stamps
        .iter()
        .map(|stamp| format!("{stamp},{stamp}.png\n"))
        .collect();
    fs::write(
        root.join("mav0/cam0/data.csv"),
        format!("#timestamp [ns],filename\n{list}"),
    )
    .unwrap();
    fs::write(root.join("mav0/cam0/sensor.yaml"), EUROC).unwrap();
    let truth: String = stamps
        .iter()
        .map(|stamp| format!("{stamp},1,2,3,1,0,0,0\n"))
        .collect();
    fs::create_dir_all(root.join("mav0/state_groundtruth_estimate0")).unwrap();
    fs::write(
        root.join("mav0/state_groundtruth_estimate0/data.csv"),
        format!("#timestamp, x, y, z, qw, qx, qy, qz\n{truth}"),
    )
    .unwrap();
    fs::write(
        root.join("odometry.csv"),
        "t_s,v_mps,omega_radps\n1403636579.7,1,0\n1403636579.9,1,0\n",
    )
    .unwrap();
    for name in [
        "mav0/cam0/data.csv",
        "mav0/cam0/sensor.yaml",
        "mav0/state_groundtruth_estimate0/data.csv",
    ] {
        let whole = fs::read(root.join(name)).unwrap();
        attack_part(root, name, &[]);
        fs::write(root.join(name), whole).unwrap();
    }
}

#[test]
fn tum_rgbd_of_any_bytes() {
    let folder = ScratchFolder::new();
    let root = folder.path();
    images(
        &root.join("rgb"),
        &["1.000000.png", "1.500000.png", "2.000000.png"],
    );
    for (name, text) in [
        (
            "rgb.txt",
            "# color images\n1.0 rgb/1.000000.png\n1.5 rgb/1.500000.png\n2.0 rgb/2.000000.png\n",
        ),
        (
            "groundtruth.txt",
            "# t\n1.0 0 0 0 0 0 0 1\n1.5 0 0 0.5 0 0 0 1\n2.0 0 0 1 0 0 0 1\n",
        ),
        ("camera.toml", CAMERA),
        ("odometry.csv", "t_s,v_mps,omega_radps\n1,1,0\n2,1,0\n"),
    ] {
        fs::write(root.join(name), text).unwrap();
    }
    attack_part(root, "rgb.txt", &[]);
}

#[test]
fn kitti_of_any_bytes() {
    let folder = ScratchFolder::new();
    let root = folder.path().join("00");
    images(
        &root.join("image_0"),
        &["000000.png", "000001.png", "000002.png"],
    );
    for (name, text) in [
        ("times.txt", "0\n0.1\n0.2\n"),
        (
            "calib.txt",
            "P0: 10 0 3.5 0 0 11 2.5 0 0 0 1 0\nP1: 10 0 3.5 -5 0 11 2.5 0 0 0 1 0\n",
        ),
        (
            "poses.txt",
            "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 1\n1 0 0 0 0 1 0 0 0 0 1 2\n",
        ),
        ("odometry.csv", "t_s,v_mps,omega_radps\n0,10,0\n0.2,10,0\n"),
    ] {
        fs::write(root.join(name), text).unwrap();
    }
    for name in ["times.txt", "calib.txt", "poses.txt"] {
        let whole = fs::read(root.join(name)).unwrap();
        attack_part(&root, name, &[]);
        fs::write(root.join(name), whole).unwrap();
    }
}

#[test]
fn kitti_raw_of_any_bytes() {
    let folder = ScratchFolder::new();
    let drive = write_kitti_raw(folder.path(), 8, 6);
    fs::write(
        folder.path().join("calib_cam_to_cam.txt"),
        "S_00: 8 6\nK_00: 10 0 3.5 0 11 2.5 0 0 1\nD_00: 0 0 0 0 0\nR_00: 1 0 0 0 1 0 0 0 1\nT_00: 0 0 0\nS_rect_00: 8 6\n\
         R_rect_00: 1 0 0 0 1 0 0 0 1\nP_rect_00: 10 0 3.5 0 0 11 2.5 0 0 0 1 0\n",
    )
    .unwrap();
    for (name, text) in [
        (
            "calib_velo_to_cam.txt",
            "R: 0 -1 0 0 0 -1 1 0 0\nT: 0 0 -0.3\n",
        ),
        (
            "calib_imu_to_velo.txt",
            "R: 1 0 0 0 1 0 0 0 1\nT: -0.8 0.3 -0.8\n",
        ),
    ] {
        fs::write(folder.path().join(name), text).unwrap();
    }
    for name in [
        "image_00/timestamps.txt",
        "oxts/timestamps.txt",
        "oxts/data/0000000001.txt",
        "../calib_cam_to_cam.txt",
        "../calib_imu_to_velo.txt",
    ] {
        let whole = fs::read(drive.join(name)).unwrap();
        attack_part(&drive, name, &[]);
        fs::write(drive.join(name), whole).unwrap();
    }
}

/// Logs as sequences: their images, transforms and calibrations.
#[test]
fn logs_of_any_bytes() {
    let memory = Memory {
        per_byte: 60,
        always: 64 << 20,
    };
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/logs");
    for name in ["wall.bag", "wall.mcap", "unfinished.db3"] {
        let folder = ScratchFolder::new();
        let path = folder.path().join(name);
        let genuine = [fs::read(fixtures.join(name)).unwrap()];
        attack(name, &genuine, memory, unsealed, |bytes| {
            fs::write(&path, bytes).unwrap();
            drop(Survey::of(&path, &OpenOptions::default()));
        });
    }
}
