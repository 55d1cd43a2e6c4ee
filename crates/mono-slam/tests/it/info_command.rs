//! `mono-slam info`: the lines about a sequence, and the exit code that says whether a run is possible.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder that goes away.
struct Scratch(PathBuf);

impl Scratch {
    /// The wall of the fixtures without some of its files.
    fn wall_without(name: &str, missing: &[&str]) -> Scratch {
        let root = std::env::temp_dir().join(format!("info-{name}-{}", std::process::id()));
        fs::create_dir_all(root.join("images")).unwrap();
        let wall = wall();
        for folder in ["", "images"] {
            for entry in fs::read_dir(wall.join(folder)).unwrap() {
                let path = entry.unwrap().path();
                let name = path.file_name().unwrap().to_str().unwrap();
                if path.is_file() && !missing.contains(&name) {
                    fs::copy(&path, root.join(folder).join(name)).unwrap();
                }
            }
        }
        Scratch(root)
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // Leaving a folder behind is no reason to fail a test.
        drop(fs::remove_dir_all(&self.0));
    }
}

fn wall() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/wall")
}

fn info(arguments: &[&str]) -> (i32, String, String) {
    let Output {
        status,
        stdout,
        stderr,
    } = Command::new(env!("CARGO_BIN_EXE_mono-slam"))
        .arg("info")
        .args(arguments)
        .output()
        .unwrap();
    (
        status.code().unwrap(),
        String::from_utf8(stdout).unwrap(),
        String::from_utf8(stderr).unwrap(),
    )
}

#[test]
fn a_complete_sequence_is_told_in_a_few_lines() {
    let wall = wall();
    let (code, text, message) = info(&[wall.to_str().unwrap()]);
    assert_eq!((code, message.as_str()), (0, ""));
    for line in [
        ": native sequence\n",
        "  images     20 .png images of 320x240, 8 bit, levels 20 to 174 in use\n",
        "  times      0 s to 9.5 s (9.5 s), 2 Hz, no gap\n",
        "  camera     camera.toml: 320x240 pixels, view of 47 x 36 degrees, no lens distortion\n",
        "  mount      looks to the left (90 degrees to the left), sits 0.100 m forward, 0.002 m right, 0.900 m up\n",
        "  odometry   odometry.csv: 96 rows, 0 s to 9.5 s (9.5 s), 10 Hz, no hole; at most 0.27 m/s and 0.15 rad/s\n",
        "  reference  20 poses, 0 s to 9.5 s, at 20 of 20 images\n",
        "A run is possible: mono-slam run ",
    ] {
        assert!(text.contains(line), "{line}\n{text}");
    }
}

#[test]
fn regress_everything_that_is_missing_is_listed_at_once() {
    let missing = ["times.txt", "camera.toml", "odometry.csv"];
    let folder = Scratch::wall_without("missing", &missing);
    let path = folder.0.to_str().unwrap();
    let (code, text, message) = info(&[path]);
    assert_eq!(code, 2, "{text}");
    assert_eq!(
        message,
        format!("mono-slam: {path}: a run still needs 3 pieces, marked above with !\n")
    );
    let marked: Vec<&str> = text.lines().filter(|line| line.starts_with('!')).collect();
    for (line, name) in marked.iter().zip(missing) {
        assert!(
            line.contains(&format!("{name}: not found; it holds ")),
            "{line}"
        );
    }
    assert!(marked[0].contains("--fps 10"), "{text}");
    assert!(marked[1].contains("mono-slam calibrate"), "{text}");
    assert!(
        marked[2].contains("--odometry-from-groundtruth") && marked[2].contains("--odometry none"),
        "{text}"
    );
    // What the lines offer does supply what is missing.
    let camera = wall().join("camera.toml");
    let (code, text, _) = info(&[
        path,
        "--fps",
        "2",
        "--camera",
        camera.to_str().unwrap(),
        "--odometry-from-groundtruth",
        "0.02,0.01,1",
    ]);
    assert_eq!(code, 0, "{text}");
    let (code, text, _) = info(&[path, "--odometry", "none"]);
    assert_eq!(code, 0, "{text}");
}

#[test]
fn no_sequence_at_all_is_one_sentence() {
    let (code, text, message) = info(&["no/such/folder"]);
    assert_eq!((code, text.as_str()), (2, ""));
    assert_eq!(
        message,
        "mono-slam: no/such/folder: expected a sequence folder, found nothing\n"
    );
    let (code, _, message) = info(&["x", "--format", "rosbag"]);
    assert_eq!(code, 2);
    assert!(
        message.contains("native") && message.contains("kitti-raw"),
        "{message}"
    );
}
