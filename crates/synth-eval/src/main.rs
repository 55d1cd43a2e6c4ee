//! `synth-eval`: compares the filters on rendered scenes and recorded sequences and prints the tables.
//!
//! Exit code 0 done, 2 wrong arguments, 3 something got worse, 1 anything else.

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a terminal program"
)]

mod arguments;

use arguments::Command;
use std::process::ExitCode;

/// Exit code of a study in which something got worse.
const WORSE: u8 = 3;

fn main() -> ExitCode {
    let command = match arguments::parse(std::env::args_os().skip(1)) {
        Ok(command) => command,
        Err(error) => {
            eprintln!("synth-eval: {error} (synth-eval --help)");
            return ExitCode::from(2);
        }
    };
    let tell = |line: &str| eprintln!("{line}");
    let outcome = match &command {
        Command::Help => {
            print!("{}\n{}", arguments::HELP, synth_eval::effects_help());
            return ExitCode::SUCCESS;
        }
        Command::Run(options) => synth_eval::run(options, &tell),
        Command::Merge {
            files,
            compare,
            out,
        } => synth_eval::merge(files, compare.as_deref(), out),
        Command::Figures(options) => synth_eval::figures(options, &tell),
    };
    match outcome {
        Ok(outcome) => {
            print!("{}", outcome.text);
            if outcome.worse > 0 {
                ExitCode::from(WORSE)
            } else {
                ExitCode::SUCCESS
            }
        }
        Err(error) => {
            eprintln!("synth-eval: {error:#}");
            ExitCode::FAILURE
        }
    }
}
