//! `mono-slam localize`: where a robot is in a map that an earlier run has made.

use std::path::PathBuf;

use slam_pipeline::MapUse;

use super::run::{RunOptions, drive};
use crate::failure::Failure;

/// Arguments of `mono-slam localize`.
#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Map of an earlier run; it stays as it is
    #[arg(long, value_name = "map.slam")]
    map: PathBuf,
    #[command(flatten)]
    run: RunOptions,
}

/// Finds the robot in the map, frame by frame, and writes the results.
pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    drive(&arguments.run, Some((&arguments.map, MapUse::Localise)))
}
