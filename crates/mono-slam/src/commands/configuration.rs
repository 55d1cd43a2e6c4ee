//! The configuration file of a command.

use std::path::Path;

use slam_io::configuration::from_toml;
use slam_pipeline::config::Config;

use crate::failure::Failure;

/// Reads the file of `--config`; its values are not yet checked against their ranges.
pub(super) fn read_configuration(path: &Path) -> Result<Config, Failure> {
    let text = std::fs::read_to_string(path).map_err(|e| {
        Failure::input(format!(
            "{}: expected a configuration file, {e}",
            path.display()
        ))
    })?;
    from_toml(&text).map_err(|e| Failure::input(format!("{}: {e}", path.display())))
}
