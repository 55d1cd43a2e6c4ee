//! Remarks on inputs that do not fit together, for people and for scripts.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Something that the user should know before believing a result.
///
/// A warning never changes an estimate. Its name is stable, so that a script can look for it; its message is one sentence
/// with the numbers that were found and the likely cause.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Warning {
    /// Stable name in lower case with hyphens, such as `odometry-ends-early`.
    pub name: String,
    /// The sentence.
    pub message: String,
}

impl Warning {
    /// A warning called `name` that says `message`; a full stop is added where it has none.
    pub fn new(name: impl Into<String>, message: impl Into<String>) -> Self {
        let mut message = message.into();
        if !message.ends_with(['.', '?']) {
            message.push('.');
        }
        Self {
            name: name.into(),
            message,
        }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "[{}] {}", self.name, self.message)
    }
}
