//! The faults that a robot, a disk or a person puts into the inputs of a run, a row a fault, each with its one outcome.
//!
//! A row damages a copy of the first frames of the wall and runs the program over it, as its user would. What the sentence
//! of a reader says in every corner is tested beside the readers; here it is the whole way from the file to the exit code.

mod images;
mod settings;
mod stored;
mod tables;

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Output};
use std::sync::LazyLock;

use image::{DynamicImage, GrayImage};
use slam_io::read_run;

use crate::commands::{Scratch, code, stderr};
use crate::going_on::wall;

/// Frames of the copy.
pub(super) const FRAMES: usize = 5;

/// Every run is small.
const USUAL: [&str; 5] = ["--particles", "8", "--threads", "1", "--quiet"];

/// The end of the run.
pub(super) enum Outcome {
    /// Exit code 2 and one sentence with these parts; nothing is written.
    Refused(&'static [&'static str]),
    /// Exit code 2 and one sentence with these parts after so many frames, whose results are kept.
    Stopped(usize, &'static [&'static str]),
    /// Exit code 0 and one line a warning, with these names.
    Warned(&'static [&'static str]),
    /// Exit code 0, no word, and this in `frames.csv`.
    Noted(&'static str),
    /// Exit code 0, no word, and the bytes of the undamaged run.
    Same,
}

/// A row of the table.
pub(super) struct Fault {
    what: &'static str,
    damage: fn(&Input),
    sequence: &'static str,
    out: &'static str,
    more: &'static [&'static str],
    outcome: Outcome,
}

/// A row without further arguments.
pub(super) fn row(what: &'static str, damage: fn(&Input), outcome: Outcome) -> Fault {
    Fault {
        what,
        damage,
        sequence: "seq",
        out: "out",
        more: &[],
        outcome,
    }
}

impl Fault {
    /// The same with more arguments.
    pub(super) fn with(self, more: &'static [&'static str]) -> Fault {
        Fault { more, ..self }
    }

    /// The same of another sequence.
    pub(super) fn at(self, sequence: &'static str) -> Fault {
        Fault { sequence, ..self }
    }

    /// The same with another place for the results.
    pub(super) fn to(self, out: &'static str) -> Fault {
        Fault { out, ..self }
    }
}

/// A folder with the sequence `seq` and whatever else a row puts beside it.
pub(super) struct Input(Scratch);

impl Input {
    fn new() -> Input {
        let input = Input(Scratch::new());
        fs::create_dir_all(input.path("seq/images")).unwrap();
        for frame in 0..FRAMES {
            let name = format!("images/{frame:06}.png");
            fs::copy(wall().join(&name), input.path("seq").join(&name)).unwrap();
        }
        fs::copy(wall().join("camera.toml"), input.path("seq/camera.toml")).unwrap();
        for (name, lines) in [
            ("times.txt", FRAMES),
            ("odometry.csv", 5 * FRAMES),
            ("groundtruth_planar.csv", FRAMES + 1),
        ] {
            let text = fs::read_to_string(wall().join(name)).unwrap();
            let first: String = text.split_inclusive('\n').take(lines).collect();
            input.write(&format!("seq/{name}"), first);
        }
        input
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(super) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path(name), bytes).unwrap();
    }

    pub(super) fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    /// Changes the text of a file; a change that changes nothing is a fault of the row.
    pub(super) fn edit(&self, name: &str, change: impl Fn(&str) -> String) {
        let before = fs::read_to_string(self.path(name)).unwrap();
        let after = change(&before);
        assert_ne!(before, after, "{name}");
        self.write(name, after);
    }

    /// Replaces a line, counted from one.
    pub(super) fn line(&self, name: &str, number: usize, line: &str) {
        self.edit(name, |text| {
            let lines = text.lines().zip(1..);
            lines
                .map(|(old, n)| format!("{}\n", if n == number { line } else { old }))
                .collect()
        });
    }

    pub(super) fn replace(&self, name: &str, from: &str, to: &str) {
        self.edit(name, |text| text.replace(from, to));
    }

    /// Keeps a part of a file, in hundredths.
    pub(super) fn cut(&self, name: &str, percent: usize) {
        let bytes = self.bytes(name);
        self.write(name, &bytes[..bytes.len() * percent / 100]);
    }

    /// A folder in place of a file.
    pub(super) fn folder(&self, name: &str) {
        self.remove(name);
        fs::create_dir(self.path(name)).unwrap();
    }

    pub(super) fn remove(&self, name: &str) {
        fs::remove_file(self.path(name)).unwrap();
    }

    /// Changes an image of the sequence.
    pub(super) fn image(&self, frame: usize, change: impl Fn(GrayImage) -> DynamicImage) {
        let path = self.path(&format!("seq/images/{frame:06}.png"));
        let image = image::open(&path).unwrap().into_luma8();
        change(image).save(&path).unwrap();
    }

    pub(super) fn images(&self, change: impl Fn(GrayImage) -> DynamicImage) {
        for frame in 0..FRAMES {
            self.image(frame, &change);
        }
    }

    pub(super) fn run(&self, more: &[&str]) -> Output {
        self.run_to("seq", "out", more)
    }

    fn run_to(&self, sequence: &str, out: &str, more: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_mono-slam"))
            .current_dir(self.0.path())
            .args(["run", sequence, "--out", out])
            .args(USUAL)
            .args(more)
            .output()
            .unwrap()
    }

    /// Poses in the results.
    fn poses(&self) -> Option<Vec<u8>> {
        fs::read(self.path("out/trajectory.tum")).ok()
    }
}

