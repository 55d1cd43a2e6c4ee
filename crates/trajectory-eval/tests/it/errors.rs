//! Errors agree with `evo` digit for digit, and with closed forms.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use trajectory_eval::{
    Alignment, EvaluationError, StampedPose, Statistics, absolute_error, associate, relative_error,
};

fn reference_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference")
}

fn trajectory(name: &str) -> Vec<StampedPose> {
    let text = std::fs::read_to_string(reference_folder().join(name)).unwrap();
    text.lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            let numbers: Vec<f64> = line
                .split_whitespace()
                .map(|cell| cell.parse().unwrap())
                .collect();
            let [t_s, x, y, z, qx, qy, qz, qw] = numbers.try_into().unwrap();
            StampedPose {
                t_s,
                world_from_frame: Isometry3::from_parts(
                    Translation3::new(x, y, z),
                    UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz)),
                ),
            }
        })
        .collect()
}

fn numbers() -> serde_json::Value {
    let text = std::fs::read_to_string(reference_folder().join("evo_numbers.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn assert_figures(ours: &Statistics, evo: &serde_json::Value, what: &str) {
    let figures = [
        ("rmse", ours.rmse),
        ("mean", ours.mean),
        ("median", ours.median),
        ("std", ours.std),
        ("min", ours.min),
        ("max", ours.max),
    ];
    for (name, value) in figures {
        let expected = evo[name].as_f64().unwrap();
        // evo takes angles from matrices through an arc cosine, which loses half the digits.
        assert!(
            (value - expected).abs() < 2e-8,
            "{what} {name}: {value} against {expected}"
        );
    }
}

/// Every figure of one pair of trajectories under one alignment.
fn assert_like_evo(kind: &str, alignment: Alignment, label: &str) {
    let reference = trajectory(&format!("evo_{kind}_reference.tum"));
    let estimate = trajectory(&format!("evo_{kind}_estimate.tum"));
    let evo = &numbers()[kind][label];
    let absolute = absolute_error(&estimate, &reference, alignment).unwrap();
    assert_eq!(
        absolute.matched.len() as u64,
        evo["pairs"].as_u64().unwrap()
    );
    assert_figures(
        &absolute.translation_m,
        &evo["ape_translation"],
        &format!("{kind} {label} APE"),
    );
    assert_figures(
        &absolute.rotation_rad,
        &evo["ape_rotation"],
        &format!("{kind} {label} APE angle"),
    );
    let final_m = evo["ape_translation_final"].as_f64().unwrap();
    assert!((absolute.last().translation_m - final_m).abs() < 1e-9);
    for delta in [1, 5] {
        let relative = relative_error(&estimate, &reference, delta, alignment).unwrap();
        let what = format!("{kind} {label} RPE {delta}");
        assert_figures(
            &relative.translation_m,
            &evo[format!("rpe{delta}_translation")],
            &what,
        );
        assert_figures(
            &relative.rotation_rad,
            &evo[format!("rpe{delta}_rotation")],
            &what,
        );
    }
}

#[test]
fn val_evo_without_alignment() {
    assert_like_evo("spatial", Alignment::None, "none");
    assert_like_evo("planar", Alignment::None, "none");
}

#[test]
fn val_evo_rigid_alignment() {
    assert_like_evo("spatial", Alignment::Se3, "se3");
    assert_like_evo("planar", Alignment::Se3, "se3");
    // In the plane the planar alignment is the spatial one.
    assert_like_evo("planar", Alignment::Se2, "se3");
}

#[test]
fn val_evo_similarity_alignment() {
    assert_like_evo("spatial", Alignment::Sim3, "sim3");
    assert_like_evo("planar", Alignment::Sim3, "sim3");
}

fn straight(times_s: &[f64]) -> Vec<StampedPose> {
    times_s
        .iter()
        .map(|&t_s| StampedPose::planar(t_s, t_s, 0.0, 0.0))
        .collect()
}

#[test]
fn association_takes_the_nearest_and_drops_the_far() {
    let reference = straight(&[0.0, 0.1, 0.2, 0.3, 0.4]);
    let estimate = straight(&[0.009, 0.111, 0.195]);
    let pairs = associate(&estimate, &reference).unwrap();
    let times: Vec<_> = pairs
        .iter()
        .map(|(estimate, reference)| (estimate.t_s, reference.t_s))
        .collect();
    assert_eq!(times, [(0.009, 0.0), (0.195, 0.2)]);
    // The other way round the reference is the shorter one and still comes second.
    let pairs = associate(&reference, &estimate).unwrap();
    let times: Vec<_> = pairs
        .iter()
        .map(|(estimate, reference)| (estimate.t_s, reference.t_s))
        .collect();
    assert_eq!(times, [(0.0, 0.009), (0.2, 0.195)]);
    let message = associate(&straight(&[5.0]), &reference)
        .unwrap_err()
        .to_string();
    assert_eq!(
        message,
        "no pose of the estimate (1 poses at 5 s) lies within 0.01 s of one of the reference (5 poses from 0 to 0.4 s); the two \
         do not overlap in time and have 4.600 s between them: another clock?"
    );
}

#[test]
fn what_a_straight_line_leaves_open() {
    let line = straight(&[0.0, 0.1, 0.2, 0.3]);
    for alignment in [Alignment::Se3, Alignment::Sim3] {
        let error = absolute_error(&line, &line, alignment).unwrap_err();
        assert!(
            matches!(error, EvaluationError::Degenerate { poses: 4, .. }),
            "{error}"
        );
    }
    // In the plane a line fixes everything; a robot that stood still fixes nothing.
    let turned: Vec<_> = line
        .iter()
        .map(|pose| StampedPose {
            world_from_frame: Isometry3::from_parts(
                Translation3::new(3.0, 4.0, 0.0),
                UnitQuaternion::from_euler_angles(0.0, 0.0, 2.0),
            ) * pose.world_from_frame,
            ..*pose
        })
        .collect();
    let error = absolute_error(&turned, &line, Alignment::Se2).unwrap();
    assert!(error.translation_m.max < 1e-14 && error.rotation_rad.max < 1e-14);
    let mut still = line.clone();
    for pose in &mut still {
        pose.world_from_frame = Isometry3::translation(1.0, 2.0, 0.0);
    }
    let message = absolute_error(&still, &line, Alignment::Se2)
        .unwrap_err()
        .to_string();
    assert_eq!(
        message,
        "the se2 alignment is not determined by 4 matched positions: they all coincide"
    );
}

#[test]
fn steps_longer_than_the_path_are_refused() {
    let line = straight(&[0.0, 0.1, 0.2]);
    for delta in [0, 3, usize::MAX] {
        let error = relative_error(&line, &line, delta, Alignment::None).unwrap_err();
        assert_eq!(error, EvaluationError::TooShort { delta, poses: 3 });
        assert!(!error.to_string().is_empty());
    }
    assert_eq!(
        relative_error(&line, &line, 2, Alignment::None)
            .unwrap()
            .steps,
        1
    );
}
