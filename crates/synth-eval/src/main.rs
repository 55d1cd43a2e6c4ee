//! `synth-eval`: compares the filters on rendered walls and prints the table.
//!
//! Exit code 0 done, 2 wrong arguments, 1 anything else.

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a terminal program"
)]

mod arguments;

use arguments::Command;
use std::process::ExitCode;

fn main() -> ExitCode {
    let command = match arguments::parse(std::env::args_os().skip(1)) {
        Ok(command) => command,
        Err(error) => {
            eprintln!("synth-eval: {error} (synth-eval --help)");
            return ExitCode::from(2);
        }
    };
    let options = match command {
        Command::Help => {
            print!("{}", arguments::HELP);
            return ExitCode::SUCCESS;
        }
        Command::Run(options) => options,
    };
    match synth_eval::run(&options, &|line| eprintln!("{line}")) {
        Ok(table) => {
            print!("{table}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("synth-eval: {error:#}");
            ExitCode::FAILURE
        }
    }
}
