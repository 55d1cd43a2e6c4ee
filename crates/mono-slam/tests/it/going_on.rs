//! Runs that are stored, interrupted, or lose their input: they end in the bytes of a run that was left alone.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use mono_slam::run::{Run, run_sequence};
use slam_io::{Sequence, read_checkpoint, write_run};
use slam_pipeline::config::{Config, ValidConfig};

use crate::commands::{Scratch, assert_refused, code, mono_slam, stderr};

/// Results that hold no wall time.
const TIMELESS: [&str; 6] = [
    "trajectory.tum",
    "trajectory_smoothed.tum",
    "covariance.csv",
    "map.slam",
    "map.ply",
    "tracks.csv",
];

pub(crate) fn wall() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/wall")
}

fn few_particles() -> ValidConfig {
    let mut config = Config::default();
    config.filter.particles = 8;
    config.check().unwrap()
}

pub(crate) fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// `frames.csv` without its columns of milliseconds.
fn timeless_frames(folder: &Path) -> Vec<Vec<String>> {
    let table = fs::read_to_string(folder.join("frames.csv")).unwrap();
    let header: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let kept = |row: &str| {
        let cells = row.splitn(header.len(), ',').map(str::to_owned);
        cells
            .zip(&header)
            .filter(|(_, name)| !name.ends_with("_ms"))
            .map(|(cell, _)| cell)
            .collect()
    };
    table.lines().map(kept).collect()
}

pub(crate) fn assert_same_results(one: &Path, other: &Path) {
    for name in TIMELESS {
        let read = |folder: &Path| fs::read(folder.join(name)).unwrap();
        assert!(read(one) == read(other), "{name} differs");
    }
    assert!(timeless_frames(one) == timeless_frames(other));
}

/// The command with its usual settings, and more.
pub(crate) fn run_command(sequence: &Path, out: &Path, more: &[&str]) -> std::process::Output {
    let mut arguments = vec!["run", text(sequence), "--out", text(out)];
    arguments.extend(["--particles", "8", "--quiet"]);
    arguments.extend(more);
    mono_slam(&arguments)
}

pub(crate) fn checkpoint_of(out: &Path) -> PathBuf {
    PathBuf::from(format!("{}.checkpoint", out.display()))
}

#[test]
fn a_run_that_was_stored_ends_in_the_same_bytes() {
    let scratch = Scratch::new();
    let sequence = Sequence::open(&wall()).unwrap();
    let config = few_particles();
    let whole = scratch.path().join("whole");
    let record = run_sequence(&sequence, &config, &|| 0.0, &mut |_| {}).unwrap();
    write_run(&record, &whole, &[]).unwrap();
    for frames in [0, 1, 6, 13, 20] {
        let mut run = Run::begin(&sequence, &config, &|| 0.0).unwrap();
        for _ in 0..frames {
            run.step().unwrap().unwrap();
        }
        let state = run.state().unwrap();
        drop(run);
        let mut run = Run::resume(&sequence, &config, &|| 0.0, &state).unwrap();
        assert_eq!(run.frames(), frames);
        while run.step().unwrap().is_some() {}
        let resumed = run.finish();
        assert_eq!(resumed.frames, record.frames, "after {frames} frames");
        assert_eq!(resumed.snapshots, record.snapshots);
        assert_eq!(resumed.dead_reckoning, record.dead_reckoning);
        assert_eq!(resumed.warnings, record.warnings);
        let out = scratch.path().join(frames.to_string());
        write_run(&resumed, &out, &[]).unwrap();
        assert_same_results(&whole, &out);
    }
}

