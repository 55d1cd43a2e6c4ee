//! `mono-slam config`: the default configuration with every key explained.

use slam_io::configuration::documented_toml;

use crate::failure::{Failure, print};

/// Prints the configuration.
pub(crate) fn run() -> Result<(), Failure> {
    print(&documented_toml())
}
