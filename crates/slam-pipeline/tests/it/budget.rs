//! The budget of the map: landmarks leave, the pose stays.

use nalgebra::Vector2;
use slam_pipeline::config::ValidConfig;
use slam_pipeline::{KeypointFate, Slam};
use std::collections::BTreeSet;

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
    limited.mapping.max_landmarks = 150;
    let (all, few) = (
        run(&drive, &unlimited),
        run(&drive, &limited.check().unwrap()),
    );
    let last = FRAMES - 1;
    // About a hundred landmarks are in view; a budget of 150 holds these and some of those that were left behind.
    assert!(all.landmarks[last] > 250, "{:?}", all.landmarks);
    assert!(few.landmarks[last] < 200, "{:?}", few.landmarks);
    assert_eq!(all.landmarks[..5], few.landmarks[..5]);
    // A robot that does not turn back misses none of them.
    assert!(few.matches as f64 > 0.97 * all.matches as f64);
    assert!(drive.rmse(&few.path) < drive.rmse(&all.path) + 0.01);
}
