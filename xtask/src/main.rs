//! `cargo xtask`: exit code 0 done, 2 wrong arguments, 1 anything else, or the code of the program it started.

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a terminal program"
)]

mod arguments;
mod ci;
mod fixtures;
mod package;
mod programs;
mod tidy;

use arguments::Command;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

fn main() -> ExitCode {
    let command = match arguments::parse(std::env::args_os().skip(1)) {
        Ok(command) => command,
        Err(error) => {
            eprintln!("xtask: {error} (cargo xtask --help)");
            return ExitCode::from(2);
        }
    };
    match run(command) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> anyhow::Result<ExitCode> {
    let root = workspace_root();
    match command {
        Command::Help => print!("{}", arguments::HELP),
        Command::Program { package, arguments } => {
            return programs::hand_on(package, &arguments);
        }
        Command::Fixtures { check: true } => fixtures::check(&root)?,
        Command::Fixtures { check: false } => fixtures::write(&root)?,
        Command::Tidy { stats: true } => print!("{}", tidy::table(&root)?),
        Command::Tidy { stats: false } => tidy::run(&root)?,
        Command::Package(options) => {
            let metadata = tidy::metadata(&root)?;
            print!("{}", package::run(&root, &metadata, &options)?);
        }
        Command::Ci => ci::run(&root)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Folder of the workspace this program was built from.
fn workspace_root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_path_buf()
}
