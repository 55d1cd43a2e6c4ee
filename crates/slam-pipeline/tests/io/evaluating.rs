//! Errors agree with `evo` digit for digit, and with closed forms.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use slam_pipeline::evaluation::{
    Alignment, EvaluationError, Statistics, absolute_error, align_positions, associate,
    relative_error, spatial,
};
use slam_pipeline::record::PlanarPose;
use slam_pipeline::sequence::{StampedPose, read_tum};

fn reference_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference")
}

fn trajectory(name: &str) -> Vec<StampedPose> {
    read_tum(&reference_folder().join(name)).unwrap()
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
    let path: Vec<_> = times_s
        .iter()
        .map(|&t_s| {
            (
                t_s,
                PlanarPose {
                    x: t_s,
                    y: 0.0,
                    phi: 0.0,
                },
            )
        })
        .collect();
    spatial(&path)
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
        "no pose of the estimate (1 poses) lies within 0.01 s of one of the reference (5 poses)"
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

fn config() -> ProptestConfig {
    ProptestConfig {
        cases: 64,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(config())]

    /// A similarity applied to a cloud is found again, and no small turn of it does better.
    #[test]
    fn a_similarity_is_recovered(
        cloud in prop::collection::vec(prop::array::uniform3(-5.0..5.0_f64), 4..20),
        angles in prop::array::uniform3(-3.0..3.0_f64),
        offset in prop::array::uniform3(-100.0..100.0_f64),
        scale in 0.1..10.0_f64,
    ) {
        let cloud: Vec<Vector3<f64>> = cloud.into_iter().map(Vector3::from).collect();
        let rotation = UnitQuaternion::from_euler_angles(angles[0], angles[1], angles[2]);
        let moved: Vec<_> = cloud.iter().map(|point| rotation * point * scale + Vector3::from(offset)).collect();
        let found = align_positions(&cloud, &moved, Alignment::Sim3).unwrap();
        prop_assert!((found.scale / scale - 1.0).abs() < 1e-10);
        prop_assert!(found.reference_from_estimate.rotation.angle_to(&rotation) < 1e-6);
        for (point, target) in cloud.iter().zip(&moved) {
            let aligned = found.apply(&Isometry3::translation(point.x, point.y, point.z));
            prop_assert!((aligned.translation.vector - target).norm() < 1e-6);
        }
    }

    /// The rigid alignment is a minimum: neighbours of it have a larger sum of squares.
    #[test]
    fn the_alignment_is_a_minimum(
        cloud in prop::collection::vec(prop::array::uniform3(-5.0..5.0_f64), 5..20),
        noise in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 20),
        turn in prop::array::uniform3(-0.01..0.01_f64),
        shift in prop::array::uniform3(-0.01..0.01_f64),
        planar in prop::bool::ANY,
    ) {
        let from: Vec<Vector3<f64>> = cloud.into_iter().map(Vector3::from).collect();
        let to: Vec<Vector3<f64>> = from.iter().zip(&noise).map(|(point, noise)| point + Vector3::from(*noise)).collect();
        let alignment = if planar { Alignment::Se2 } else { Alignment::Se3 };
        let best = align_positions(&from, &to, alignment).unwrap().reference_from_estimate;
        let cost = |motion: &Isometry3<f64>| -> f64 {
            from.iter().zip(&to).map(|(from, to)| (motion.rotation * from + motion.translation.vector - to).norm_squared()).sum()
        };
        let (turn, shift) = if planar { ([0.0, 0.0, turn[2]], [shift[0], shift[1], 0.0]) } else { (turn, shift) };
        let neighbour = Isometry3::new(Vector3::from(shift), Vector3::from(turn)) * best;
        prop_assert!(cost(&best) <= cost(&neighbour) * (1.0 + 1e-12));
    }
}
