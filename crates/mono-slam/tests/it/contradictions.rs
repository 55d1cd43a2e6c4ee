//! The fixture with one thing wrong: a run never ends with exit code 0 and no word.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A copy of the wall's first frames, removed when the value is dropped.
struct Wall(PathBuf);

const FRAMES: usize = 12;

impl Wall {
    fn new(name: &str) -> Wall {
        let root =
            std::env::temp_dir().join(format!("mono-slam-wall-{name}-{}", std::process::id()));
        drop(fs::remove_dir_all(&root));
        fs::create_dir_all(root.join("images")).unwrap();
        let fixture = fixture();
        for frame in 0..FRAMES {
            let image = format!("images/{frame:06}.png");
            fs::copy(fixture.join(&image), root.join(&image)).unwrap();
        }
        for file in ["camera.toml", "odometry.csv"] {
            fs::copy(fixture.join(file), root.join(file)).unwrap();
        }
        let wall = Wall(root);
        wall.write(
            "times.txt",
            &first_lines(&fixture.join("times.txt"), FRAMES),
        );
        wall.write(
            "groundtruth_planar.csv",
            &first_lines(&fixture.join("groundtruth_planar.csv"), FRAMES + 1),
        );
        wall
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.0.join(name), text).unwrap();
    }

    /// The odometry with every row changed.
    fn odometry(&self, change: impl Fn(f64, f64, f64) -> (f64, f64, f64)) {
        let mut text = String::from("t_s,v_mps,omega_radps\n");
        for line in fs::read_to_string(fixture().join("odometry.csv"))
            .unwrap()
            .lines()
            .skip(1)
        {
            let row: Vec<f64> = line
                .split(',')
                .map(|number| number.parse().unwrap())
                .collect();
            let (t_s, v, omega) = change(row[0], row[1], row[2]);
            text += &format!("{t_s},{v},{omega}\n");
        }
        self.write("odometry.csv", &text);
    }

    fn run(&self, more: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_mono-slam"))
            .arg("run")
            .arg(&self.0)
            .arg("--out")
            .arg(self.0.join("out"))
            .args(["--particles", "10", "--quiet"])
            .args(more)
            .output()
            .unwrap()
    }

    /// The warnings of a run, by name, as standard error and `summary.json` both have them.
    fn warnings(&self) -> Vec<String> {
        let output = self.run(&[]);
        let told = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{told}");
        let names: Vec<String> = told
            .lines()
            .map(|line| {
                let rest = line.strip_prefix("mono-slam: warning: [").unwrap();
                let (name, sentence) = rest.split_once("] ").unwrap();
                assert!(sentence.ends_with(['.', '?']), "{sentence}");
                name.to_owned()
            })
            .collect();
        let summary = fs::read_to_string(self.0.join("out/summary.json")).unwrap();
        let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
        let written: Vec<&str> = summary["warnings"]
            .as_array()
            .unwrap()
            .iter()
            .map(|warning| warning["name"].as_str().unwrap())
            .collect();
        assert_eq!(names, written);
        let page = fs::read_to_string(self.0.join("out/report.html")).unwrap();
        for name in &names {
            assert!(page.contains(&format!("<code>{name}</code>")), "{name}");
        }
        names
    }
}

impl Drop for Wall {
    fn drop(&mut self) {
        // Leaving a folder behind is no reason to fail a test.
        drop(fs::remove_dir_all(&self.0));
    }
}

fn fixture() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/wall")
}

fn first_lines(path: &Path, count: usize) -> String {
    let text = fs::read_to_string(path).unwrap();
    text.lines()
        .take(count)
        .map(|line| format!("{line}\n"))
        .collect()
}

#[test]
fn the_fixture_itself_is_run_without_a_word() {
    assert_eq!(Wall::new("itself").warnings(), Vec::<String>::new());
}

#[test]
fn regress_odometry_that_contradicts_the_images_is_named() {
    type Change = fn(f64, f64, f64) -> (f64, f64, f64);
    let cases: [(&str, Change, &str); 4] = [
        ("backwards", |t, v, w| (t, -v, w), "driving-direction"),
        ("degrees", |t, v, w| (t, v, w.to_degrees()), "turn-ratio"),
        ("rest", |t, _, _| (t, 0.0, 0.0), "odometry-at-rest"),
        (
            "slip",
            |t, v, w| (t, if (2.0..3.5).contains(&t) { 4.0 * v } else { v }, w),
            "wheel-slip",
        ),
    ];
    for (name, change, expected) in cases {
        let wall = Wall::new(name);
        wall.odometry(change);
        let warnings = wall.warnings();
        assert!(
            warnings.iter().any(|w| w == expected),
            "{name}: {warnings:?}"
        );
    }
}

