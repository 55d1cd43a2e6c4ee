//! The program as its user sees it: what it prints and the code it ends with.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicUsize, Ordering};

use slam_io::{RunRecord, write_run};
use slam_report::render_run_html;

pub(crate) fn mono_slam(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_mono-slam"))
        .args(arguments)
        .output()
        .unwrap()
}

pub(crate) fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// One sentence in one line, nothing on standard output.
pub(crate) fn assert_refused(output: &Output, expected_code: i32, expected: &str) {
    let message = stderr(output);
    assert_eq!(code(output), expected_code, "{message}");
    assert!(
        message.starts_with("mono-slam: ") && message.contains(expected),
        "{message}"
    );
    assert_eq!(message.lines().count(), 1, "{message}");
}

/// A fresh folder, removed when the value is dropped.
pub(crate) struct Scratch(PathBuf);

impl Scratch {
    pub(crate) fn new() -> Scratch {
        static NEXT: AtomicUsize = AtomicUsize::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let path =
            std::env::temp_dir().join(format!("mono-slam-cli-{}-{number}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Scratch(path)
    }

    pub(crate) fn file(&self, name: &str, text: &str) -> String {
        let path = self.0.join(name);
        fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_string()
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // Leaving a folder behind is no reason to fail a test.
        drop(fs::remove_dir_all(&self.0));
    }
}

/// A right angle of 1 m steps, and the same path 3 cm higher along y.
fn pair(scratch: &Scratch) -> (String, String) {
    let reference = "0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n3 2 1 0 0 0 0 1\n";
    let estimate =
        "0 0 0.03 0 0 0 0 1\n1 1 0.03 0 0 0 0 1\n2 2 0.03 0 0 0 0 1\n3 2 1.03 0 0 0 0 1\n";
    (
        scratch.file("estimate.tum", estimate),
        scratch.file("reference.tum", reference),
    )
}

#[test]
fn eval_prints_the_errors() {
    let scratch = Scratch::new();
    let (estimate, reference) = pair(&scratch);
    let output = mono_slam(&["eval", &estimate, &reference]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    assert!(
        text.starts_with("4 matched poses of 4 (reference 4), alignment none\n"),
        "{text}"
    );
    let ate = text
        .lines()
        .find(|line| line.starts_with("ATE position (m)"))
        .unwrap();
    let numbers: Vec<&str> = ate.split_whitespace().skip(3).collect();
    assert_eq!(numbers, ["0.030000"; 5]);
    assert!(output.stderr.is_empty());
}

#[test]
fn eval_prints_json() {
    let scratch = Scratch::new();
    let (estimate, reference) = pair(&scratch);
    // The pair lies 3 cm apart all along: moving it removes that, a turn about the start only a part of it. Offsets
    // a of the estimate and b of the reference: |a|^2 + |b|^2 - 2 |(sum a.b, sum a x b)| is left, over 4 poses.
    let turned = ((10.0636 + 10.0 - 2.0 * 10.03_f64.hypot(0.15)) / 4.0).sqrt();
    for (align, expected) in [
        ("none", 0.03),
        ("heading", turned),
        ("se2", 0.0),
        ("sim2", 0.0),
        ("se3", 0.0),
        ("sim3", 0.0),
    ] {
        let output = mono_slam(&["eval", &estimate, &reference, "--align", align, "--json"]);
        let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let rmse = value["ate"]["translation_m"]["rmse"].as_f64().unwrap();
        assert!((rmse - expected).abs() < 1e-10, "{align}: {rmse}");
        assert_eq!(value["alignment"], align);
        assert_eq!(
            (value["pairs"].as_u64(), value["rpe"]["steps"].as_u64()),
            (Some(4), Some(3))
        );
    }
}

#[test]
fn a_threshold_that_is_not_met_ends_with_three() {
    let scratch = Scratch::new();
    let (estimate, reference) = pair(&scratch);
    assert_eq!(
        code(&mono_slam(&[
            "eval",
            &estimate,
            &reference,
            "--max-ate",
            "0.031"
        ])),
        0
    );
    let output = mono_slam(&["eval", &estimate, &reference, "--max-ate", "0.029"]);
    assert_refused(&output, 3, "is 0.030000 m RMSE, --max-ate allows 0.029 m");
    assert!(
        stdout(&output).contains("ATE position"),
        "the figures are printed all the same"
    );
}

#[test]
fn bad_input_ends_with_two() {
    let scratch = Scratch::new();
    let (estimate, reference) = pair(&scratch);
    let missing = scratch.path().join("missing.tum");
    assert_refused(
        &mono_slam(&["eval", &estimate, missing.to_str().unwrap()]),
        2,
        "missing.tum: cannot be read: ",
    );
    let wrong = scratch.file("wrong.tum", "0 0 0 0 0 0 0 1\n1 0 0 deep 0 0 0 1\n");
    let expected = "wrong.tum, line 2: expected a finite number for z, found \"deep\"";
    assert_refused(&mono_slam(&["eval", &wrong, &reference]), 2, expected);
    let later = scratch.file("later.tum", "100 0 0 0 0 0 0 1\n");
    assert_refused(
        &mono_slam(&["eval", &later, &reference]),
        2,
        "no pose of the estimate",
    );
    // A relative step longer than the path leaves the absolute error.
    let output = mono_slam(&["eval", &estimate, &reference, "--delta", "9"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(
        stderr(&output).contains("no relative error: a relative error over 9 frames needs at least 10 matched poses, found 4"),
        "{}",
        stderr(&output)
    );
    assert!(!stdout(&output).contains("RPE"), "{}", stdout(&output));
}

#[test]
fn bad_arguments_end_with_two_and_help_with_zero() {
    for arguments in [
        &["eval"][..],
        &["fly"],
        &["eval", "a", "b", "--align", "sideways"],
        &["eval", "a", "b", "--max-ate", "-1"],
        &["eval", "a", "b", "--max-ate", "nan"],
        &[],
    ] {
        let output = mono_slam(arguments);
        assert_eq!(code(&output), 2, "{arguments:?}");
        assert!(output.stdout.is_empty() && !output.stderr.is_empty());
    }
    for arguments in [["--help"], ["--version"]] {
        assert_eq!(code(&mono_slam(&arguments)), 0);
    }
}

#[test]
fn report_draws_the_page_again() {
    let scratch = Scratch::new();
    let run = RunRecord {
        sequence: "corridor".into(),
        warnings: Vec::new(),
        scale: slam_io::RunScale::Metric,
        predicted: Vec::new(),
        frames: Vec::new(),
        smoothed: Vec::new(),
        smoother: None,
        tracks: Vec::new(),
        landmarks: Vec::new(),
        known_map: None,
        dead_reckoning: Vec::new(),
        reference: None,
        snapshots: Vec::new(),
        configuration: String::new(),
        seed: 1,
        particles: 50,
        method: "novel".into(),
        wall_s: 1.0,
    };
    let page = render_run_html(&run).into_bytes();
    write_run(&run, scratch.path(), &[]).unwrap();
    let dir = scratch.path().to_str().unwrap();
    let output = mono_slam(&["report", dir]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(output.stdout.is_empty() && output.stderr.is_empty());
    assert_eq!(fs::read(scratch.path().join("report.html")).unwrap(), page);

    fs::write(scratch.path().join("map.slam"), "no map").unwrap();
    assert_refused(&mono_slam(&["report", dir]), 2, "map.slam: expected a map");
    assert_refused(
        &mono_slam(&["report", "no/such/run"]),
        2,
        "found nothing there",
    );
}

/// These complained about a `map.slam` that cannot be read in a folder that nobody takes for a run.
#[test]
fn regress_a_folder_that_is_no_run_is_told_as_that() {
    let scratch = Scratch::new();
    let path = |name: &str| scratch.path().join(name).to_str().unwrap().to_owned();
    let (empty, file, sequence, out) = (path("empty"), path("file"), path("drive"), path("out"));
    fs::create_dir(&empty).unwrap();
    fs::write(&file, "t_s").unwrap();
    fs::create_dir_all(format!("{sequence}/images")).unwrap();
    for (folder, found) in [
        (&empty, "a folder without report_data.json"),
        (&file, "a file"),
        (&sequence, "a sequence, which has not been run"),
    ] {
        let sentence = format!(
            "{folder}: no finished run: expected the folder that `mono-slam run SEQUENCE --out DIR` wrote, found {found}"
        );
        for command in [
            &["batch", folder, "--out", &out][..],
            &["report", folder],
            &["compare", folder, folder, "--out", &out],
            &["calibrate", "--from-run", folder, "--out", &out],
        ] {
            assert_refused(&mono_slam(command), 2, &sentence);
        }
    }
}

fn board_images() -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/board/images");
    folder.to_str().unwrap().to_string()
}

#[test]
fn calibrate_writes_a_camera_and_a_page() {
    let scratch = Scratch::new();
    let blank = scratch.path().join("blank.png");
    image::GrayImage::from_pixel(320, 240, image::Luma([90]))
        .save(&blank)
        .unwrap();
    let out = scratch.path().join("camera.toml");
    let arguments = |model: &str| {
        let images = board_images();
        mono_slam(&[
            "calibrate",
            &images,
            blank.to_str().unwrap(),
            "--board",
            "9x6",
            "--square",
            "0.04",
            "--model",
            model,
            "--out",
            out.to_str().unwrap(),
        ])
    };
    let output = arguments("radtan");
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    assert!(
        text.starts_with("8 boards in 9 images of 320x240 pixels\nnot used: "),
        "{text}"
    );
    assert!(
        text.contains("blank.png: no corner of a checkerboard\n"),
        "{text}"
    );
    assert!(output.stderr.is_empty());
    let camera = fs::read_to_string(&out).unwrap();
    assert!(
        camera.contains("[distortion]\nmodel = \"radtan\"\nk1 = "),
        "{camera}"
    );
    let page = fs::read_to_string(scratch.path().join("camera.html")).unwrap();
    assert!(page.contains("<h1>Camera calibration</h1>") && page.contains("blank.png"));
    // Equal images, equal bytes.
    let again = arguments("radtan");
    assert_eq!(again.stdout, output.stdout);
    assert_eq!(fs::read_to_string(&out).unwrap(), camera);
    for model in ["pinhole", "radtan4", "kannala-brandt"] {
        assert_eq!(
            code(&arguments(model)),
            0,
            "{model}: {}",
            stderr(&arguments(model))
        );
    }
}

#[test]
fn calibrate_refuses_in_one_sentence() {
    let scratch = Scratch::new();
    let out = scratch.path().join("camera.toml");
    let out = out.to_str().unwrap();
    let images = board_images();
    let first = Path::new(&images).join("board_00.png");
    let calibrate = |image: &str, board: &str, square: &str| {
        mono_slam(&[
            "calibrate",
            image,
            "--board",
            board,
            "--square",
            square,
            "--out",
            out,
        ])
    };
    assert_refused(
        &calibrate(first.to_str().unwrap(), "9x6", "0.04"),
        2,
        "1 board in 1 image, required: at least 3",
    );
    assert_refused(
        &calibrate(&images, "8x6", "0.04"),
        2,
        "0 boards in 8 images, required: at least 3 (",
    );
    let nothing = scratch.path().to_str().unwrap();
    assert_refused(
        &calibrate(nothing, "9x6", "0.04"),
        2,
        "expected at least one image (.png",
    );
    for (board, square) in [("9", "0.04"), ("9x6", "0"), ("9x6", "nan")] {
        let output = calibrate(&images, board, square);
        assert_eq!(code(&output), 2);
        assert!(output.stdout.is_empty() && !output.stderr.is_empty());
    }
    assert!(!Path::new(out).exists());
}

const KALIBR: &str = "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [-0.28, 0.07, 0.0002, 1.8e-05]\n  \
    distortion_model: radtan\n  intrinsics: [458.654, 457.296, 367.215, 248.375]\n  resolution: [752, 480]\n\
    left:\n  camera_model: pinhole\n  distortion_coeffs: [-0.0137, 0.0207, -0.0127, 0.0025]\n  \
    distortion_model: equidistant\n  intrinsics: [457.587, 456.134, 379.999, 255.238]\n  resolution: [752, 480]\n";

#[test]
fn camera_converts_there_and_back() {
    let scratch = Scratch::new();
    let input = scratch.file("camchain.yaml", KALIBR);
    let out = |name: &str| scratch.path().join(name).to_str().unwrap().to_string();
    let convert = |arguments: &[&str]| {
        let output = mono_slam(&[&["camera"], arguments].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        assert!(output.stdout.is_empty());
        let told = stderr(&output);
        assert!(
            told.is_empty()
                || told.ends_with("camera cam0 of cam0, left is taken; --camera chooses another\n"),
            "{told}"
        );
    };
    let toml = out("camera.toml");
    convert(&[&input, "--out", &toml]);
    let text = fs::read_to_string(&toml).unwrap();
    let expected = "width = 752\nheight = 480\nmodel = \"pinhole\"\nfx = 458.654\nfy = 457.296\ncx = 367.215\n\
                    cy = 248.375\n\n[distortion]\nmodel = \"radtan\"\nk1 = -0.28\nk2 = 0.07\np1 = 0.0002\n\
                    p2 = 1.8e-5\nk3 = 0.0\n";
    assert_eq!(text, expected);
    let mut before = toml;
    for (to, name) in [
        ("opencv", "a.yml"),
        ("ros", "b.yaml"),
        ("kalibr", "c.yaml"),
        ("toml", "d.toml"),
    ] {
        let after = out(name);
        convert(&[&before, "--to", to, "--out", &after]);
        before = after;
    }
    assert_eq!(fs::read_to_string(&before).unwrap(), text);
    let fisheye = out("left.toml");
    convert(&[
        &input, "--from", "kalibr", "--camera", "left", "--out", &fisheye,
    ]);
    let text = fs::read_to_string(&fisheye).unwrap();
    assert!(
        text.contains("model = \"kannala-brandt\"\nk1 = -0.0137\n"),
        "{text}"
    );
}

#[test]
fn a_bad_calibration_ends_with_two_and_writes_nothing() {
    let scratch = Scratch::new();
    let out = scratch.path().join("camera.toml");
    let input = scratch.file("camchain.yaml", KALIBR);
    let letter = scratch.file("letter.txt", "Dear aunt,\nhow are you?\n");
    let broken = scratch.file("broken.yaml", &KALIBR.replace("458.654", "nan"));
    let rational = scratch.file(
        "rational.toml",
        "width = 9\nheight = 9\nmodel = \"pinhole\"\nfx = 9\nfy = 9\ncx = 4\ncy = 4\n[distortion]\n\
         model = \"rational\"\nk1 = 0\nk2 = 0\np1 = 0\np2 = 0\nk3 = 0\nk4 = 0.1\nk5 = 0\nk6 = 0\n",
    );
    let missing = scratch
        .path()
        .join("none.yml")
        .to_str()
        .unwrap()
        .to_string();
    for (arguments, expected) in [
        (&[missing.as_str()][..], "none.yml: cannot be read: "),
        (
            &[&letter],
            "letter.txt: expected a calibration of camera.toml, Kalibr, ",
        ),
        (
            &[&broken],
            "broken.yaml, line 5: expected a finite number for intrinsics of cam0, found \"nan\"",
        ),
        (
            &[&input, "--camera", "cam7"],
            "camchain.yaml: expected a camera cam7, found cam0, left",
        ),
        (
            &[&input, "--from", "ros"],
            "camchain.yaml: expected the key camera_matrix, found none",
        ),
        (
            &[&input, "--from", "toml"],
            "camchain.yaml, line 1: expected key = value, or a section in brackets",
        ),
        (
            &[&rational, "--camera", "cam0"],
            "expected a file of several cameras to choose cam0 from",
        ),
        (
            &[&rational, "--to", "kalibr"],
            "a Kalibr camchain has no place for a rational lens",
        ),
    ] {
        let all = [&["camera"], arguments, &["--out", out.to_str().unwrap()]].concat();
        assert_refused(&mono_slam(&all), 2, expected);
        assert!(!out.exists());
    }
    // No --out, no such format.
    assert_eq!(code(&mono_slam(&["camera", &input])), 2);
    let output = mono_slam(&[
        "camera",
        &input,
        "--to",
        "matlab",
        "--out",
        out.to_str().unwrap(),
    ]);
    assert_eq!(code(&output), 2);
}
