//! The configuration file of a command.

use std::path::Path;

use slam_io::configuration::from_toml;
use slam_io::read_text;
use slam_pipeline::config::Config;

use crate::failure::Failure;

/// Reads the file of `--config`; its values are not yet checked against their ranges.
pub(super) fn read_configuration(path: &Path) -> Result<Config, Failure> {
    let text = read_text(path)?;
    from_toml(&text).map_err(|e| Failure::input(format!("{}: {e}", path.display())))
}
