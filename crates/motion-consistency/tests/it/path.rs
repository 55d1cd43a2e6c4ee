//! A path that images corrected, against odometry that was wrong throughout.

use mono_geometry::Mount;
use motion_consistency::{Finding, check_path};

use crate::drive::Drive;

#[test]
fn a_turn_ratio_is_measured() {
    for omega in [0.5, 0.8, 1.25, 2.0] {
        let drive = Drive::new(1, Mount::forward());
        let findings = check_path(&drive.path, &drive.spoiled(1.0, omega, 0.0));
        let [Finding::PathTurnRatio { ratio, sigma, .. }] = findings[..] else {
            panic!("{omega}: {findings:?}");
        };
        assert!(
            (ratio * omega - 1.0).abs() < 5.0 * sigma * omega + 0.02,
            "{omega}: {ratio} +- {sigma}"
        );
    }
}

#[test]
fn a_clock_offset_is_measured() {
    for later_s in [-1.0, -0.3, 0.2, 0.6] {
        for seed in 0..5 {
            let drive = Drive::new(seed, Mount::forward());
            let findings = check_path(&drive.path, &drive.spoiled(1.0, 1.0, later_s));
            let [
                Finding::ClockOffset {
                    offset_s,
                    after_rad,
                    before_rad,
                    ..
                },
            ] = findings[..]
            else {
                panic!("seed {seed}, {later_s}: {findings:?}");
            };
            // The rows came too late by `later_s`: that is taken off again.
            assert!(
                (offset_s + later_s).abs() < 0.05,
                "seed {seed}, {later_s}: {offset_s}"
            );
            assert!(after_rad < 0.6 * before_rad);
        }
    }
}

#[test]
fn noise_of_the_odometry_is_no_ratio() {
    // Turns of one degree under noise of as much: the slope over the odometry alone would be 0.5.
    let drive = Drive::new(3, Mount::forward());
    let mut odometry = drive.spoiled(1.0, 1.0, 0.0);
    for (index, row) in odometry.iter_mut().enumerate() {
        row.omega_radps += if index / 5 % 2 == 0 { 0.25 } else { -0.25 };
    }
    let findings = check_path(&drive.path, &odometry);
    assert!(
        !findings.iter().any(|f| f.name() == "path-turn-ratio"),
        "{findings:?}"
    );
}
