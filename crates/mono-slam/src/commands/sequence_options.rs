//! How the commands that read a sequence are told how to read it.

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser as _};
use slam_io::{OpenOptions, SequenceFormat};

/// Options of every command that reads a sequence.
#[derive(Debug, clap::Args)]
pub(crate) struct SequenceOptions {
    /// Layout of the sequence [default: found by looking]
    #[arg(long, value_name = "FORMAT", value_parser = formats())]
    format: Option<SequenceFormat>,
    /// Calibration in place of the sequence's own, in any format that `mono-slam camera` reads
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Topic of the images in a recorded log [default: the one with most messages]
    #[arg(long, value_name = "TOPIC")]
    image_topic: Option<String>,
    /// Topic of the odometry in a recorded log [default: nav_msgs/Odometry before velocities]
    #[arg(long, value_name = "TOPIC")]
    odometry_topic: Option<String>,
}

impl SequenceOptions {
    /// The same for the library.
    pub(crate) fn open_options(&self) -> OpenOptions {
        OpenOptions {
            format: self.format,
            camera: self.camera.clone(),
            image_topic: self.image_topic.clone(),
            odometry_topic: self.odometry_topic.clone(),
            ..OpenOptions::default()
        }
    }
}

fn formats() -> impl clap::builder::TypedValueParser<Value = SequenceFormat> {
    PossibleValuesParser::new(SequenceFormat::ALL.map(SequenceFormat::name)).map(|name| {
        SequenceFormat::ALL
            .into_iter()
            .find(|format| format.name() == name)
            .unwrap_or(SequenceFormat::Native)
    })
}
