//! `mono-slam run`: a sequence folder in, a folder of results out.

use std::path::{Path, PathBuf};
use std::time::Instant;

use mono_slam::run::{Run, RunError};
use mono_slam::{warnings, without_odometry};
use slam_io::{
    OdometrySource, RunIdentity, RunRecord, RunScale, Sequence, Warning, check_output_folder,
    configuration::{self, read_configuration},
    odometry_csv, write_run,
};
use slam_pipeline::config::{Config, Method, Robot, ValidConfig};
use slam_pipeline::{MapUse, Tracking};
use slam_report::render_run_html;
use trajectory_eval::{Alignment, absolute_error, spatial};

use super::checkpoints::{CheckpointOptions, Checkpoints};
use super::interrupt::Interrupt;
use super::map_file::MapFile;
use super::reporter::Reporter;
use super::sequence_options::SequenceOptions;
use super::stand_in::StandIn;
use super::threshold::{check_ate, metres, whole};
use crate::failure::{Failure, remark, tell};

/// Arguments of `mono-slam run`.
#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Map of an earlier run, to begin in and to extend; the world is that of the map
    #[arg(long, value_name = "map.slam")]
    map: Option<PathBuf>,
    #[command(flatten)]
    run: RunOptions,
}

/// Arguments of every command that runs the filter.
#[derive(Debug, clap::Args)]
pub(crate) struct RunOptions {
    /// Sequence: a folder with images/, times.txt, camera.toml and odometry.csv, one of EuRoC, TUM RGB-D or KITTI,
    /// or a recorded log (.bag, .mcap, .db3)
    #[arg(value_name = "SEQ")]
    sequence: PathBuf,
    #[command(flatten)]
    options: SequenceOptions,
    #[command(flatten)]
    stand_in: StandIn,
    /// Folder for the results; made when the run ends
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Configuration file; `mono-slam config` prints the default
    #[arg(long, value_name = "slam.toml")]
    config: Option<PathBuf>,
    /// Kind of robot: the defaults of noise, turning centre and keyframes
    #[arg(long, value_enum, conflicts_with = "config")]
    robot: Option<RobotName>,
    /// Which filter runs
    #[arg(long, value_enum)]
    method: Option<MethodName>,
    /// Number of particles
    #[arg(long, value_parser = whole::<u32>)]
    particles: Option<u32>,
    /// Seed of all random numbers
    #[arg(long, value_parser = whole::<u64>)]
    seed: Option<u64>,
    /// Threads; 0 takes all cores, the results do not depend on it
    #[arg(long, value_parser = whole::<u32>)]
    threads: Option<u32>,
    #[command(flatten)]
    checkpoint: CheckpointOptions,
    /// No progress, no summary
    #[arg(long)]
    quiet: bool,
    /// Exit with code 3 when the error against the sequence's reference is larger
    #[arg(long, value_name = "METRES", value_parser = metres)]
    max_ate: Option<f64>,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum RobotName {
    /// A decimetre or two, such as a model car
    TableTop,
    /// Some decimetres, driven indoors
    Room,
    /// Metres, steered
    Car,
}

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
enum MethodName {
    /// The paper's filter made exact
    Exact,
    /// The paper's printed formulas
    Paper,
    /// Poses from odometry, weights from the likelihood
    Conventional,
}

/// Why the loop over the frames ended.
enum End {
    Done,
    /// A signal of this number.
    Interrupted(i32),
    /// The input or the filter.
    Broken(RunError),
}

/// Runs and writes the results.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let map = arguments.map.as_deref();
    drive(&arguments.run, map.map(|path| (path, MapUse::Extend)))
}

