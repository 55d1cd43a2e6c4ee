//! Drives whose odometry is as good as odometry is: nothing may be said.

use mono_geometry::{Mount, Pinhole};
use motion_consistency::{FramePair, check_motion, check_path};

use crate::drive::{CAMERA, Drive, looking_left};

#[test]
fn an_honest_drive_is_passed_in_silence() {
    for seed in 0..20 {
        for mount in [Mount::forward(), looking_left()] {
            let drive = Drive::new(seed, mount);
            let findings = check_motion(&drive.pairs, &drive.odometry, &CAMERA, &drive.mount);
            assert_eq!(findings, [], "seed {seed}");
            assert_eq!(check_path(&drive.path, &drive.odometry), [], "seed {seed}");
        }
    }
}

#[test]
fn too_little_is_passed_in_silence() {
    let drive = Drive::new(1, Mount::forward());
    let nothing = |pairs: &[FramePair], rows: usize, camera: &Pinhole| {
        check_motion(pairs, &drive.odometry[..rows], camera, &drive.mount).is_empty()
    };
    assert!(nothing(&[], drive.odometry.len(), &CAMERA));
    assert!(nothing(&drive.pairs, 0, &CAMERA));
    let mut blank = drive.pairs.clone();
    for pair in &mut blank {
        pair.matches.truncate(11);
    }
    assert!(nothing(&blank, drive.odometry.len(), &CAMERA));
    assert!(check_path(&drive.path[..1], &drive.odometry).is_empty());
    assert!(check_path(&drive.path, &[]).is_empty());
}

#[test]
fn driving_backwards_and_standing_still_are_no_contradictions() {
    let drive = Drive::new(2, Mount::forward());
    // The film runs backwards, and so do the wheels.
    let end_s = drive.path[drive.path.len() - 1].0;
    let pairs: Vec<FramePair> = drive
        .pairs
        .iter()
        .rev()
        .map(|pair| FramePair {
            from_s: end_s - pair.to_s,
            to_s: end_s - pair.from_s,
            matches: pair.matches.iter().map(|[a, b]| [*b, *a]).collect(),
        })
        .collect();
    let dt = drive.odometry[1].t_s;
    let mut odometry = drive.spoiled(-1.0, -1.0, 0.0);
    odometry.reverse();
    for (index, row) in odometry.iter_mut().enumerate() {
        row.t_s = index as f64 * dt;
    }
    assert_eq!(check_motion(&pairs, &odometry, &CAMERA, &drive.mount), []);
    // Nothing moves, and the wheels say so.
    let mut still = drive.pairs.clone();
    for pair in &mut still {
        for [from, to] in &mut pair.matches {
            *to = *from;
        }
    }
    assert_eq!(
        check_motion(&still, &drive.spoiled(0.0, 0.0, 0.0), &CAMERA, &drive.mount),
        []
    );
}

#[test]
fn numbers_that_are_none_do_not_panic() {
    let drive = Drive::new(3, Mount::forward());
    let mut pairs = drive.pairs.clone();
    for pair in &mut pairs {
        pair.matches[0][0].x = f64::NAN;
        pair.matches[1][1].y = f64::INFINITY;
    }
    let mut odometry = drive.odometry.clone();
    odometry[3].omega_radps = f64::NAN;
    odometry[7].v_mps = f64::INFINITY;
    let _ = check_motion(&pairs, &odometry, &CAMERA, &drive.mount);
    let _ = check_path(&drive.path, &odometry);
}
