//! A frame that is refused leaves no trace: the system is what it was, and goes on.

use slam_pipeline::config::{Method, ValidConfig};
use slam_pipeline::{FrameInput, OdometryInterval, Slam, SlamError};
use vision_sift::Features;

use crate::drive::{Drive, config, rig};

/// Frames before the refused one.
const BEFORE: usize = 8;
/// Frames after it.
const AFTER: usize = 6;

/// Drives, gives `refused` in between, and compares everything with a system that never saw it.
fn leaves_no_trace(
    method: Method,
    refused: &dyn Fn(&Drive) -> (Features, Vec<OdometryInterval>),
    is_expected: &dyn Fn(&SlamError) -> bool,
) {
    let drive = Drive::new(500);
    let config = with_method(method);
    let mut slam = Slam::new(rig(), &config).unwrap();
    for i in 0..BEFORE {
        slam.step(&drive.input(i), &mut |_| {}).unwrap();
    }
    let mut untouched = slam.clone();
    let (features, odometry) = refused(&drive);
    let input = FrameInput {
        features: &features,
        odometry: &odometry,
    };
    let error = slam.step(&input, &mut |_| {}).unwrap_err();
    assert!(is_expected(&error), "{error}");
    assert_eq!(format!("{slam:?}"), format!("{untouched:?}"), "{error}");
    for i in BEFORE..BEFORE + AFTER {
        let after = slam.step(&drive.input(i), &mut |_| {}).unwrap();
        let expected = untouched.step(&drive.input(i), &mut |_| {}).unwrap();
        assert_eq!(after, expected, "frame {i}");
    }
    assert_eq!(slam.smoothed_path(), untouched.smoothed_path());
    assert_eq!(slam.landmarks(), untouched.landmarks());
    assert!(!slam.landmarks().is_empty(), "there was a map to damage");
}

fn with_method(method: Method) -> ValidConfig {
    let mut plain = (*config(20, 4)).clone();
    plain.filter.method = method;
    plain.check().unwrap()
}

const METHODS: [Method; 3] = [Method::Exact, Method::Paper, Method::Conventional];

#[test]
fn odometry_that_is_not_a_number() {
    for method in METHODS {
        leaves_no_trace(
            method,
            &|drive| {
                let mut odometry = drive.odometry[BEFORE - 1..BEFORE].to_vec();
                odometry.push(OdometryInterval {
                    v_mps: f64::NAN,
                    ..odometry[0]
                });
                (drive.features[BEFORE].clone(), odometry)
            },
            &|error| matches!(error, SlamError::Odometry(_)),
        );
    }
}

#[test]
fn descriptors_that_do_not_belong_to_the_keypoints() {
    leaves_no_trace(
        Method::Exact,
        &|drive| {
            let mut features = drive.features[BEFORE].clone();
            features.descriptors.pop();
            (features, drive.odometry[BEFORE - 1..BEFORE].to_vec())
        },
        &|error| {
            matches!(error, SlamError::Features { keypoints, descriptors, .. }
                if *keypoints == descriptors + 1)
        },
    );
}

#[test]
fn odometry_too_large_for_its_covariance() {
    leaves_no_trace(
        Method::Exact,
        &|drive| {
            let absurd = OdometryInterval {
                v_mps: 1e200,
                ..drive.odometry[BEFORE - 1]
            };
            (drive.features[BEFORE].clone(), vec![absurd])
        },
        &|error| matches!(error, SlamError::Odometry(_)),
    );
}
