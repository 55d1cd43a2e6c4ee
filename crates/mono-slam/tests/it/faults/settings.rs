//! Faults of the camera, of the configuration and of the arguments.

use std::fs;

use super::Outcome::{Refused, Same};
use super::{Fault, assert_outcomes, row};

const CAMERA: &str = "seq/camera.toml";
const CONFIGURED: &[&str] = &["--config", "slam.toml"];

fn camera() -> Vec<Fault> {
    vec![
        row(
            "a focal length is missing",
            |i| i.replace(CAMERA, "fx = 368.8262\n", ""),
            Refused(&["seq/camera.toml: expected the key fx, found none"]),
        ),
        row(
            "the width is missing",
            |i| i.replace(CAMERA, "width = 320\n", ""),
            Refused(&["seq/camera.toml: expected the key width, found none"]),
        ),
        row(
            "a focal length is negative",
            |i| i.replace(CAMERA, "fx = 368.8262", "fx = -368.8262"),
            Refused(&["seq/camera.toml: expected a positive fx, found -368.8262"]),
        ),
        row(
            "a focal length is zero",
            |i| i.replace(CAMERA, "fx = 368.8262", "fx = 0"),
            Refused(&["seq/camera.toml: expected a positive fx, found 0"]),
        ),
        row(
            "a focal length is no number",
            |i| i.replace(CAMERA, "fx = 368.8262", "fx = nan"),
            Refused(&["seq/camera.toml: expected a positive fx, found NaN"]),
        ),
        row(
            "a focal length is a word",
            |i| i.replace(CAMERA, "fx = 368.8262", "fx = \"long\""),
            Refused(&["seq/camera.toml, line 5: expected a number for fx, found \""]),
        ),
        row(
            "the model is unknown",
            |i| i.replace(CAMERA, "\"pinhole\"", "\"mirror\""),
            Refused(&["seq/camera.toml, line 4: expected model = \"pinhole\", found \"mirror\""]),
        ),
        row(
            "the distortion is unknown",
            |i| {
                i.edit(CAMERA, |t| {
                    format!("{t}[distortion]\nmodel = \"barrel\"\nk1 = 0.1\n")
                });
            },
            Refused(&[
                "seq/camera.toml, line 15: expected \"radtan\", \"rational\" or \"kannala-brandt\" as model of [distortion], found \"barrel\"",
            ]),
        ),
        row(
            "the distortion lacks a coefficient",
            |i| {
                i.edit(CAMERA, |t| {
                    format!("{t}[distortion]\nmodel = \"radtan\"\nk1 = 0.1\n")
                });
            },
            Refused(&[
                "seq/camera.toml: expected k2 in [distortion] for model \"radtan\", found none",
            ]),
        ),
        row(
            "the distortion folds the image",
            |i| {
                i.edit(CAMERA, |t| format!("{t}[distortion]\nmodel = \"radtan\"\nk1 = -30.0\nk2 = 0.0\np1 = 0.0\np2 = 0.0\nk3 = 0.0\n"));
            },
            Refused(&[
                "seq/camera.toml: expected a camera that can exist, found a lens (k1 = -30) that folds over",
            ]),
        ),
        row(
            "a key is unknown",
            |i| i.edit(CAMERA, |t| format!("focus = 3\n{t}")),
            Refused(&[
                "seq/camera.toml, line 1: expected one of the keys width, height, ",
                "in a camera.toml, found focus",
            ]),
        ),
        row(
            "a key is there twice",
            |i| i.edit(CAMERA, |t| format!("fx = 3\n{t}")),
            Refused(&["seq/camera.toml, line 6: expected fx once, found the key a second time"]),
        ),
        row(
            "it is not TOML",
            |i| i.write(CAMERA, "Dear aunt,\n"),
            Refused(&[
                "seq/camera.toml, line 1: expected key = value, or a section in brackets, found \"Dear aunt,\"",
            ]),
        ),
        row(
            "it is empty",
            |i| i.write(CAMERA, ""),
            Refused(&["seq/camera.toml: expected the key width, found none"]),
        ),
        row(
            "it is cut",
            |i| i.cut(CAMERA, 60),
            Refused(&[
                "seq/camera.toml, line 11: expected a value of TOML for position_in_body, found \"[0.1001742, -0.002103\"",
            ]),
        ),
        row(
            "it is zeros, as a disk leaves them",
            |i| i.write(CAMERA, [0; 300]),
            Refused(&["seq/camera.toml, line 1: expected key = value"]),
        ),
        row(
            "it is missing",
            |i| i.remove(CAMERA),
            Refused(&[
                "seq/camera.toml: not found; it holds the calibration of the camera",
                "mono-slam calibrate",
            ]),
        ),
        row(
            "it is a folder",
            |i| i.folder(CAMERA),
            Refused(&["seq/camera.toml: cannot be read: Is a directory"]),
        ),
        row(
            "the size is another than that of the images",
            |i| i.replace(CAMERA, "width = 320", "width = 640"),
            Refused(&[
                "seq/images/000000.png: expected 640x240 pixels as camera.toml says, found 320x240",
            ]),
        ),
        row(
            "the size is huge",
            |i| i.replace(CAMERA, "width = 320", "width = 4000000000"),
            Refused(&["seq/camera.toml: expected width from 1 to 65535, found 4000000000"]),
        ),
        row(
            "the size is negative",
            |i| i.replace(CAMERA, "width = 320", "width = -320"),
            Refused(&[
                "seq/camera.toml, line 2: expected a whole number for width, found \"-320\"",
            ]),
        ),
        row(
            "the rotation is none",
            |i| i.replace(CAMERA, "[1.0, 0.0, 0.0]", "[1.0, 1.0, 0.0]"),
            Refused(&[
                "seq/camera.toml, line 13: expected ",
                "rotation_body_from_camera in [mount]",
                "found a deviation of 1",
            ]),
        ),
        row(
            "the rotation is a reflection",
            |i| i.replace(CAMERA, "[1.0, 0.0, 0.0]", "[-1.0, 0.0, 0.0]"),
            Refused(&[
                "seq/camera.toml, line 13: expected a right-handed rotation_body_from_camera in [mount] (determinant +1), found a determinant of -1",
            ]),
        ),
        row(
            "the rotation has two rows",
            |i| i.replace(CAMERA, "[[1.0, 0.0, 0.0], ", "["),
            Refused(&[
                "seq/camera.toml, line 13: expected a value of TOML for rotation_body_from_camera, found \"[[0.0",
            ]),
        ),
        row(
            "the position is beyond the house",
            |i| i.replace(CAMERA, "0.9]", "900.0]"),
            Refused(&[
                "seq/camera.toml, line 11: expected metres within 50 of the robot's centre as position_in_body in [mount], found 900: are these millimetres?",
            ]),
        ),
        row(
            "it ends in CRLF behind a byte order mark",
            |i| i.edit(CAMERA, |t| format!("\u{feff}{}", t.replace('\n', "\r\n"))),
            Same,
        ),
        row(
            "it is that of Kalibr",
            |i| {
                i.write(CAMERA, "cam0:\n  camera_model: pinhole\n  intrinsics: [458.6, 457.3, 367.2, 248.4]\n  resolution: [752, 480]\n");
            },
            Refused(&[
                "seq/camera.toml: expected a camera.toml, found a Kalibr camchain, which `mono-slam camera seq/camera.toml --out seq/camera.toml` converts",
            ]),
        ),
    ]
}

