//! Faults of what an earlier run has left: its map and its checkpoint.

use std::fs;
use std::sync::LazyLock;

use super::Outcome::{Refused, Warned};
use super::{Fault, Input, UNDAMAGED, assert_outcomes, break_frame_2, row};
use crate::commands::{code, stderr};

const MAP: &str = "map.slam";
const CHECKPOINT: &str = "out.checkpoint";
const IN_MAP: &[&str] = &["--map", MAP];
const GOING_ON: &[&str] = &["--resume"];

/// The map of the undamaged run.
static MADE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let input = Input::new();
    assert_eq!(code(&input.run(&[])), 0);
    input.bytes("out/map.slam")
});

/// The checkpoint of a run that stops before its third frame, which is broken in the middle.
static STOPPED: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let input = Input::new();
    break_frame_2(&input);
    let output = input.run(&[]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    input.bytes(CHECKPOINT)
});

fn map(input: &Input, change: impl Fn(&mut Vec<u8>)) {
    let mut bytes = MADE.clone();
    change(&mut bytes);
    assert!(bytes != *MADE);
    input.write(MAP, bytes);
}

fn checkpoint(input: &Input, change: impl Fn(&mut Vec<u8>)) {
    let mut bytes = STOPPED.clone();
    change(&mut bytes);
    input.write(CHECKPOINT, bytes);
}

/// Flips a bit in the middle of a section.
fn flip(bytes: &mut [u8], section: &[u8; 4]) {
    let mut at = 16;
    while bytes[at..at + 4] != *section {
        let length = u64::from_le_bytes(bytes[at + 4..at + 12].try_into().unwrap());
        at += 12 + length as usize;
    }
    let length = u64::from_le_bytes(bytes[at + 4..at + 12].try_into().unwrap()) as usize;
    bytes[at + 12 + length / 2] ^= 0x10;
}

/// Makes the checksum at the end fit again.
fn seal(bytes: &mut [u8]) {
    let content = bytes.len() - 4;
    let sum = super::crc32(&bytes[..content]);
    bytes[content..].copy_from_slice(&sum.to_le_bytes());
}

fn maps() -> Vec<Fault> {
    let row = |what, damage, outcome| row(what, damage, outcome).with(IN_MAP);
    vec![
        row(
            "it is missing",
            |_| (),
            Refused(&["map.slam: cannot be read: No such file or directory"]),
        ),
        row(
            "it is empty",
            |i| i.write(MAP, ""),
            Refused(&["map.slam: expected a map starting with MONOSLAM, found 0 bytes"]),
        ),
        row(
            "it is a folder",
            |i| fs::create_dir(i.path(MAP)).unwrap(),
            Refused(&["map.slam: cannot be read: Is a directory"]),
        ),
        row(
            "it is an image",
            |i| i.write(MAP, i.bytes("seq/images/000000.png")),
            Refused(&["map.slam: expected a map starting with MONOSLAM, found other bytes"]),
        ),
        row(
            "it is cut in its header",
            |i| map(i, |b| b.truncate(11)),
            Refused(&["map.slam: expected a map of at least 20 bytes, found 11 bytes"]),
        ),
        row(
            "it is cut in its first section",
            |i| map(i, |b| b.truncate(200)),
            Refused(&[
                "map.slam: expected checksum ",
                "the file is damaged or cut short",
            ]),
        ),
        row(
            "it is cut by half",
            |i| map(i, |b| b.truncate(b.len() / 2)),
            Refused(&[
                "map.slam: expected checksum ",
                "the file is damaged or cut short",
            ]),
        ),
        row(
            "it lacks its last byte",
            |i| map(i, |b| b.truncate(b.len() - 1)),
            Refused(&[
                "map.slam: expected checksum ",
                "the file is damaged or cut short",
            ]),
        ),
        row(
            "it has a byte too many",
            |i| map(i, |b| b.push(0)),
            Refused(&[
                "map.slam: expected checksum ",
                "the file is damaged or cut short",
            ]),
        ),
        row(
            "a landmark is damaged",
            |i| map(i, |b| flip(b, b"LAND")),
            Refused(&[
                "map.slam: expected checksum ",
                "the file is damaged or cut short",
            ]),
        ),
        row(
            "its camera is damaged",
            |i| map(i, |b| flip(b, b"CAME")),
            Refused(&[
                "map.slam: expected checksum ",
                "the file is damaged or cut short",
            ]),
        ),
        row(
            "a keyframe is damaged",
            |i| map(i, |b| flip(b, b"KEYF")),
            Refused(&[
                "map.slam: expected checksum ",
                "the file is damaged or cut short",
            ]),
        ),
        row(
            "a covariance is damaged",
            |i| map(i, |b| flip(b, b"ERRS")),
            Refused(&[
                "map.slam: expected checksum ",
                "the file is damaged or cut short",
            ]),
        ),
        row(
            "a descriptor is damaged",
            |i| map(i, |b| flip(b, b"ANCH")),
            Refused(&[
                "map.slam: expected checksum ",
                "the file is damaged or cut short",
            ]),
        ),
        row(
            "its length of a section is huge",
            |i| {
                map(i, |b| {
                    b[20..28].fill(0xff);
                    seal(b);
                });
            },
            Refused(&["map.slam: expected 18446744073709551615 bytes of section \"LAND\", found "]),
        ),
        row(
            "it has four thousand million sections",
            |i| {
                map(i, |b| {
                    b[12..16].fill(0xff);
                    seal(b);
                });
            },
            Refused(&["map.slam: expected 4294967295 sections, found "]),
        ),
        row(
            "it is of a newer major version",
            |i| {
                map(i, |b| {
                    b[8] = 9;
                    seal(b);
                });
            },
            Refused(&["map.slam: expected map format version 2 or older, found version 9.0"]),
        ),
        row(
            "it is of a newer minor version",
            |i| {
                map(i, |b| {
                    b[10] = 9;
                    seal(b);
                });
            },
            Warned(&["reference-of-another-origin"]),
        ),
        row(
            "it is of another camera",
            |i| {
                i.write(MAP, &*MADE);
                i.replace("seq/camera.toml", "fx = 368.8262", "fx = 400.0");
            },
            Warned(&["map-camera-differs", "reference-of-another-origin"]),
        ),
        row(
            "it is of images of another size",
            |i| {
                map(i, |b| {
                    let at = 12 + b.windows(4).position(|w| w == b"CAME").unwrap();
                    b[at] ^= 0xff;
                    seal(b);
                });
            },
            Warned(&["map-camera-differs", "reference-of-another-origin"]),
        ),
        row(
            "it holds a landmark at no place",
            |i| {
                map(i, |b| {
                    let at = b.windows(4).position(|w| w == b"LAND").unwrap() + 12;
                    for byte in &mut b[at + 12..at + 20] {
                        *byte = 0xff;
                    }
                    seal(b);
                });
            },
            Refused(&["map.slam: expected a finite number as landmark 0, found NaN"]),
        ),
    ]
}