#[test]
fn a_state_that_was_damaged_is_refused_without_a_panic() {
    let sequence = Sequence::open(&wall()).unwrap();
    let config = few_particles();
    let mut run = Run::begin(&sequence, &config, &|| 0.0).unwrap();
    for _ in 0..4 {
        run.step().unwrap().unwrap();
    }
    let state = run.state().unwrap();
    for length in (0..state.len()).step_by(1999) {
        let cut = Run::resume(&sequence, &config, &|| 0.0, &state[..length]);
        assert!(cut.is_err(), "cut to {length} bytes");
    }
    for position in (0..state.len()).step_by(2111) {
        let mut damaged = state.clone();
        damaged[position] ^= 0xff;
        // Most bytes are those of pixels and floats, where any value is one.
        drop(Run::resume(&sequence, &config, &|| 0.0, &damaged));
    }
}

/// Ctrl-C ends the run after a frame: code 130, the results so far, and a sentence that says how to go on, which does.
#[cfg(unix)]
#[test]
fn an_interrupted_run_goes_on_to_the_same_bytes() {
    let scratch = Scratch::new();
    let (whole, out) = (scratch.path().join("whole"), scratch.path().join("out"));
    assert_eq!(code(&run_command(&wall(), &whole, &[])), 0);
    let mut child = Command::new(env!("CARGO_BIN_EXE_mono-slam"))
        .args(["run", text(&wall()), "--out", text(&out)])
        .args(["--particles", "8", "--quiet", "--checkpoint-every", "1"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let started = Instant::now();
    while !checkpoint_of(&out).exists() && started.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(2));
    }
    let signalled = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .unwrap();
    assert!(signalled.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let mut told = String::new();
    std::io::Read::read_to_string(child.stderr.as_mut().unwrap(), &mut told).unwrap();
    assert!(told.starts_with("mono-slam: interrupted after "), "{told}");
    assert!(
        told.contains(" of 20 frames; results so far in ")
            && told.ends_with("; the same command with --resume goes on\n"),
        "{told}"
    );
    let summary = fs::read_to_string(out.join("summary.json")).unwrap();
    assert!(summary.contains("run-incomplete"), "{summary}");
    let again = run_command(&wall(), &out, &["--resume"]);
    assert_eq!(code(&again), 0, "{}", stderr(&again));
    assert!(stderr(&again).contains("mono-slam: note: going on after "));
    assert_same_results(&whole, &out);
    assert!(!checkpoint_of(&out).exists(), "it has served");
    let summary = fs::read_to_string(out.join("summary.json")).unwrap();
    assert!(!summary.contains("run-incomplete"), "{summary}");
}

/// A copy of the wall whose frame 12 is no picture although both its ends are those of one.
pub(crate) fn broken_wall(scratch: &Scratch) -> (PathBuf, PathBuf) {
    let copy = scratch.path().join("wall");
    fs::create_dir_all(copy.join("images")).unwrap();
    for name in [
        "camera.toml",
        "odometry.csv",
        "times.txt",
        "groundtruth_planar.csv",
    ] {
        fs::copy(wall().join(name), copy.join(name)).unwrap();
    }
    let mut images: Vec<PathBuf> = fs::read_dir(wall().join("images"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    images.sort();
    for image in &images {
        fs::copy(image, copy.join("images").join(image.file_name().unwrap())).unwrap();
    }
    let broken = copy.join("images").join(images[12].file_name().unwrap());
    let mut bytes = fs::read(&broken).unwrap();
    let middle = bytes.len() / 2;
    for byte in &mut bytes[middle..middle + 400] {
        *byte ^= 0x5a;
    }
    fs::write(&broken, bytes).unwrap();
    (copy, images[12].clone())
}

#[test]
fn a_run_whose_input_breaks_off_keeps_what_was_done() {
    let scratch = Scratch::new();
    let (sequence, whole_image) = broken_wall(&scratch);
    let (whole, out) = (scratch.path().join("whole"), scratch.path().join("out"));
    let broken = run_command(&sequence, &out, &[]);
    let name = whole_image.file_name().unwrap().to_str().unwrap();
    assert_refused(&broken, 2, name);
    let message = stderr(&broken);
    assert!(
        message.contains("; the run stopped after 12 of 20 frames; results so far in "),
        "{message}"
    );
    let rows = fs::read_to_string(out.join("trajectory.tum")).unwrap();
    assert_eq!(rows.lines().filter(|l| !l.starts_with('#')).count(), 12);
    assert!(out.join("report.html").exists());
    // Mended, the run goes on and ends as if nothing had been.
    fs::copy(&whole_image, sequence.join("images").join(name)).unwrap();
    assert_eq!(code(&run_command(&sequence, &out, &["--resume"])), 0);
    assert_eq!(code(&run_command(&sequence, &whole, &[])), 0);
    assert_same_results(&whole, &out);
}

#[test]
fn a_checkpoint_of_another_run_and_a_damaged_one_are_refused() {
    let scratch = Scratch::new();
    let (sequence, _) = broken_wall(&scratch);
    let out = scratch.path().join("out");
    assert_eq!(
        code(&run_command(&sequence, &out, &["--checkpoint-every", "5"])),
        2
    );
    let path = checkpoint_of(&out);
    let whole = fs::read(&path).unwrap();
    assert_refused(
        &run_command(&sequence, &out, &["--resume", "--seed", "9"]),
        2,
        "out.checkpoint: it is of another run: the configuration was `seed = ",
    );
    fs::write(
        sequence.join("times.txt"),
        "0\n".to_owned() + &"1\n".repeat(19),
    )
    .unwrap();
    // What the folder holds is read first, and refused in its own words.
    assert_eq!(code(&run_command(&sequence, &out, &["--resume"])), 2);
    fs::copy(wall().join("times.txt"), sequence.join("times.txt")).unwrap();
    let mut damaged = whole.clone();
    damaged[whole.len() / 2] ^= 1;
    fs::write(&path, &damaged).unwrap();
    assert_refused(
        &run_command(&sequence, &out, &["--resume"]),
        2,
        "the file is damaged or cut short",
    );
    fs::write(&path, &whole[..whole.len() / 3]).unwrap();
    assert_refused(
        &run_command(&sequence, &out, &["--resume"]),
        2,
        "the file is damaged or cut short",
    );
}

#[test]
fn without_a_checkpoint_resume_begins_anew_and_success_leaves_none() {
    let scratch = Scratch::new();
    let out = scratch.path().join("deep/out");
    let first = run_command(&wall(), &out, &["--resume", "--checkpoint-every", "3"]);
    assert_eq!(code(&first), 0);
    assert!(stderr(&first).contains("the run begins at its first frame"));
    let left: Vec<_> = fs::read_dir(scratch.path().join("deep"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(left, ["out"]);
}

/// A file system without room: one sentence, code 2, and the checkpoint before is whole.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_the_checkpoint_before_it() {
    let scratch = Scratch::new();
    let out = scratch.path().join("out");
    // Blocks of 512 or 1024 bytes, depending on the shell: a checkpoint grows from 0.1 to 2 MB over the run. A process that
    // ignores the signal is told that the file is too large.
    let script = format!(
        "trap '' XFSZ; ulimit -f 800; exec '{}' run '{}' --out '{}' --particles 8 --quiet --checkpoint-every 1",
        env!("CARGO_BIN_EXE_mono-slam"),
        wall().display(),
        out.display()
    );
    let full = Command::new("sh").args(["-c", &script]).output().unwrap();
    assert_refused(&full, 2, "out.checkpoint: cannot be written: ");
    let names: Vec<_> = fs::read_dir(scratch.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .collect();
    assert_eq!(names, ["out.checkpoint"], "no half file is left");
    assert!(read_checkpoint(&checkpoint_of(&out)).is_ok());
    assert_eq!(code(&run_command(&wall(), &out, &["--resume"])), 0);
    let whole = scratch.path().join("whole");
    assert_eq!(code(&run_command(&wall(), &whole, &[])), 0);
    assert_same_results(&whole, &out);
}
