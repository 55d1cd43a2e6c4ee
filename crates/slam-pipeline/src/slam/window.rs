//! The window of keyframes whose path may still be drawn again.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use crate::filter::segment::WindowStep;

/// The keyframes since the origins of the particles.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Window {
    #[serde(with = "crate::stored::arcs")]
    pub(super) steps: Vec<Arc<WindowStep>>,
    /// Keyframes since the last new draw.
    pub(super) since: usize,
    /// Number of steps by which the origins move on before the next new draw.
    pub(super) behind: usize,
}
