//! `mono-slam batch`: the whole drive of a finished run at once, over its associations.

use std::fmt::Write as _;
use std::path::PathBuf;

use mono_geometry::Se2;
use mono_slam::recorded::RecordedRun;
use mono_slam::smooth::learned_value;
use serde_json::json;
use slam_batch::{Constant, Model, Solution, filter_limit, solve};
use slam_io::configuration::read_configuration;
use slam_io::{LearnedValue, RunScale, check_output_folder, covariance_csv, tum_text, write_files};
use slam_pipeline::PoseEstimate;
use trajectory_eval::{Alignment, absolute_error, spatial};

use super::threshold::{check_ate, metres};
use crate::failure::{Failure, print};

/// Arguments of `mono-slam batch`.
#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Folder that `mono-slam run` wrote
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// Folder for the results; it may be that of the run
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Configuration file for the noise [default: that of the run]
    #[arg(long, value_name = "slam.toml")]
    config: Option<PathBuf>,
    /// Standard deviation before the drive of a constant of the robot, as turning_centre_m=0.5; 0 fixes it. May be given
    /// several times
    #[arg(long, value_name = "NAME=SIGMA", value_parser = prior)]
    prior: Vec<(Constant, f64)>,
    /// Solve at every keyframe over what was known then as well, and write the last poses as trajectory_limit.tum: a filter with
    /// these associations can hardly do better. Takes the time of a batch a keyframe
    #[arg(long)]
    filter_limit: bool,
    /// Exit with code 3 when the error against the sequence's reference is larger
    #[arg(long, value_name = "METRES", value_parser = metres)]
    max_ate: Option<f64>,
}

/// A constant and its standard deviation from `NAME=SIGMA`.
pub(super) fn prior(text: &str) -> Result<(Constant, f64), String> {
    let names = || Constant::ALL.map(Constant::name).join(", ");
    let (name, sigma) = text
        .split_once('=')
        .ok_or_else(|| "expected NAME=SIGMA".to_owned())?;
    let constant = Constant::ALL
        .into_iter()
        .find(|c| c.name() == name)
        .ok_or_else(|| format!("no constant is named {name}; there are {}", names()))?;
    match sigma.parse::<f64>() {
        Ok(sigma) if sigma.is_finite() && sigma >= 0.0 => Ok((constant, sigma)),
        _ => Err(format!("expected a number of at least 0, found {sigma}")),
    }
}

/// Solves, writes, compares, judges.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    check_output_folder(&arguments.out)?;
    let run = RecordedRun::open(&arguments.run)?;
    if arguments.max_ate.is_some() && run.record.reference.is_none() {
        return Err(Failure::input(format!(
            "--max-ate needs a reference path, the sequence of {} has none",
            arguments.run.display()
        )));
    }
    let config = match &arguments.config {
        None => run.config.clone(),
        Some(path) => read_configuration(path)?
            .check()
            .map_err(|e| Failure::input(e.to_string()))?,
    };
    let mut model = Model::of(&config);
    for (constant, sigma) in &arguments.prior {
        model.constants[*constant] = *sigma;
    }
    let unsolved = |e| {
        Failure::input(format!(
            "{}: no batch solution: {e}",
            arguments.run.display()
        ))
    };
    let solution = solve(&run.problem(model.clone())).map_err(unsolved)?;
    let path = run.recording.whole_path(&solution);
    let limit = if arguments.filter_limit {
        let start: Vec<Se2> = path.iter().map(|e| e.pose).collect();
        Some(filter_limit(&run.recording, run.rig, &model, &start).map_err(unsolved)?)
    } else {
        None
    };
    let times: Vec<f64> = run.record.frames.iter().map(|f| f.time_s).collect();
    let errors = errors_m(&run, &times, limit.as_deref(), &path)?;
    let mut files = vec![
        (
            "trajectory_batch.tum",
            tum_text(times.iter().copied().zip(path.iter().map(|e| e.pose))).into_bytes(),
        ),
        ("covariance_batch.csv", covariance_csv(&times, &path)?),
        ("batch.json", as_json(&run, &solution, &errors)?),
    ];
    if let Some(limit) = &limit {
        let text = tum_text(times.iter().copied().zip(limit.iter().copied()));
        files.push(("trajectory_limit.tum", text.into_bytes()));
    }
    write_files(&arguments.out, &files)?;
    print(&as_text(&run, &solution, &errors))?;
    match errors.last() {
        Some((_, rmse_m)) => check_ate(*rmse_m, arguments.max_ate),
        None => Ok(()),
    }
}