/// Runs in a map or in none, and writes the results.
pub(crate) fn drive(arguments: &RunOptions, map: Option<(&Path, MapUse)>) -> Result<(), Failure> {
    let config = settings(arguments)?;
    checked(config.clone())?;
    check_output_folder(&arguments.out)?;
    not_the_sequence(&arguments.out, &arguments.sequence)?;
    let map = map
        .map(|(path, usage)| MapFile::read(path, usage))
        .transpose()?;
    let options = arguments.stand_in.options(arguments.options.open_options());
    let sequence = Sequence::open_with(&arguments.sequence, &options)?;
    let config = if sequence.odometry_source == OdometrySource::None {
        checked(without_odometry::settings(config, &sequence.times_s))?
    } else {
        checked(config)?
    };
    if arguments.max_ate.is_some() && sequence.reference.is_none() {
        return Err(Failure::input(format!(
            "--max-ate needs a reference path, {} has none",
            arguments.sequence.display()
        )));
    }
    let reference = warnings::of_reference(&sequence);
    if let (Some(_), Some(warning)) = (arguments.max_ate, &reference)
        && warning.name == "reference-elsewhere"
    {
        return Err(Failure::input(format!("--max-ate: {}", warning.message)));
    }
    let checkpoints = Checkpoints::of(
        &arguments.checkpoint,
        &arguments.out,
        RunIdentity::of(
            &sequence,
            &without_threads(&config),
            map.as_ref().map(MapFile::identity),
        ),
    )?;
    let started = Instant::now();
    let clock = move || started.elapsed().as_secs_f64();
    let mut run = match (checkpoints.stored()?, &map) {
        (Some(state), _) => Run::resume(&sequence, &config, &clock, &state)
            .map_err(|error| checkpoints.refused(&error))?,
        (None, None) => Run::begin(&sequence, &config, &clock)?,
        (None, Some(map)) => Run::begin_in(&sequence, &config, &clock, &map.known, map.usage)?,
    };
    let of_map = map
        .as_ref()
        .map_or_else(Vec::new, |map| map.warnings(&sequence));
    // What the files tell is told before the run, what the images tell after it; all of it even when quiet: a run whose
    // inputs do not fit must not end without a word.
    let before: Vec<&Warning> = sequence
        .warnings
        .iter()
        .chain(&reference)
        .chain(&of_map)
        .collect();
    for warning in &before {
        warn(warning);
    }
    if run.frames() > 0 {
        remark(&format!("going on after {} frames", run.frames()));
    }
    let interrupt = Interrupt::listen()?;
    let reporter = Reporter::new(arguments.quiet, sequence.images.len());
    let end = loop {
        match run.step() {
            Ok(Some(progress)) => reporter.report(progress),
            Ok(None) => break End::Done,
            Err(error) if run.frames() == 0 => return Err(error.into()),
            Err(error) => break End::Broken(error),
        }
        if let Some(signal) = interrupt.signal() {
            break End::Interrupted(signal);
        }
        checkpoints.after(&mut run)?;
    };
    reporter.finish();
    match end {
        End::Done => {
            let mut record = run.finish();
            record.warnings.extend(of_map.iter().cloned());
            write_results(&record, &sequence, &arguments.out)?;
            checkpoints.remove()?;
            for warning in record.warnings.iter().filter(|w| !before.contains(w)) {
                warn(warning);
            }
            let ate = ate_m(&record)?;
            if !arguments.quiet {
                tell(&summary(
                    &record,
                    ate,
                    map.is_some(),
                    &arguments.out.display().to_string(),
                ));
            }
            match ate {
                Some(ate) => check_ate(ate, arguments.max_ate),
                None => Ok(()),
            }
        }
        End::Interrupted(signal) => {
            let so_far = keep(
                run,
                &checkpoints,
                &sequence,
                &arguments.out,
                "it was interrupted",
            )?;
            Err(Failure::Interrupted {
                signal,
                sentence: format!("interrupted {so_far}"),
            })
        }
        End::Broken(error) => {
            let reason = error.to_string();
            let so_far = keep(run, &checkpoints, &sequence, &arguments.out, &reason)?;
            Err(Failure::from(error).with(&format!("the run stopped {so_far}")))
        }
    }
}

/// Keeps the checkpoint and the results of a run that ends early; says in a clause where they are and how to go on.
fn keep(
    mut run: Run<'_>,
    checkpoints: &Checkpoints,
    sequence: &Sequence,
    out: &Path,
    reason: &str,
) -> Result<String, Failure> {
    let (frames, all) = (run.frames(), sequence.images.len());
    let stored = checkpoints.save(&mut run);
    let mut record = run.finish();
    record.warnings.push(Warning::new(
        "run-incomplete",
        format!("The run ended after {frames} of {all} frames: {reason}"),
    ));
    write_results(&record, sequence, out)?;
    let going_on = match stored {
        Ok(()) => "the same command with --resume goes on".to_owned(),
        Err(failure) => format!("it cannot go on, for there is no checkpoint: {failure}"),
    };
    Ok(format!(
        "after {frames} of {all} frames; results so far in {}; {going_on}",
        out.display()
    ))
}

