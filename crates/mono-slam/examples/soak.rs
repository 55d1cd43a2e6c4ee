//! Runs a long sequence with a known truth and tells, for every stretch of it, time, memory, landmarks and honesty of a
//! frame: `soak SEQ [--every FRAMES] [--config FILE]`. `cargo xtask scene --kind room --soak --out SEQ` renders such a
//! sequence.
//!
//! The columns: frames done; milliseconds of a frame in the filter (mean and largest); resident memory after the stretch,
//! megabytes (0 where there is no `/proc`); landmarks in the map; keyframes so far; error of the position (root mean square
//! and last, metres) and of the heading (root mean square, radians); the stated position error (root mean square); the
//! shares of the frames whose truth lies within three sigma in x and y, and in heading; frames without a match.

use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use mono_geometry::Se2;
use slam_io::{Sequence, configuration};
use slam_pipeline::config::Config;
use slam_pipeline::{FrameInput, FrameReport, OdometryInterval, Rig, Slam, detector_of};
use vision_sift::{Features, GrayImage, Workspace};

/// Added to a stated standard deviation, metres and radians: the truth of the first frame is the origin by definition.
const LEAST_SIGMA: f64 = 1e-4;

/// Sums over a stretch of frames.
#[derive(Debug, Default, Clone, Copy)]
struct Stretch {
    frames: usize,
    step_ms: f64,
    slowest_ms: f64,
    squared_m2: f64,
    squared_rad2: f64,
    stated_m2: f64,
    inside_position: usize,
    inside_heading: usize,
    blind: usize,
    last_m: f64,
}

impl Stretch {
    fn add(&mut self, report: &FrameReport, truth: &Se2, step_ms: f64) {
        let (pose, covariance) = (report.estimate.pose, report.estimate.covariance);
        let error = [
            pose.x - truth.x,
            pose.y - truth.y,
            wrapped(pose.phi - truth.phi),
        ];
        let within = |axis: usize| {
            error[axis].abs() <= 3.0 * (covariance[(axis, axis)].max(0.0).sqrt() + LEAST_SIGMA)
        };
        self.frames += 1;
        self.step_ms += step_ms;
        self.slowest_ms = self.slowest_ms.max(step_ms);
        self.squared_m2 += error[0] * error[0] + error[1] * error[1];
        self.squared_rad2 += error[2] * error[2];
        self.stated_m2 += covariance[(0, 0)] + covariance[(1, 1)];
        self.inside_position += usize::from(within(0) && within(1));
        self.inside_heading += usize::from(within(2));
        self.blind += usize::from(report.matches == 0);
        self.last_m = error[0].hypot(error[1]);
    }

    fn row(&self, done: usize, landmarks: usize, keyframes: usize) -> String {
        let n = self.frames.max(1) as f64;
        let rms = |sum: f64| (sum / n).sqrt();
        let share = |count: usize| 100.0 * count as f64 / n;
        format!(
            "| {done} | {:.1} | {:.0} | {:.0} | {landmarks} | {keyframes} | {:.4} | {:.4} | {:.4} | {:.4} | {:.1} | {:.1} | {} |",
            self.step_ms / n,
            self.slowest_ms,
            resident_mb(),
            rms(self.squared_m2),
            self.last_m,
            rms(self.squared_rad2),
            rms(self.stated_m2),
            share(self.inside_position),
            share(self.inside_heading),
            self.blind,
        )
    }
}

fn wrapped(angle: f64) -> f64 {
    angle.sin().atan2(angle.cos())
}

/// Resident memory of this process, megabytes.
fn resident_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    let kb = line.and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok());
    kb.unwrap_or(0.0) / 1024.0
}

struct Arguments {
    sequence: PathBuf,
    every: usize,
    config: Config,
}

fn arguments() -> Result<Arguments, Box<dyn Error>> {
    let usage = "usage: soak SEQ [--every FRAMES] [--config FILE]";
    let (mut sequence, mut every, mut config) = (None, 1000, Config::default());
    let mut given = std::env::args().skip(1);
    while let Some(argument) = given.next() {
        match argument.as_str() {
            "--every" => every = given.next().ok_or(usage)?.parse::<usize>()?.max(1),
            "--config" => {
                let file = given.next().ok_or(usage)?;
                config = configuration::from_toml(&std::fs::read_to_string(file)?)?;
            }
            _ => sequence = Some(PathBuf::from(argument)),
        }
    }
    Ok(Arguments {
        sequence: sequence.ok_or(usage)?,
        every,
        config,
    })
}

#[expect(clippy::print_stdout, reason = "an example reports on the terminal")]
fn main() -> Result<(), Box<dyn Error>> {
    let Arguments {
        sequence,
        every,
        config,
    } = arguments()?;
    let sequence = Sequence::open(&sequence)?;
    let truth = sequence
        .reference
        .clone()
        .ok_or("the sequence has no ground truth")?;
    let config = sequence.camera.considered_in(&config).check()?;
    let (camera, mount) = sequence.camera.camera_and_mount()?;
    let mut slam = Slam::new(Rig { camera, mount }, &config)?;
    let detector = detector_of(&config)?;
    let (mut workspace, mut features) = (Workspace::new(), Features::default());
    println!(
        "| frames | ms | slowest | MB | landmarks | keyframes | rms m | last m | rms rad | stated m | % in 3 sigma | % heading | blind |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|---|---|---|");
    let (mut stretch, mut keyframes) = (Stretch::default(), 0);
    for (index, &time_s) in sequence.times_s.iter().enumerate() {
        let image = sequence.load_image(index)?;
        let view = GrayImage::new(image.width, image.height, &image.pixels)?;
        detector.detect(&view, &mut workspace, &mut features)?;
        let before = if index == 0 {
            Vec::new()
        } else {
            sequence.odometry_between(sequence.times_s[index - 1], time_s)
        };
        let odometry: Vec<OdometryInterval> = before
            .into_iter()
            .map(|(duration_s, v_mps, omega_radps)| OdometryInterval {
                duration_s,
                v_mps,
                omega_radps,
            })
            .collect();
        let input = FrameInput {
            features: &features,
            odometry: &odometry,
        };
        let started = Instant::now();
        let report = slam.step(&input, &mut |_| {})?;
        let step_ms = started.elapsed().as_secs_f64() * 1e3;
        keyframes += usize::from(report.keyframe);
        let known = truth.partition_point(|(t, _)| *t < time_s - 1e-6);
        if let Some((_, pose)) = truth.get(known).filter(|(t, _)| (t - time_s).abs() < 1e-3) {
            stretch.add(&report, pose, step_ms);
        }
        let done = index + 1;
        if done % every == 0 || done == sequence.times_s.len() {
            println!("{}", stretch.row(done, report.landmarks, keyframes));
            stretch = Stretch::default();
        }
    }
    Ok(())
}