fn configuration() -> Vec<Fault> {
    let row = |what, damage, outcome| row(what, damage, outcome).with(CONFIGURED);
    vec![
        row(
            "a key is unknown",
            |i| i.write("slam.toml", "[filter]\nparticels = 8\n"),
            Refused(&[
                "slam.toml, line 2: expected one of the keys method, particles, ",
                "in [filter], found particels",
            ]),
        ),
        row(
            "a section is unknown",
            |i| i.write("slam.toml", "[filters]\nparticles = 8\n"),
            Refused(&[
                "slam.toml, line 1: expected one of the keys filter, robot, ",
                "in a configuration, found [filters]",
            ]),
        ),
        row(
            "a value is out of its range",
            |i| i.write("slam.toml", "[mapping]\nmax_landmarks = 0\n"),
            Refused(&[
                "slam.toml, line 2: expected 50 to 10000000 for mapping.max_landmarks, found 0",
            ]),
        ),
        row(
            "a value is negative",
            |i| i.write("slam.toml", "[mapping]\nmax_landmarks = -5\n"),
            Refused(&[
                "slam.toml, line 2: expected a whole number, 50 to 10000000 for mapping.max_landmarks, found \"-5\"",
            ]),
        ),
        row(
            "a value is a word",
            |i| i.write("slam.toml", "[mapping]\nmax_landmarks = \"many\"\n"),
            Refused(&[
                "slam.toml, line 2: expected a whole number, 50 to 10000000 for mapping.max_landmarks, found \"\\\"many\\\"\"",
            ]),
        ),
        row(
            "a value has decimals",
            |i| i.write("slam.toml", "[mapping]\nmax_landmarks = 4.5\n"),
            Refused(&[
                "slam.toml, line 2: expected a whole number, 50 to 10000000 for mapping.max_landmarks, found \"4.5\"",
            ]),
        ),
        row(
            "a value is no number",
            |i| i.write("slam.toml", "[features]\nsigma_px = nan\n"),
            Refused(&[
                "slam.toml, line 2: expected ",
                "for features.sigma_px, found NaN",
            ]),
        ),
        row(
            "a key is there twice",
            |i| {
                i.write(
                    "slam.toml",
                    "[mapping]\nmax_landmarks = 4\nmax_landmarks = 4\n",
                );
            },
            Refused(&[
                "slam.toml, line 3: expected max_landmarks once, found the key a second time",
            ]),
        ),
        row(
            "it is not TOML",
            |i| i.write("slam.toml", "Dear aunt,\n"),
            Refused(&[
                "slam.toml, line 1: expected key = value, or a section in brackets, found \"Dear aunt,\"",
            ]),
        ),
        row(
            "it is a folder",
            |i| fs::create_dir(i.path("slam.toml")).unwrap(),
            Refused(&["slam.toml: cannot be read: Is a directory"]),
        ),
        row(
            "it is missing",
            |_| (),
            Refused(&["slam.toml: cannot be read: No such file or directory"]),
        ),
        row(
            "it has a foreign byte",
            |i| i.write("slam.toml", b"# d\xe9but\n"),
            Refused(&["slam.toml: expected UTF-8 text, found a foreign byte at offset 3"]),
        ),
        row("it is empty", |i| i.write("slam.toml", ""), Same),
        row(
            "it ends in CRLF behind a byte order mark",
            |i| i.write("slam.toml", "\u{feff}[filter]\r\nparticles = 8\r\n"),
            Same,
        ),
        row(
            "it is the camera",
            |i| i.write("slam.toml", i.bytes(CAMERA)),
            Refused(&["slam.toml, line ", "in a configuration, found "]),
        ),
    ]
}

