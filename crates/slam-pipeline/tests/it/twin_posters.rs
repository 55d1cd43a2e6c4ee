//! The same poster in two places of a wall.

use std::collections::BTreeSet;

use slam_pipeline::config::Config;
use slam_pipeline::{FrameInput, KeypointFate, Slam, Tracking};
use vision_sift::Features;
use wall_scenes::SceneSpec;

use crate::rendered::{error, rig, there_and_back};

/// Frames of the way there: a longer wall, so that the first poster has not been seen for fifteen keyframes when the second
/// one comes.
const FORWARDS: usize = 76;
/// The lens is covered in these frames, and opened before the second poster, of which nothing is in the map.
const COVERED: std::ops::Range<usize> = 45..57;
/// Distance below which an estimate is at its place and not at the twin's, which is almost four metres away.
const AT_ITS_PLACE_M: f64 = 0.2;
/// Matches with what was mapped before the cover that are a place found again.
const FOUND: usize = 100;

/// A robot maps the first poster, drives on with its lens covered, and sees the second one, which looks the same to the last
/// pixel: nothing may join the two places. Then it drives back to the first one, and that is found.
///
/// Where any place is believed, whatever of it is found and however far the path has to move, the first frame of sight joins
/// the two and ends 0.2 m off.
#[test]
fn twin_posters_are_two_places_and_a_return_is_one() {
    let spec = SceneSpec {
        twin_posters: true,
        frames: FORWARDS,
        ..SceneSpec::wall(5)
    };
    let frames = there_and_back(spec, 18);
    let nothing = Features::default();
    let mut slam = Slam::new(rig(), &Config::default().check().unwrap()).unwrap();
    let mut first_part = BTreeSet::new();
    let mut most_found = 0;
    for (index, frame) in frames.iter().enumerate() {
        let covered = COVERED.contains(&index);
        if index == COVERED.start {
            first_part = slam.landmarks().iter().map(|l| l.id).collect();
        }
        let input = FrameInput {
            features: if covered { &nothing } else { &frame.features },
            odometry: &frame.odometry,
        };
        let report = slam.step(&input, &mut |_| {}).unwrap();
        let (metres, sigmas) = error(&report, &frame.truth);
        let of_first_part = report
            .keypoints
            .iter()
            .filter(|k| k.fate == KeypointFate::Matched)
            .filter_map(|k| k.landmark)
            .filter(|id| first_part.contains(id))
            .count();
        let told = format!(
            "frame {index}, {}: {metres:.3} m, {sigmas:.1} sigma, revisit {}, {} matches, {of_first_part} of the first part",
            report.tracking.name(),
            report.revisit,
            report.matches,
        );
        assert!(metres < AT_ITS_PLACE_M && sigmas < 4.5, "{told}");
        if index < FORWARDS {
            let joins = report.revisit || report.tracking == Tracking::Relocalised;
            assert!(!joins, "{told}");
        } else {
            most_found = most_found.max(of_first_part);
        }
    }
    assert!(
        first_part.len() > 500 && most_found > FOUND,
        "{} landmarks, {most_found} found again",
        first_part.len()
    );
}
