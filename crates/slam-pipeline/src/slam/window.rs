//! The window of keyframes whose path is still solved again.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use crate::filter::segment::WindowStep;

/// The keyframes since the origins of the particles.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Window {
    #[serde(with = "crate::stored::arcs")]
    pub(super) steps: Vec<Arc<WindowStep>>,
    /// Number of steps that have been solved once at least.
    pub(super) solved: usize,
}