#[test]
fn regress_a_mount_that_was_left_out_is_named() {
    let wall = Wall::new("mount");
    let camera = fs::read_to_string(fixture().join("camera.toml")).unwrap();
    let (intrinsics, mount) = camera.split_once("[mount]").unwrap();
    assert!(mount.contains("rotation"), "{mount}");
    wall.write("camera.toml", intrinsics);
    assert!(wall.warnings().contains(&"mount-turned".to_owned()));
}

#[test]
fn regress_a_camera_that_sees_nothing_is_named() {
    let wall = Wall::new("dark");
    let black = fs::read(wall.0.join("images/000000.png")).unwrap();
    let (width, height) = image_size(&black);
    let dark = image::GrayImage::new(width, height);
    for frame in 0..FRAMES {
        dark.save(wall.0.join(format!("images/{frame:06}.png")))
            .unwrap();
    }
    assert!(wall.warnings().contains(&"few-keypoints".to_owned()));
}

fn image_size(png: &[u8]) -> (u32, u32) {
    let picture = image::load_from_memory(png).unwrap();
    (picture.width(), picture.height())
}

#[test]
fn regress_a_reference_that_fits_nowhere_is_told_before_the_run() {
    let wall = Wall::new("elsewhere");
    let mut reference = String::from("frame,t_s,x_m,y_m,phi_rad\n");
    for frame in 0..FRAMES {
        reference += &format!(
            "{frame},{},{},0,0\n",
            1000.0 + 0.5 * frame as f64,
            0.1 * frame as f64
        );
    }
    wall.write("groundtruth_planar.csv", &reference);
    assert_eq!(wall.warnings(), ["reference-elsewhere"]);
    fs::remove_dir_all(wall.0.join("out")).unwrap();
    let refused = wall.run(&["--max-ate", "0.1"]);
    let sentence = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(2), "{sentence}");
    assert!(
        sentence.contains("--max-ate") && sentence.contains("1000"),
        "{sentence}"
    );
    assert!(!wall.0.join("out").exists());
}

#[test]
fn regress_a_reference_of_some_frames_says_of_how_many() {
    let wall = Wall::new("part");
    wall.write(
        "groundtruth_planar.csv",
        &first_lines(&fixture().join("groundtruth_planar.csv"), 6),
    );
    assert_eq!(wall.warnings(), ["reference-in-part"]);
    let summary = fs::read_to_string(wall.0.join("out/summary.json")).unwrap();
    assert!(
        summary.contains(&format!("The error is that of 5 of {FRAMES} frames")),
        "{summary}"
    );
}

#[test]
fn regress_wheels_that_slip_do_not_take_the_robot_along() {
    let wall = Wall::new("spin");
    wall.odometry(|t, v, w| (t, if (2.0..3.5).contains(&t) { 3.0 * v } else { v }, w));
    assert!(wall.warnings().contains(&"wheel-slip".to_owned()));
    let summary = fs::read_to_string(wall.0.join("out/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    let rmse_m = |path: &str| {
        summary["figures"]["errors"][path]["none"]["position_m"]["rmse"]
            .as_f64()
            .unwrap()
    };
    // The wheels spin 0.3 m away; the images know where the wall is.
    assert!(
        rmse_m("dead_reckoning") > 0.2,
        "{}",
        rmse_m("dead_reckoning")
    );
    assert!(rmse_m("filtered") < 0.03, "{}", rmse_m("filtered"));
    let frames = fs::read_to_string(wall.0.join("out/frames.csv")).unwrap();
    assert!(frames.contains("odometry in doubt"));
}

#[test]
fn the_offset_of_a_clock_is_taken_off_again() {
    let wall = Wall::new("clock");
    wall.odometry(|t, v, w| (t + 0.25, v, w));
    let moved = wall.run(&["--odometry-offset", "-0.25"]);
    assert!(moved.status.success());
    let trajectory = |wall: &Wall| fs::read_to_string(wall.0.join("out/trajectory.tum")).unwrap();
    let plain = Wall::new("plain");
    assert!(plain.run(&[]).status.success());
    let poses = |text: &str| -> Vec<f64> {
        let numbers = text
            .lines()
            .filter(|line| !line.starts_with('#'))
            .flat_map(str::split_whitespace);
        numbers.map(|number| number.parse().unwrap()).collect()
    };
    // The sums of the times differ in their last bits.
    for (a, b) in poses(&trajectory(&wall))
        .iter()
        .zip(poses(&trajectory(&plain)))
    {
        assert!((a - b).abs() < 1e-6, "{a} {b}");
    }
}