/// Refuses results in the folder of the sequence: camera and odometry of the run would replace its own.
fn not_the_sequence(out: &Path, sequence: &Path) -> Result<(), Failure> {
    match (out.canonicalize(), sequence.canonicalize()) {
        (Ok(one), Ok(other)) if one == other => Err(Failure::input(format!(
            "{}: results cannot go there: it is the sequence, whose camera.toml and odometry.csv they would replace; give \
             another folder",
            out.display()
        ))),
        _ => Ok(()),
    }
}

fn write_results(record: &RunRecord, sequence: &Sequence, out: &Path) -> Result<(), Failure> {
    let page = render_run_html(record).into_bytes();
    let mut beside = sequence.input_files()?;
    if !record.predicted.is_empty() {
        // What the filter expected stands for the odometry in a batch over the run.
        beside.retain(|(name, _)| *name != "odometry.csv");
        beside.push(("odometry.csv", odometry_csv(&record.predicted).into_bytes()));
    }
    beside.push(("report.html", page));
    write_run(record, out, &beside)?;
    Ok(())
}

/// The configuration as the identity of a run has it: results do not depend on the number of threads.
fn without_threads(config: &Config) -> String {
    let mut config = config.clone();
    config.filter.threads = 0;
    configuration::to_toml(&config)
}

fn settings(arguments: &RunOptions) -> Result<Config, Failure> {
    let mut config = match &arguments.config {
        None => Config::for_robot(match arguments.robot {
            Some(RobotName::TableTop) => Robot::TableTop,
            None | Some(RobotName::Room) => Robot::Room,
            Some(RobotName::Car) => Robot::Car,
        }),
        Some(path) => read_configuration(path)?,
    };
    if let Some(method) = arguments.method {
        config.filter.method = match method {
            MethodName::Exact => Method::Exact,
            MethodName::Paper => Method::Paper,
            MethodName::Conventional => Method::Conventional,
        };
    }
    if let Some(particles) = arguments.particles {
        config.filter.particles = particles;
    }
    if let Some(seed) = arguments.seed {
        config.filter.seed = seed;
    }
    if let Some(threads) = arguments.threads {
        config.filter.threads = threads;
    }
    Ok(config)
}

fn checked(config: Config) -> Result<ValidConfig, Failure> {
    config.check().map_err(|e| Failure::input(e.to_string()))
}

/// Position error against the reference, metres: without alignment, or up to scale where the run has none.
fn ate_m(record: &RunRecord) -> Result<Option<f64>, Failure> {
    let Some(reference) = &record.reference else {
        return Ok(None);
    };
    if record
        .warnings
        .iter()
        .any(|w| w.name == "reference-elsewhere")
    {
        return Ok(None);
    }
    let estimate: Vec<_> = record
        .frames
        .iter()
        .map(|f| (f.time_s, f.report.estimate.pose))
        .collect();
    match record.scale {
        RunScale::Metric => {
            let error = absolute_error(&spatial(&estimate), &spatial(reference), Alignment::None)?;
            Ok(Some(error.translation_m.rmse))
        }
        // A path that never moved has no scale to align, and no error either.
        RunScale::Arbitrary => {
            let aligned = absolute_error(&spatial(&estimate), &spatial(reference), Alignment::Sim2);
            Ok(aligned.ok().map(|error| error.translation_m.rmse))
        }
    }
}

fn summary(record: &RunRecord, ate_m: Option<f64>, in_map: bool, out: &str) -> String {
    let frames = record.frames.len();
    let error = ate_m.map_or_else(String::new, |e| {
        let alignment = match record.scale {
            RunScale::Metric if in_map => "no alignment, in the world of the map",
            RunScale::Metric => "no alignment",
            RunScale::Arbitrary => "after alignment with scale",
        };
        format!(", position error {:.1} mm RMSE ({alignment})", e * 1e3)
    });
    let lost = record
        .frames
        .iter()
        .filter(|frame| frame.report.tracking == Tracking::Lost)
        .count();
    let lost = match lost {
        0 => String::new(),
        lost => format!(", {lost} of them lost"),
    };
    format!(
        "{frames} frames in {:.1} s ({:.1} Hz){lost}, {} landmarks{error}; results in {out}",
        record.wall_s,
        frames as f64 / record.wall_s.max(1e-9),
        record.landmarks.len(),
    )
}

fn warn(warning: &Warning) {
    tell(&format!("mono-slam: warning: {warning}"));
}
