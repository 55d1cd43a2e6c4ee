//! The configuration that the filters of a study share.

use crate::recording::Recording;
use anyhow::Context;
use slam_io::configuration;
use slam_pipeline::config::Config;
use std::fs;
use std::path::Path;

/// Where the configuration of the filters comes from.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Settings {
    /// The defaults, with the odometry noise that the generator of the scene really applies.
    ExactNoise,
    /// The defaults as shipped.
    Default,
    /// A file, as a user would pass it.
    File {
        /// The file's name without its ending.
        name: String,
        /// Its contents.
        config: Box<Config>,
    },
}

impl Settings {
    /// Reads a configuration file.
    ///
    /// # Errors
    /// The file cannot be read, is no configuration, or holds a value out of range.
    pub(crate) fn read(file: &Path) -> anyhow::Result<Self> {
        let text =
            fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
        let config = configuration::from_toml(&text).with_context(|| file.display().to_string())?;
        config
            .clone()
            .check()
            .with_context(|| file.display().to_string())?;
        let name = file.file_stem().unwrap_or(file.as_os_str());
        Ok(Self::File {
            name: name.to_string_lossy().into_owned(),
            config: Box::new(config),
        })
    }

    /// Name in the rows. A recorded sequence has no exact noise to hand over: it runs the defaults.
    pub(crate) fn label(&self, recording: &Recording) -> &str {
        match self {
            Self::ExactNoise if recording.noise.is_some() => "exact noise",
            Self::ExactNoise | Self::Default => "default",
            Self::File { name, .. } => name,
        }
    }

    /// The configuration before method, particles and seed are set.
    pub(crate) fn config(&self, recording: &Recording) -> Config {
        let mut config = self.of_detection();
        if let (Self::ExactNoise, Some(noise)) = (self, &recording.noise) {
            config.odometry = noise.clone();
        }
        config
    }

    /// The configuration as far as the detection of keypoints asks.
    pub(crate) fn of_detection(&self) -> Config {
        match self {
            Self::ExactNoise | Self::Default => Config::default(),
            Self::File { config, .. } => (**config).clone(),
        }
    }
}
