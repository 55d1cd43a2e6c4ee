//! `mono-slam report`: the page of a finished run, drawn again.

use std::path::PathBuf;

use slam_pipeline::output::rebuild_report;

use crate::failure::Failure;

/// What to draw.
#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Folder of a finished run
    #[arg(value_name = "DIR")]
    dir: PathBuf,
}

/// Draws the page; says nothing on success.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    Ok(rebuild_report(&arguments.dir)?)
}
