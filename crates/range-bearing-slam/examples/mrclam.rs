//! Five robots map 15 landmarks: the UTIAS MRCLAM data set 6, with the landmarks' barcodes and without.
//!
//! `cargo run --release -p range-bearing-slam --example mrclam [-- --quick] [-- --out FOLDER]`
//!
//! Every robot is a run of its own that starts at its true pose, so errors are given as they are and after
//! the rigid motion that fits the path best. With `--out` paths and maps are written as CSV.
//!
//! The standard deviations of the sensor are the robust ones measured in the data (0.08 to 0.18 m, 0.006
//! to 0.011 rad), widened for offsets and the few per cent of wrong readings that a Gaussian does not
//! model; those of the odometry are usual for commanded velocities of such robots (10 % in speed, 20 % in
//! turning over a second). Nothing is corrected by the true paths; the thresholds of the association were
//! chosen among about ten settings by the path error of two seeds.

#[path = "support/align.rs"]
mod align;
#[path = "support/arguments.rs"]
mod arguments;
#[path = "support/motion.rs"]
mod motion;
#[path = "support/mrclam_data.rs"]
mod mrclam_data;
#[path = "support/mrclam_filters.rs"]
mod mrclam_filters;
#[path = "support/published.rs"]
mod published;
#[path = "support/run.rs"]
mod run;
#[path = "support/tables.rs"]
mod tables;

use align::{fit_rigid, mean_squared, moved};
use arguments::Arguments;
use mrclam_data::Run;
use mrclam_filters::{Filter, dead_reckoning, estimate};
use nalgebra::Vector2;
use run::Estimate;
use std::error::Error;
use std::fmt::Write;

const PARTICLES: usize = 50;

/// Root mean square errors in metres.
#[derive(Clone, Copy, Default)]
struct Errors {
    path: f64,
    path_aligned: f64,
    landmarks: f64,
    landmarks_aligned: f64,
    /// Number of landmarks in the map.
    count: f64,
}

/// The errors of an estimate. If it is `named`, the ids of its map are subjects; otherwise each landmark
/// is compared with the surveyed one that is nearest once the path is aligned.
fn errors(run: &Run, estimate: &Estimate, named: bool) -> Errors {
    let truth: Vec<_> = run
        .instants
        .iter()
        .map(|instant| instant.truth.xy())
        .collect();
    let path: Vec<_> = estimate.poses.iter().map(|pose| pose.xy()).collect();
    let motion = fit_rigid(&path, &truth);
    let mut errors = Errors {
        path: mean_squared(&path, &truth).sqrt(),
        path_aligned: mean_squared(&moved(&path, &motion), &truth).sqrt(),
        count: estimate.landmarks.len() as f64,
        ..Errors::default()
    };
    let (found, surveyed): (Vec<_>, Vec<_>) = estimate
        .landmarks
        .iter()
        .filter_map(|(id, at)| {
            let there = motion.0 * at + motion.1;
            let nearest = || {
                run.landmarks
                    .values()
                    .min_by(|a, b| (*a - there).norm().total_cmp(&(*b - there).norm()))
            };
            let surveyed = if named {
                run.landmarks.get(id)
            } else {
                nearest()
            };
            surveyed.map(|surveyed| (*at, *surveyed))
        })
        .unzip();
    if !found.is_empty() {
        errors.landmarks = mean_squared(&found, &surveyed).sqrt();
        let motion = fit_rigid(&found, &surveyed);
        errors.landmarks_aligned = mean_squared(&moved(&found, &motion), &surveyed).sqrt();
    }
    errors
}

#[expect(clippy::print_stdout, reason = "an example shows its result")]
fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse()?;
    let (seconds, seeds) = if arguments.quick {
        (300.0, 1)
    } else {
        (f64::INFINITY, 5_u32)
    };
    let Some(data) = tables::data_folder("mrclam6") else {
        return Ok(());
    };
    println!("{PARTICLES} particles, mean of {seeds} seeds; root mean square errors in metres\n");
    println!(
        "| robot | filter | path | path aligned | landmarks | landmarks aligned | landmarks in the map |"
    );
    println!("|---|---|--:|--:|--:|--:|--:|");
    for robot in 1..=5 {
        let run = mrclam_data::load(&data, robot, seconds)?;
        let mut csv = "filter,kind,id,x_m,y_m\n".to_owned();
        let mut line =
            |name: &str, estimates: &[Estimate], named: bool| -> Result<(), Box<dyn Error>> {
                let all: Vec<_> = estimates
                    .iter()
                    .map(|estimate| errors(&run, estimate, named))
                    .collect();
                let mean = |value: fn(&Errors) -> f64| {
                    all.iter().map(value).sum::<f64>() / all.len() as f64
                };
                println!(
                    "| {robot} | {name} | {:.2} | {:.2} | {:.2} | {:.2} | {:.1} |",
                    mean(|errors| errors.path),
                    mean(|errors| errors.path_aligned),
                    mean(|errors| errors.landmarks),
                    mean(|errors| errors.landmarks_aligned),
                    mean(|errors| errors.count),
                );
                Ok(rows(&mut csv, name, &estimates[0])?)
            };
        line("dead reckoning", &[dead_reckoning(&run)], true)?;
        for filter in Filter::ALL {
            let estimates: Vec<_> = (0..seeds)
                .map(|seed| estimate(&run, filter, PARTICLES, u64::from(seed)))
                .collect::<Result<_, _>>()?;
            line(&filter.name(), &estimates, filter.reads_barcodes)?;
        }
        let truth = Estimate {
            poses: run.instants.iter().map(|instant| instant.truth).collect(),
            landmarks: run.landmarks.iter().map(|(&id, &at)| (id, at)).collect(),
        };
        rows(&mut csv, "truth", &truth)?;
        if let Some(folder) = &arguments.out {
            std::fs::write(folder.join(format!("mrclam_robot{robot}.csv")), csv)?;
        }
    }
    Ok(())
}

fn rows(csv: &mut String, name: &str, estimate: &Estimate) -> Result<(), std::fmt::Error> {
    let mut row = |kind: &str, id: u32, at: Vector2<f64>| {
        writeln!(csv, "{name},{kind},{id},{:.3},{:.3}", at.x, at.y)
    };
    for (index, pose) in (0..).zip(&estimate.poses) {
        row("pose", index, pose.xy())?;
    }
    for (id, at) in &estimate.landmarks {
        row("landmark", *id, *at)?;
    }
    Ok(())
}
