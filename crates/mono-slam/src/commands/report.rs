//! `mono-slam report`: the page of a finished run, drawn again.

use std::path::PathBuf;

use slam_io::{check_output_file, read_run, write_file};
use slam_report::render_run_html;

use crate::failure::Failure;

/// Arguments of `mono-slam report`.
#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Folder of a finished run
    #[arg(value_name = "DIR")]
    dir: PathBuf,
}

/// Draws the page; says nothing on success.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let run = read_run(&arguments.dir)?;
    check_output_file(&arguments.dir.join("report.html"))?;
    let page = render_run_html(&run);
    Ok(write_file(
        &arguments.dir.join("report.html"),
        page.as_bytes(),
    )?)
}