fn arguments() -> Vec<Fault> {
    vec![
        row(
            "the sequence is missing",
            |i| fs::remove_dir_all(i.path("seq")).unwrap(),
            Refused(&["seq: expected a sequence folder, found nothing"]),
        ),
        row(
            "the sequence is a file",
            |i| {
                fs::remove_dir_all(i.path("seq")).unwrap();
                i.write("seq", "x");
            },
            Refused(&["seq: expected a sequence folder, found a file"]),
        ),
        row(
            "the sequence is empty",
            |i| {
                fs::remove_dir_all(i.path("seq")).unwrap();
                fs::create_dir(i.path("seq")).unwrap();
            },
            Refused(&[
                "seq: expected a sequence (a folder with images/, ",
                "found an empty folder",
            ]),
        ),
        row(
            "the results are a file",
            |i| i.write("out", "x"),
            Refused(&["out: results cannot go there: out is no folder"]),
        ),
        row(
            "the results are below a file",
            |i| i.write("file", "x"),
            Refused(&["file/out: results cannot go there"]),
        )
        .to("file/out"),
        #[cfg(target_os = "linux")]
        row(
            "the place of the results may not be written",
            |_| (),
            Refused(&["/proc/results: results cannot go there"]),
        )
        .to("/proc/results"),
        row(
            "a limit without a ground truth",
            |i| i.remove("seq/groundtruth_planar.csv"),
            Refused(&["--max-ate needs a reference path, seq has none"]),
        )
        .with(&["--max-ate", "0.1"]),
        row(
            "a log that is none",
            |i| i.write("drive.bag", "x"),
            Refused(&["drive.bag: expected "]),
        )
        .at("drive.bag"),
    ]
}

#[test]
fn faults_of_the_camera_end_as_they_should() {
    assert_outcomes(&camera());
}

#[test]
fn faults_of_the_configuration_end_as_they_should() {
    assert_outcomes(&configuration());
}

#[test]
fn faults_of_the_arguments_end_as_they_should() {
    assert_outcomes(&arguments());
}
