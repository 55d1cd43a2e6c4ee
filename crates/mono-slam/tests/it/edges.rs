//! Outputs that must not be destroyed, and inputs that people mistype: each has one right outcome.

use std::fs;
use std::path::{Path, PathBuf};

use image::{GrayImage, Luma};

use crate::commands::{Scratch, assert_refused, code, mono_slam, stderr, stdout};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../fixtures")
        .join(name)
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn picture(path: &Path) -> String {
    let mut image = GrayImage::new(64, 64);
    for (x, y, pixel) in image.enumerate_pixels_mut() {
        *pixel = Luma([((x / 9 + y / 7) % 2 * 200) as u8]);
    }
    image.save(path).unwrap();
    text(path).to_owned()
}

const KALIBR: &str = "front:\n  camera_model: pinhole\n  intrinsics: [458.6, 457.3, 367.2, 248.4]\n  resolution: [752, 480]\n";

#[test]
#[cfg(unix)]
fn regress_out_replaced_devices_pipes_and_links() {
    use std::io::Read as _;
    use std::os::unix::fs::{FileTypeExt as _, symlink};

    let scratch = Scratch::new();
    let input = scratch.file("in.yaml", KALIBR);
    // A link is followed, also to a file that does not exist yet.
    let real = scratch.path().join("real.toml");
    let link = scratch.path().join("link.toml");
    symlink("real.toml", &link).unwrap();
    for _ in 0..2 {
        assert_eq!(
            code(&mono_slam(&["camera", &input, "--out", text(&link)])),
            0
        );
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert!(fs::read_to_string(&real).unwrap().contains("fx = 458.6"));
    }
    // A pipe is written through and is a pipe afterwards.
    let pipe = scratch.path().join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    if made.is_ok_and(|status| status.success()) {
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || {
                let mut read = String::new();
                fs::File::open(pipe)
                    .unwrap()
                    .read_to_string(&mut read)
                    .unwrap();
                read
            }
        });
        assert_eq!(
            code(&mono_slam(&["camera", &input, "--out", text(&pipe)])),
            0
        );
        assert!(reader.join().unwrap().contains("fx = 458.6"));
        assert!(fs::symlink_metadata(&pipe).unwrap().file_type().is_fifo());
    }
    // A device stays one; nothing is left beside it.
    assert_eq!(
        code(&mono_slam(&["camera", &input, "--out", "/dev/null"])),
        0
    );
    assert!(
        fs::metadata("/dev/null")
            .unwrap()
            .file_type()
            .is_char_device()
    );
}

#[test]
fn regress_places_for_results_are_tried_before_the_work() {
    let scratch = Scratch::new();
    let input = scratch.file("in.yaml", KALIBR);
    let nowhere = scratch.path().join("no/such/o.toml");
    assert_refused(
        &mono_slam(&["camera", &input, "--out", text(&nowhere)]),
        2,
        "results cannot go there: the folder",
    );
    assert_refused(
        &mono_slam(&["camera", &input, "--out", text(scratch.path())]),
        2,
        "results cannot go there: a folder is there",
    );
    // The sequence does not exist either; what comes first is what costs nothing.
    for out in [
        input.clone(),
        format!("{input}/below"),
        text(&scratch.path().join("x".repeat(300))).to_owned(),
    ] {
        assert_refused(
            &mono_slam(&["run", "no/such/sequence", "--out", &out]),
            2,
            "results cannot go there",
        );
    }
    let boards = fixture("board").join("images");
    assert!(boards.is_dir(), "{}", boards.display());
    let same = scratch.path().join("camera.html");
    for arguments in [
        vec!["--out", text(&same)],
        vec!["--out", text(&nowhere)],
        vec!["--out", text(scratch.path())],
    ] {
        let mut all = vec![
            "calibrate",
            text(&boards),
            "--board",
            "9x6",
            "--square",
            "0.04",
        ];
        all.extend(arguments);
        let output = mono_slam(&all);
        assert_eq!(code(&output), 2, "{}", stderr(&output));
        assert_eq!(stderr(&output).lines().count(), 1, "{}", stderr(&output));
    }
    assert_eq!(
        fs::read_dir(scratch.path()).unwrap().count(),
        1,
        "only the input is there"
    );
}

#[test]
fn regress_two_images_of_one_name_became_one_file() {
    let scratch = Scratch::new();
    let mut images = Vec::new();
    for side in ["left", "right"] {
        fs::create_dir(scratch.path().join(side)).unwrap();
        images.push(picture(&scratch.path().join(side).join("000001.png")));
    }
    let out = scratch.path().join("out");
    assert_refused(
        &mono_slam(&["features", &images[0], &images[1], "--out", text(&out)]),
        2,
        "would both be written as 000001.csv",
    );
    assert!(!out.exists());
    // Nor is an image overwritten by its own features.
    assert_refused(
        &mono_slam(&["features", &images[0], "--out", &images[0]]),
        2,
        "--out and the image are the same file",
    );
    assert_refused(
        &mono_slam(&["match", &images[0], &images[1], "--out", &images[1]]),
        2,
        "--out and the second image are the same file",
    );
    let table = text(&scratch.path().join("m.csv")).to_owned();
    fs::write(&table, "").unwrap();
    assert_refused(
        &mono_slam(&[
            "match",
            &images[0],
            &images[0],
            "--out",
            &table,
            "--picture",
            &table,
        ]),
        2,
        "--picture and --out are the same file",
    );
    assert_eq!(
        code(&mono_slam(&[
            "match", &images[0], &images[0], "--out", &table
        ])),
        0
    );
    assert_refused(
        &mono_slam(&[
            "features",
            text(&scratch.path().join("left")),
            "--out",
            &table,
        ]),
        2,
        "expected an image, found a folder",
    );
}

