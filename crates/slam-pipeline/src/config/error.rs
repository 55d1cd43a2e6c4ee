//! The reason for which a configuration is refused.

use thiserror::Error;

/// A configuration that was refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ConfigError {
    /// A value outside its range.
    #[error("configuration: {key} is {value}, expected {range}")]
    OutOfRange {
        /// Section and key.
        key: String,
        /// Value given.
        value: String,
        /// Values allowed.
        range: String,
    },
}
