//! The command-line program: arguments, messages, exit codes. No algorithms live here.
//!
//! Exit codes: 0 done; 2 bad input or arguments, with one sentence on standard error; 3 a
//! threshold such as `--max-ate` was not met; 1 anything else. Standard output carries only
//! what was asked for.

mod commands;
mod failure;

use std::io::Write as _;
use std::process::ExitCode;

use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};

use commands::{
    batch, calibrate, camera, compare, config, eval, features, info, localize, match_images,
    report, run,
};

/// Monocular landmark SLAM for wheeled robots.
#[derive(Debug, Parser)]
#[command(name = "mono-slam", version, about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Run SLAM on a sequence folder
    Run(run::Arguments),
    /// Find a robot in the map of an earlier run, which stays as it is
    Localize(localize::Arguments),
    /// Tell what lies in a sequence and what a run of it still needs
    Info(info::Arguments),
    /// Solve the whole drive of a finished run at once: the limit of its filter, and constants of the robot
    Batch(batch::Arguments),
    /// Compare trajectories with a reference: absolute and relative error
    Eval(eval::Arguments),
    /// Draw report.html of a finished run again from its other files
    Report(report::Arguments),
    /// Draw one page about two finished runs: paths, errors, uncertainties and counts side by side
    Compare(compare::Arguments),
    /// Detect SIFT features and write them as CSV
    Features(features::Arguments),
    /// Match two images
    Match(match_images::Arguments),
    /// Calibrate a camera from images of a checkerboard, or refine it over recorded runs
    Calibrate(calibrate::Arguments),
    /// Convert a camera calibration of many tools to camera.toml, Kalibr, OpenCV or ROS
    Camera(camera::Arguments),
    /// Print the default configuration with every key explained
    Config,
}

fn main() -> ExitCode {
    let outcome = match arguments().command {
        Command::Run(arguments) => run::run(&arguments),
        Command::Localize(arguments) => localize::run(&arguments),
        Command::Info(arguments) => info::run(&arguments),
        Command::Batch(arguments) => batch::run(&arguments),
        Command::Features(arguments) => features::run(&arguments),
        Command::Match(arguments) => match_images::run(&arguments),
        Command::Calibrate(arguments) => calibrate::run(&arguments),
        Command::Camera(arguments) => camera::run(&arguments),
        Command::Config => config::run(),
        Command::Eval(arguments) => eval::run(&arguments),
        Command::Report(arguments) => report::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            // With standard error closed there is nobody left to tell.
            let _ = writeln!(std::io::stderr(), "mono-slam: {failure}");
            ExitCode::from(failure.exit_code())
        }
    }
}

/// The command line. Negative numbers are values, so that the value's own sentence answers them.
fn arguments() -> Cli {
    let mut command = Cli::command();
    let names: Vec<String> = command
        .get_subcommands()
        .map(|sub| sub.get_name().to_owned())
        .collect();
    for name in names {
        command = command.mut_subcommand(name, |sub| sub.allow_negative_numbers(true));
    }
    Cli::from_arg_matches(&command.get_matches()).unwrap_or_else(|error| error.exit())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arguments_are_consistent() {
        Cli::command().debug_assert();
    }
}