/// `--out` on the sequence put the odometry of the run among its files; a run given as a sequence was said to lack images, and
/// one given as a map to be a directory.
#[test]
fn regress_a_sequence_a_run_and_a_map_are_told_apart() {
    let scratch = Scratch::new();
    let path = |name: &str| scratch.path().join(name).to_str().unwrap().to_owned();
    let (sequence, run, out) = (path("drive"), path("run"), path("out"));
    fs::create_dir_all(path("drive/images")).unwrap();
    fs::create_dir(&run).unwrap();
    for name in [
        "camera.toml",
        "odometry.csv",
        "report_data.json",
        "map.slam",
    ] {
        fs::write(path(&format!("run/{name}")), "").unwrap();
    }
    let again = path("drive/images/..");
    for (arguments, expected) in [
        (
            vec!["run", &sequence, "--out", &again],
            "results cannot go there: it is the sequence, whose camera.toml and odometry.csv they would replace",
        ),
        (
            vec!["run", &run, "--out", &out],
            "expected a sequence folder, found the results of a run: give the sequence it was made from",
        ),
        (vec!["info", &run], "found the results of a run"),
        (
            vec!["localize", &sequence, "--map", &run, "--out", &out],
            "expected a map, found the folder of one: give ",
        ),
    ] {
        assert_refused(&mono_slam(&arguments), 2, expected);
    }
    assert!(!Path::new(&out).exists());
}

#[test]
fn regress_negative_numbers_are_answered_as_values() {
    for (arguments, expected) in [
        (
            vec!["run", "seq", "--out", "o", "--seed", "-1"],
            "a whole number of at least 0",
        ),
        (
            vec!["eval", "a", "b", "--delta", "-1"],
            "a whole number of at least 0",
        ),
        (
            vec![
                "calibrate",
                "a",
                "--board",
                "9x6",
                "--square",
                "-1",
                "--out",
                "o",
            ],
            "a positive number of metres",
        ),
    ] {
        let output = mono_slam(&arguments);
        let message = stderr(&output);
        assert_eq!(code(&output), 2, "{message}");
        assert!(
            message.contains(expected) && !message.contains("tip:"),
            "{message}"
        );
    }
}

#[test]
fn regress_a_calibration_of_one_pose_was_written() {
    let scratch = Scratch::new();
    let out = text(&scratch.path().join("camera.toml")).to_owned();
    let image = fixture("board").join("images");
    let mut images: Vec<PathBuf> = fs::read_dir(image)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    images.sort();
    // Ten copies of the one image that shows the board from the front.
    let copies: Vec<String> = (0..10)
        .map(|index| {
            let copy = scratch.path().join(format!("{index}.png"));
            fs::copy(&images[1], &copy).unwrap();
            text(&copy).to_owned()
        })
        .collect();
    let mut arguments = vec![
        "calibrate",
        "--board",
        "9x6",
        "--square",
        "0.04",
        "--out",
        &out,
    ];
    arguments.extend(copies.iter().map(String::as_str));
    let output = mono_slam(&arguments);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    assert!(
        stderr(&output)
            .contains("not usable and not written: fx = 839.4 px is known to 49.76 px only"),
        "{}",
        stderr(&output)
    );
    assert!(!Path::new(&out).exists());
    arguments.push("--force");
    assert_eq!(code(&mono_slam(&arguments)), 0);
    assert!(Path::new(&out).exists());
    assert_refused(
        &mono_slam(&[
            "calibrate",
            &copies[0],
            "--board",
            "10x7",
            "--square",
            "0.04",
            "--out",
            &out,
        ]),
        2,
        "--board counts inner corners, a board of 10x7 squares has 9x6",
    );
}

#[test]
fn regress_a_configuration_in_utf16_is_read() {
    let scratch = Scratch::new();
    let settings = stdout(&mono_slam(&["config"])).replace("\n", "\r\n");
    let wide: Vec<u8> = format!("\u{feff}{settings}")
        .encode_utf16()
        .flat_map(u16::to_le_bytes)
        .collect();
    let path = scratch.path().join("slam.toml");
    fs::write(&path, wide).unwrap();
    // Read before the sequence, whose absence is then the fault.
    let out = scratch.path().join("o");
    assert_refused(
        &mono_slam(&[
            "run",
            "no/such",
            "--config",
            text(&path),
            "--out",
            text(&out),
        ]),
        2,
        "no/such: ",
    );
}

#[test]
fn notes_of_a_calibration_reach_the_user() {
    let scratch = Scratch::new();
    let input = scratch.file("in.yaml", KALIBR);
    let out = text(&scratch.path().join("o.toml")).to_owned();
    let output = mono_slam(&["camera", &input, "--out", &out]);
    assert_eq!(code(&output), 0);
    assert_eq!(
        stderr(&output),
        format!(
            "mono-slam: note: {input}: no distortion_model in front: taken for a camera without a lens\n"
        )
    );
    let orb = scratch.file(
        "orb.yaml",
        "Camera.fx: 458\nCamera.fy: 457\nCamera.cx: 367\nCamera.cy: 248\n",
    );
    assert_refused(
        &mono_slam(&["camera", &orb, "--out", &out]),
        2,
        "or --width and --height",
    );
    let sized = [
        "camera", &orb, "--width", "752", "--height", "480", "--out", &out,
    ];
    assert_eq!(code(&mono_slam(&sized)), 0);
}