fn checkpoints() -> Vec<Fault> {
    let row = |what, damage, outcome| row(what, damage, outcome).with(GOING_ON);
    vec![
        row(
            "it is empty",
            |i| i.write(CHECKPOINT, ""),
            Refused(&[
                "out.checkpoint: expected a checkpoint starting with MONOCKPT, found 0 bytes",
            ]),
        ),
        row(
            "it is a folder",
            |i| fs::create_dir(i.path(CHECKPOINT)).unwrap(),
            Refused(&["out.checkpoint: cannot be read"]),
        ),
        row(
            "it is a map",
            |i| i.write(CHECKPOINT, &*MADE),
            Refused(&[
                "out.checkpoint: expected a checkpoint starting with MONOCKPT, found other bytes",
            ]),
        ),
        row(
            "it is cut in its header",
            |i| checkpoint(i, |b| b.truncate(10)),
            Refused(&["out.checkpoint: expected a whole checkpoint, found one cut short"]),
        ),
        row(
            "it is cut by half",
            |i| checkpoint(i, |b| b.truncate(b.len() / 2)),
            Refused(&["out.checkpoint: ", "the file is damaged or cut short"]),
        ),
        row(
            "it lacks its last byte",
            |i| checkpoint(i, |b| b.truncate(b.len() - 1)),
            Refused(&["out.checkpoint: ", "the file is damaged or cut short"]),
        ),
        row(
            "a bit is flipped",
            |i| {
                checkpoint(i, |b| {
                    let at = b.len() * 2 / 3;
                    b[at] ^= 1;
                });
            },
            Refused(&["out.checkpoint: ", "the file is damaged or cut short"]),
        ),
        row(
            "it is of another version",
            |i| {
                checkpoint(i, |b| {
                    b[8] = 7;
                    seal(b);
                });
            },
            Refused(&["out.checkpoint: expected ", "version 3"]),
        ),
        row(
            "its state is cut and its checksum fits",
            |i| {
                checkpoint(i, |b| {
                    let text = b.windows(4).rposition(|w| w == b"none").unwrap();
                    let length =
                        u64::from_le_bytes(b[text + 4..text + 12].try_into().unwrap()) - 100;
                    b[text + 4..text + 12].copy_from_slice(&length.to_le_bytes());
                    b.truncate(b.len() - 100);
                    seal(b);
                });
            },
            Refused(&["out.checkpoint: "]),
        ),
        row(
            "it is of other odometry",
            |i| {
                checkpoint(i, |_| ());
                i.line("seq/odometry.csv", 4, "0.2,0.3,0");
            },
            Refused(&["out.checkpoint: it is of another run: the odometry was "]),
        ),
        row(
            "it is of another camera",
            |i| {
                checkpoint(i, |_| ());
                i.replace("seq/camera.toml", "fx = 368.8262", "fx = 369");
            },
            Refused(&["out.checkpoint: it is of another run: the camera was "]),
        ),
        row(
            "it is of another seed",
            |i| checkpoint(i, |_| ()),
            Refused(&["out.checkpoint: it is of another run: the configuration was `seed = "]),
        )
        .with(&["--resume", "--seed", "5"]),
    ]
}

#[test]
fn faults_of_a_map_end_as_they_should() {
    assert_outcomes(&maps());
}

#[test]
fn faults_of_a_checkpoint_end_as_they_should() {
    assert_outcomes(&checkpoints());
}

/// The rows above speak of a map and a checkpoint that serve when nothing is wrong with them.
#[test]
fn what_was_stored_serves_undamaged() {
    let input = Input::new();
    input.write(MAP, &*MADE);
    let output = input.run(IN_MAP);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let input = Input::new();
    checkpoint(&input, |_| ());
    let output = input.run(GOING_ON);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(stderr(&output).contains("going on after 2 frames"));
    assert!(input.bytes("out/trajectory.tum") == *UNDAMAGED);
}
