//! `cargo xtask`: exit code 0 done, 2 wrong arguments, 1 anything else.

#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a terminal program"
)]

use std::process::ExitCode;
use xtask::flags::{self, Command};
use xtask::{board, ci, fixtures, scene::Scene, synth_eval, tidy, workspace_root};

fn main() -> ExitCode {
    let command = match flags::parse(std::env::args_os().skip(1)) {
        Ok(command) => command,
        Err(error) => {
            eprintln!("xtask: {error} (cargo xtask --help)");
            return ExitCode::from(2);
        }
    };
    match run(command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Help => print!("{}", flags::HELP),
        Command::Scene { out, spec } => {
            Scene::new(spec)?.write(&out)?;
            println!("{}", out.display());
        }
        Command::Board { out, spec } => {
            board::write_set(&spec, &out)?;
            println!("{}", out.display());
        }
        Command::Fixtures { check: true } => fixtures::check(&workspace_root())?,
        Command::Fixtures { check: false } => fixtures::write(&workspace_root())?,
        Command::SynthEval(options) => {
            let table = synth_eval::run(&options, &|line| eprintln!("{line}"))?;
            print!("{table}");
        }
        Command::Tidy => tidy::run(&workspace_root())?,
        Command::Ci => ci::run(&workspace_root())?,
    }
    Ok(())
}
