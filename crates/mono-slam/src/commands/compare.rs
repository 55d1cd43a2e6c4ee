//! `mono-slam compare`: one page about two finished runs.

use std::path::{Path, PathBuf};

use slam_io::{check_output_file, read_run, write_file};
use slam_report::render_comparison_html;

use crate::failure::Failure;

/// Arguments of `mono-slam compare`.
#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Folder of the first run
    #[arg(value_name = "RUN_A")]
    first: PathBuf,
    /// Folder of the second run
    #[arg(value_name = "RUN_B")]
    second: PathBuf,
    /// Page to write
    #[arg(long, value_name = "FILE.html")]
    out: PathBuf,
}

/// Draws the page; says nothing on success.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    check_output_file(&arguments.out)?;
    let (first, second) = (read_run(&arguments.first)?, read_run(&arguments.second)?);
    let [name_a, name_b] = names(&arguments.first, &arguments.second);
    let page = render_comparison_html([(&name_a, &first), (&name_b, &second)]);
    Ok(write_file(&arguments.out, page.as_bytes())?)
}

/// The folders' own names; their whole paths where these are the same.
fn names(first: &Path, second: &Path) -> [String; 2] {
    let own = |path: &Path| {
        let whole = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        whole.file_name().map_or_else(
            || path.display().to_string(),
            |name| name.to_string_lossy().into_owned(),
        )
    };
    let names = [own(first), own(second)];
    if names[0] == names[1] {
        return [first, second].map(|path| path.display().to_string());
    }
    names
}
