//! Sequences without odometry, without times, without a calibration, and odometry made from the reference.

use std::fs;

use slam_io::{OdometryChoice, OdometrySource, OpenOptions, Sequence};

use crate::odometry_reading::{TWO, names, sequence};

/// Without odometry a folder of bare images is enough; everything that was guessed is said.
#[test]
fn bare_images_open_without_odometry() {
    let options = OpenOptions {
        odometry: OdometryChoice::Without,
        ..OpenOptions::default()
    };
    let folder = sequence(&TWO, &[]);
    let read = Sequence::open_with(folder.path(), &options).unwrap();
    assert_eq!(read.odometry_source, OdometrySource::None);
    assert!(read.odometry.is_empty() && read.odometry_holes().is_empty());
    assert_eq!(names(&read), ["scale-unknown"]);
    for name in ["times.txt", "camera.toml"] {
        fs::remove_file(folder.path().join(name)).unwrap();
    }
    let read = Sequence::open_with(folder.path(), &options).unwrap();
    assert_eq!(
        names(&read),
        ["camera-guessed", "frame-rate-assumed", "scale-unknown"]
    );
    assert_eq!(read.times_s, [0.0, 0.1]);
    // Sixty degrees over eight columns.
    assert!((4.0 / read.camera.fx - 30.0_f64.to_radians().tan()).abs() < 1e-12);
    assert_eq!((read.camera.cx, read.camera.cy), (3.5, 2.5));
    let faster = OpenOptions {
        frames_per_second: Some(30.0),
        ..options
    };
    let read = Sequence::open_with(folder.path(), &faster).unwrap();
    assert_eq!(read.times_s, [0.0, 1.0 / 30.0]);
    assert!(
        read.warnings[1]
            .message
            .contains("30 images a second are what --fps says")
    );
    // With odometry a guessed lens would be believed: it stays a fault.
    assert!(Sequence::open(folder.path()).is_err());
}

/// Odometry from the reference: the same for the same seed, and named.
#[test]
fn the_ground_truth_stands_in_for_odometry() {
    let truth = "frame,t_s,x_m,y_m,phi_rad\n0,0,0,0,0\n1,0.5,0.25,0,0\n2,1,0.5,0,0\n";
    let folder = sequence(&TWO, &[("groundtruth_planar.csv", truth)]);
    let with = |sigma_v: f64, seed: u64| {
        let options = OpenOptions {
            odometry: OdometryChoice::GroundTruth {
                sigma_v,
                sigma_w: 0.01,
                seed,
            },
            ..OpenOptions::default()
        };
        Sequence::open_with(folder.path(), &options)
    };
    let read = with(0.02, 7).unwrap();
    assert_eq!(read.odometry, with(0.02, 7).unwrap().odometry);
    assert_ne!(read.odometry, with(0.02, 8).unwrap().odometry);
    assert_eq!(names(&read), ["odometry-from-ground-truth"]);
    assert_eq!(
        read.odometry_source.to_string(),
        "ground truth with noise of 0.02 and 0.01, seed 7"
    );
    assert!((with(0.0, 7).unwrap().odometry[0].v_mps - 0.5).abs() < 1e-12);
    fs::remove_file(folder.path().join("groundtruth_planar.csv")).unwrap();
    let message = with(0.02, 7).unwrap_err().to_string();
    assert!(
        message.ends_with(
            "expected a reference path, such as groundtruth.txt, to make odometry from, found none"
        ),
        "{message}"
    );
}
