//! The programs of the workspace as processes, compiled for speed when they are first needed.

use anyhow::{Context, ensure};
use std::ffi::{OsStr, OsString};
use std::path::Path;
use std::process::{Command, ExitCode};

/// Runs a program in the present folder and hands its exit code on.
///
/// # Errors
/// Cargo cannot be started.
pub(crate) fn hand_on(package: &str, arguments: &[OsString]) -> anyhow::Result<ExitCode> {
    let status = program(package)
        .args(arguments)
        .status()
        .context("cannot run cargo")?;
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    Ok(code.map_or(ExitCode::FAILURE, ExitCode::from))
}

/// Runs a program in `folder` and waits for its success; its standard output is dropped.
///
/// # Errors
/// The program fails, or cannot be started.
pub(crate) fn run<A: AsRef<OsStr>>(
    folder: &Path,
    package: &str,
    arguments: &[A],
) -> anyhow::Result<()> {
    let status = program(package)
        .args(arguments)
        .current_dir(folder)
        .stdout(std::process::Stdio::null())
        .status()
        .context("cannot run cargo")?;
    ensure!(status.success(), "{package} failed: {status}");
    Ok(())
}

/// `cargo run` of a package, up to its arguments.
fn program(package: &str) -> Command {
    let mut command = Command::new(cargo());
    command.args(["run", "--release", "--quiet", "--package", package, "--"]);
    command
}

/// The cargo that started this program, or the one on the path.
pub(crate) fn cargo() -> OsString {
    std::env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo"))
}