/// RMSE of each path against the reference, without alignment, the batch last; empty without a reference.
fn errors_m(
    run: &RecordedRun,
    times: &[f64],
    limit: Option<&[Se2]>,
    batch: &[PoseEstimate],
) -> Result<Vec<(&'static str, f64)>, Failure> {
    let Some(reference) = &run.record.reference else {
        return Ok(Vec::new());
    };
    let reference = spatial(reference);
    let alignment = match run.record.scale {
        RunScale::Metric => Alignment::None,
        RunScale::Arbitrary => Alignment::Sim2,
    };
    let timed = |poses: &mut dyn Iterator<Item = Se2>| -> Vec<(f64, Se2)> {
        times.iter().copied().zip(poses).collect()
    };
    let filtered = timed(&mut run.record.frames.iter().map(|f| f.report.estimate.pose));
    let batch = timed(&mut batch.iter().map(|e| e.pose));
    let limit = limit.map(|limit| timed(&mut limit.iter().copied()));
    [
        Some(("filtered", &filtered)),
        Some(("smoothed", &run.record.smoothed)),
        limit.as_ref().map(|limit| ("limit of a filter", limit)),
        Some(("batch", &batch)),
    ]
    .into_iter()
    .flatten()
    .map(|(name, path)| {
        let error = absolute_error(&spatial(path), &reference, alignment)?;
        Ok((name, error.translation_m.rmse))
    })
    .collect()
}

/// Error of the filter over that of the batch.
fn ratio(errors: &[(&'static str, f64)]) -> Option<f64> {
    let of = |name: &str| errors.iter().find(|(n, _)| *n == name).map(|(_, e)| *e);
    Some(of("filtered")? / of("batch")?).filter(|r| r.is_finite())
}

fn as_json(
    run: &RecordedRun,
    solution: &Solution,
    errors: &[(&'static str, f64)],
) -> Result<Vec<u8>, Failure> {
    let constants: Vec<LearnedValue> = solution.constants.iter().map(learned_value).collect();
    let fit = &solution.fit;
    let value = json!({
        "sequence": run.record.sequence,
        "seed": run.record.seed,
        "keyframes": solution.poses.len(),
        "landmarks": solution.landmarks.len(),
        "sightings": fit.sightings,
        "iterations": solution.iterations,
        "converged": solution.converged,
        "cost": fit.cost,
        "chi_square": {
            "pixels": fit.pixel_chi_square,
            "motion_and_priors": fit.motion_chi_square,
            "degrees_of_freedom": fit.degrees_of_freedom,
        },
        "constants": constants,
        "rmse_m": errors.iter().copied().collect::<std::collections::BTreeMap<_, _>>(),
        "filtered_over_batch": ratio(errors),
    });
    let mut bytes = serde_json::to_vec_pretty(&value).map_err(|e| Failure::Other(e.into()))?;
    bytes.push(b'\n');
    Ok(bytes)
}

fn as_text(run: &RecordedRun, solution: &Solution, errors: &[(&'static str, f64)]) -> String {
    let mut text = String::new();
    // Writing into a String cannot fail.
    let _ = writeln!(
        text,
        "{} of {} frames are keyframes, {} sightings of {} landmarks; {} after {} iterations",
        solution.poses.len(),
        run.recording.frames(),
        solution.fit.sightings,
        solution.landmarks.len(),
        if solution.converged {
            "converged"
        } else {
            "NOT converged"
        },
        solution.iterations,
    );
    if !solution.constants.is_empty() {
        text.push_str(&constants_table(&solution.constants));
    }
    if !errors.is_empty() {
        let alignment = match run.record.scale {
            RunScale::Metric => "no alignment",
            RunScale::Arbitrary => "aligned with scale",
        };
        let _ = writeln!(text, "\n{alignment:<24}{:>12}", "RMSE (mm)");
        for (name, rmse_m) in errors {
            let _ = writeln!(text, "{name:<24}{:>12.2}", rmse_m * 1e3);
        }
    }
    if let Some(ratio) = ratio(errors) {
        let _ = writeln!(text, "{:<24}{ratio:>12.2}", "filtered / batch");
    }
    text
}

/// Learned constants, one a line.
pub(super) fn constants_table(constants: &[slam_batch::LearnedConstant]) -> String {
    let mut text = format!(
        "\n{:<24}{:>12}{:>12}{:>14}\n",
        "constant", "learned", "sigma", "sigma before"
    );
    for c in constants {
        let _ = writeln!(
            text,
            "{:<24}{:>12.6}{:>12.6}{:>14.6}",
            c.constant.name(),
            c.value,
            c.sigma,
            c.prior_sigma
        );
    }
    text
}
