//! `wall-scenes`: renders a scene or pictures of a checkerboard into a folder, whose name it prints.
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
use wall_scenes::{Scene, SceneError, write_board_set};

fn main() -> ExitCode {
    let command = match arguments::parse(std::env::args_os().skip(1)) {
        Ok(command) => command,
        Err(error) => {
            eprintln!("wall-scenes: {error} (wall-scenes --help)");
            return ExitCode::from(2);
        }
    };
    match run(command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("wall-scenes: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command) -> Result<(), SceneError> {
    match command {
        Command::Help => print!("{}", arguments::HELP),
        Command::Scene { out, spec } => {
            Scene::new(spec)?.write(&out)?;
            println!("{}", out.display());
        }
        Command::Board { out, spec } => {
            write_board_set(&spec, &out)?;
            println!("{}", out.display());
        }
    }
    Ok(())
}