/// Damages an image where neither end shows it, so that the run stops there.
pub(super) fn break_frame_2(input: &Input) {
    let name = "seq/images/000002.png";
    let mut bytes = input.bytes(name);
    let middle = bytes.len() / 2;
    for byte in &mut bytes[middle..middle + 400] {
        *byte ^= 0x5a;
    }
    input.write(name, bytes);
}

/// The trajectory of the copy without a fault.
static UNDAMAGED: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let input = Input::new();
    let output = input.run(&[]);
    assert_eq!((code(&output), stderr(&output).as_str()), (0, ""));
    input.poses().unwrap()
});

/// The row and its outcome, where that is another than it should be.
fn wrong(fault: &Fault) -> Option<String> {
    let input = Input::new();
    (fault.damage)(&input);
    let output = input.run_to(fault.sequence, fault.out, fault.more);
    let (code, told) = (code(&output), stderr(&output));
    let parts = |parts: &[&str]| {
        told.lines().count() == 1
            && told.starts_with("mono-slam: ")
            && parts.iter().all(|part| told.contains(part))
    };
    let names = || -> Option<Vec<&str>> {
        let name = |line: &'_ str| -> Option<(usize, usize)> {
            let rest = line.strip_prefix("mono-slam: warning: [")?;
            Some((
                line.len() - rest.len(),
                line.len() - rest.len() + rest.find("] ")?,
            ))
        };
        told.lines()
            .map(|line| name(line).map(|(from, to)| &line[from..to]))
            .collect()
    };
    let good = match &fault.outcome {
        Outcome::Refused(expected) => code == 2 && parts(expected) && !input.path("out").is_dir(),
        Outcome::Stopped(frames, expected) => {
            let kept = read_run(&input.path("out")).map(|record| record.frames.len());
            code == 2
                && parts(expected)
                && told.contains(&format!(
                    "the run stopped after {frames} of {FRAMES} frames"
                ))
                && told.contains("results so far in out")
                && kept.is_ok_and(|kept| kept == *frames)
        }
        Outcome::Warned(expected) => {
            code == 0 && names().is_some_and(|names| names == *expected) && input.poses().is_some()
        }
        Outcome::Noted(note) => {
            let table = fs::read_to_string(input.path("out/frames.csv")).unwrap_or_default();
            code == 0 && told.is_empty() && table.contains(note)
        }
        Outcome::Same => {
            code == 0 && told.is_empty() && input.poses().as_ref() == Some(&*UNDAMAGED)
        }
    };
    (!good).then(|| format!("{}: exit code {code}: {told}", fault.what))
}

/// Runs all rows of a table and tells of all that fail.
pub(super) fn assert_outcomes(table: &[Fault]) {
    let wrong: Vec<String> = table.iter().filter_map(wrong).collect();
    assert!(
        wrong.is_empty(),
        "{} of {} faults end otherwise:\n{}",
        wrong.len(),
        table.len(),
        wrong.join("\n")
    );
}

/// CRC-32, of PNG chunks and of the program's own files.
pub(super) fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| {
            (sum >> 1) ^ (0xedb8_8320 & (sum & 1).wrapping_neg())
        })
    })
}
