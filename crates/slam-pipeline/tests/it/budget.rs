//! The budget of the map: landmarks leave, the pose stays; frames that show nothing take no memory.

use nalgebra::Vector2;
use slam_pipeline::config::{Method, ValidConfig};
use slam_pipeline::{FrameInput, KeypointFate, OdometryInterval, Slam};
use std::collections::BTreeSet;
use vision_sift::Features;

use crate::drive::{Drive, FRAMES, config, rig};

struct Outcome {
    path: Vec<Vector2<f64>>,
    landmarks: Vec<usize>,
    matches: usize,
}

fn run(drive: &Drive, config: &ValidConfig) -> Outcome {
    let mut slam = Slam::new(rig(), config).unwrap();
    let (mut path, mut landmarks, mut matches) = (Vec::new(), Vec::new(), 0);
    for frame in 0..FRAMES {
        let ids =
            |slam: &Slam| -> BTreeSet<u32> { slam.landmarks().iter().map(|l| l.id).collect() };
        let before = ids(&slam);
        let report = slam.step(&drive.input(frame), &mut |_| {}).unwrap();
        let after = ids(&slam);
        let matched = report
            .keypoints
            .iter()
            .filter(|k| k.fate == KeypointFate::Matched)
            .filter_map(|k| k.landmark);
        for id in matched.filter(|id| before.contains(id)) {
            assert!(
                after.contains(&id),
                "frame {frame}: {id} was matched and left"
            );
        }
        landmarks.push(report.landmarks);
        matches += report.matches;
        path.push(Vector2::new(report.estimate.pose.x, report.estimate.pose.y));
    }
    Outcome {
        path,
        landmarks,
        matches,
    }
}

#[test]
fn a_map_over_its_budget_lets_the_least_used_landmarks_out_of_view_go() {
    let drive = Drive::new(7);
    let unlimited = config(20, 7);
    let mut limited = (*unlimited).clone();
    limited.mapping.max_landmarks = 110;
    let (all, few) = (
        run(&drive, &unlimited),
        run(&drive, &limited.check().unwrap()),
    );
    let last = FRAMES - 1;
    // About a hundred landmarks are in view; a budget of 110 holds these and few of those that were left behind.
    assert!(all.landmarks[last] > 200, "{:?}", all.landmarks);
    assert!(few.landmarks[last] < 130, "{:?}", few.landmarks);
    assert_eq!(all.landmarks[..5], few.landmarks[..5]);
    // A robot that does not turn back misses none of them.
    assert!(few.matches as f64 > 0.97 * all.matches as f64);
    assert!(drive.rmse(&few.path) < drive.rmse(&all.path) + 0.01);
}

/// Every frame that showed nothing was a filter step of its own, with a pose in the path of every particle.
#[test]
fn regress_frames_that_show_nothing_are_no_keyframes() {
    const SEEING: usize = 12;
    const BLIND: usize = 1500;
    let drive = Drive::new(9);
    for (method, before) in [
        (Method::Exact, SEEING),
        (Method::Exact, 1),
        (Method::Conventional, SEEING),
    ] {
        let mut config = (*config(20, 7)).clone();
        config.filter.method = method;
        let mut slam = Slam::new(rig(), &config.check().unwrap()).unwrap();
        for frame in 0..before {
            slam.step(&drive.input(frame), &mut |_| {}).unwrap();
        }
        let landmarks = slam.landmarks().len();
        let nothing = Features::default();
        let still = [OdometryInterval {
            duration_s: 1.0,
            v_mps: 0.0,
            omega_radps: 0.0,
        }];
        let mut keyframes = 0;
        for _ in 0..BLIND {
            let input = FrameInput {
                features: &nothing,
                odometry: &still,
            };
            keyframes += usize::from(slam.step(&input, &mut |_| {}).unwrap().keyframe);
        }
        assert!(keyframes < 4, "{keyframes} with {method:?} after {before}");
        assert_eq!(slam.landmarks().len(), landmarks);
        assert_eq!(slam.smoothed_path().len(), before + BLIND);
        // It is where it was, and sees so.
        let report = slam.step(&drive.input(before), &mut |_| {}).unwrap();
        assert!(before == 1 || report.matches > 30, "{}", report.matches);
    }
}
