//! A log in, a run out: the poses are those of the folder from which the log was made.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Largest difference of a pose that the rounding of times, quaternions and differences of poses may cause, in metres and
/// parts of a quaternion. The images and the random numbers are the same.
const ROUNDING: f64 = 1e-6;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../fixtures")
        .join(name)
}

/// A folder of this test.
fn scratch(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("mono-slam-logs-{name}-{}", std::process::id()));
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// Runs a sequence; the numbers of its trajectory.
fn trajectory(sequence: &Path, out: &Path, options: &[&str]) -> Vec<Vec<f64>> {
    let output = Command::new(env!("CARGO_BIN_EXE_mono-slam"))
        .arg("run")
        .arg(sequence)
        .arg("--out")
        .arg(out)
        .args(options)
        .output()
        .unwrap();
    let messages = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.success(),
        "{}: {messages}",
        sequence.display()
    );
    let text = fs::read_to_string(out.join("trajectory.tum")).unwrap();
    text.lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split(' ').map(|word| word.parse().unwrap()).collect())
        .collect()
}

/// Largest difference between two trajectories of equal length.
fn difference(a: &[Vec<f64>], b: &[Vec<f64>]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .flatten()
        .zip(b.iter().flatten())
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

/// The first frames of the wall as a folder.
fn short_wall(folder: &Path, frames: usize) -> PathBuf {
    let wall = folder.join("wall");
    fs::create_dir_all(wall.join("images")).unwrap();
    for index in 0..frames {
        let name = format!("images/{index:06}.png");
        fs::copy(fixture("wall").join(&name), wall.join(&name)).unwrap();
    }
    for name in ["camera.toml", "odometry.csv"] {
        fs::copy(fixture("wall").join(name), wall.join(name)).unwrap();
    }
    let times = fs::read_to_string(fixture("wall/times.txt")).unwrap();
    let lines: Vec<&str> = times.lines().take(frames).collect();
    fs::write(wall.join("times.txt"), lines.join("\n")).unwrap();
    wall
}

#[test]
fn a_run_on_a_log_is_the_run_on_its_folder() {
    let folder = scratch("small");
    let expected = trajectory(&short_wall(&folder, 4), &folder.join("native"), &[]);
    assert_eq!(expected.len(), 4);
    for name in ["wall.bag", "wall.mcap"] {
        let log = fixture("logs").join(name);
        let own = trajectory(&log, &folder.join(name), &[]);
        let largest = difference(&own, &expected);
        assert!(largest < ROUNDING, "{name}: {largest}");
    }
    fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_log_with_nothing_to_run_on_is_one_sentence() {
    let folder = scratch("refused");
    let out = folder.join("out");
    let log = fixture("logs/unfinished.db3");
    let output = Command::new(env!("CARGO_BIN_EXE_mono-slam"))
        .arg("run")
        .arg(&log)
        .arg("--out")
        .arg(&out)
        .output()
        .unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert!(message.contains("expected an image topic"), "{message}");
    assert!(!out.exists());
    fs::remove_dir_all(&folder).unwrap();
}

/// All variants that `xtask/scripts/make_bags.py` writes from the wall, in the folder that `MONO_SLAM_LOGS` names.
#[test]
fn val_logs_of_the_formats_own_libraries_give_the_run_of_the_folder() {
    let Some(logs) = std::env::var_os("MONO_SLAM_LOGS").map(PathBuf::from) else {
        println!("skipped: MONO_SLAM_LOGS names no folder written by xtask/scripts/make_bags.py");
        return;
    };
    let folder = scratch("all");
    let expected = trajectory(&fixture("wall"), &folder.join("native"), &["--quiet"]);
    let mut count = 0;
    for entry in fs::read_dir(&logs).unwrap() {
        let log = entry.unwrap().path();
        if log.extension().is_some_and(|ending| ending == "toml") {
            continue;
        }
        let name = log.file_name().unwrap().to_string_lossy().into_owned();
        let own = trajectory(&log, &folder.join(&name), &["--quiet"]);
        let largest = difference(&own, &expected);
        println!("{name}: largest difference {largest:e}");
        assert!(largest < ROUNDING, "{name}: {largest}");
        count += 1;
    }
    assert!(count >= 10, "{count} logs in {}", logs.display());
    fs::remove_dir_all(&folder).unwrap();
}
