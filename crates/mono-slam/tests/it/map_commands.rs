//! Maps that outlive their run: localising in one, beginning in one, and the faults of both.

use std::fs;
use std::path::Path;

use slam_io::{Sequence, read_known_map, read_map, read_run};
use slam_pipeline::Tracking;

use crate::commands::{Scratch, assert_refused, code, mono_slam, stderr};
use crate::going_on::{assert_same_results, broken_wall, checkpoint_of, run_command, text, wall};

/// `localize` with few particles.
fn localize(map: &Path, out: &Path, more: &[&str]) -> std::process::Output {
    let sequence = wall();
    let mut arguments = vec!["localize", text(&sequence), "--map", text(map)];
    arguments.extend(["--out", text(out), "--particles", "8"]);
    arguments.extend(more);
    mono_slam(&arguments)
}

/// Largest distance of a pose from the truth, over the frames at which the robot knows where it is; their number.
fn largest_error_m(run: &Path) -> (f64, usize) {
    let record = read_run(run).unwrap();
    let truth = Sequence::open(&wall()).unwrap().reference.unwrap();
    let found: Vec<f64> = record
        .frames
        .iter()
        .zip(&truth)
        .filter(|(frame, _)| frame.report.tracking != Tracking::Lost)
        .map(|(frame, (_, true_pose))| {
            let pose = frame.report.estimate.pose;
            (pose.x - true_pose.x).hypot(pose.y - true_pose.y)
        })
        .collect();
    (found.iter().copied().fold(0.0, f64::max), found.len())
}

#[test]
fn a_robot_is_found_in_the_map_of_an_earlier_run_which_stays_as_it_is() {
    let scratch = Scratch::new();
    let (first, second) = (scratch.path().join("first"), scratch.path().join("second"));
    assert_eq!(code(&run_command(&wall(), &first, &[])), 0);
    let map = first.join("map.slam");
    let before = fs::read(&map).unwrap();
    let known = read_known_map(&map).unwrap();
    assert!(known.landmarks.len() > 100 && known.keyframes.len() > 2);
    assert_eq!(
        read_map(&map).unwrap(),
        read_run(&first).unwrap().landmarks,
        "readers of points see the same landmarks"
    );
    let localized = localize(&map, &second, &[]);
    let told = stderr(&localized);
    assert_eq!(code(&localized), 0, "{told}");
    assert!(
        told.contains("[reference-of-another-origin]")
            && told.contains("(no alignment, in the world of the map)"),
        "{told}"
    );
    assert!(!told.contains("map-camera-differs"), "{told}");
    assert_eq!(fs::read(&map).unwrap(), before);
    // Both drives begin at the same place, so the truth is that of the map, too.
    let (error, found) = largest_error_m(&second);
    assert!(error < 0.05 && found >= 15, "{error} m, {found} frames");
    let again = read_known_map(&second.join("map.slam")).unwrap();
    assert_eq!(
        again.landmarks.len(),
        known.landmarks.len(),
        "nothing is mapped"
    );
}

#[test]
fn a_run_that_begins_in_a_map_extends_it_and_goes_on_to_the_same_bytes() {
    let scratch = Scratch::new();
    let path = |name: &str| scratch.path().join(name);
    let first = path("first");
    assert_eq!(code(&run_command(&wall(), &first, &[])), 0);
    let map = first.join("map.slam");
    let in_map = ["--map", text(&map)];
    let (whole, out) = (path("whole"), path("out"));
    let extended = run_command(&wall(), &whole, &in_map);
    assert_eq!(code(&extended), 0, "{}", stderr(&extended));
    let (error, found) = largest_error_m(&whole);
    assert!(error < 0.05 && found >= 15, "{error} m, {found} frames");
    let (before, after) = (
        read_known_map(&map).unwrap(),
        read_known_map(&whole.join("map.slam")).unwrap(),
    );
    assert!(after.keyframes.len() > before.keyframes.len());
    // The same drive, broken off and mended.
    let (sequence, whole_image) = broken_wall(&scratch);
    assert_eq!(code(&run_command(&sequence, &out, &in_map)), 2);
    assert!(checkpoint_of(&out).exists());
    let name = whole_image.file_name().unwrap();
    fs::copy(&whole_image, sequence.join("images").join(name)).unwrap();
    // In another map it is another run.
    assert_refused(
        &run_command(&sequence, &out, &["--resume"]),
        2,
        "it is of another run: the map was `extended, checksum ",
    );
    let resumed = run_command(&sequence, &out, &[&in_map[..], &["--resume"]].concat());
    assert_eq!(code(&resumed), 0, "{}", stderr(&resumed));
    assert!(
        stderr(&resumed).contains("going on after "),
        "{}",
        stderr(&resumed)
    );
    assert_same_results(&whole, &out);
}

#[test]
fn another_camera_and_maps_that_are_none_are_told_in_one_sentence() {
    let scratch = Scratch::new();
    let path = |name: &str| scratch.path().join(name);
    let first = path("first");
    assert_eq!(code(&run_command(&wall(), &first, &[])), 0);
    let map = first.join("map.slam");
    let camera = fs::read_to_string(wall().join("camera.toml")).unwrap();
    let fx = camera.lines().find(|line| line.starts_with("fx")).unwrap();
    let value: f64 = fx.split('=').nth(1).unwrap().trim().parse().unwrap();
    let other = scratch.file(
        "other.toml",
        &camera.replace(fx, &format!("fx = {}", value * 1.01)),
    );
    let told = stderr(&localize(&map, &path("second"), &["--camera", &other]));
    assert!(
        told.contains(
            "[map-camera-differs] The map was made with another camera: the same rays are up to "
        ) && told.contains(&format!(
            " px apart (fx {value} then, fx {} now)",
            value * 1.01
        )),
        "{told}"
    );
    assert_refused(
        &localize(&map, &path("x"), &["--method", "conventional"]),
        2,
        "map: the method conventional does not find its place in one",
    );
    let nowhere = path("nowhere.slam");
    assert_refused(
        &localize(&nowhere, &path("x"), &[]),
        2,
        "nowhere.slam: cannot be read",
    );
    let mut bytes = fs::read(&map).unwrap();
    bytes[8] = 3;
    fs::write(path("newer.slam"), &bytes).unwrap();
    assert_refused(
        &localize(&path("newer.slam"), &path("x"), &[]),
        2,
        "newer.slam: expected map format version 2 or older, found version 3.0",
    );
    bytes[8] = 2;
    bytes[1000] ^= 1;
    fs::write(path("damaged.slam"), &bytes).unwrap();
    assert_refused(
        &localize(&path("damaged.slam"), &path("x"), &[]),
        2,
        "the file is damaged or cut short",
    );
    assert!(!path("x").exists());
}
