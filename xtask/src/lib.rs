//! Workspace tasks as a library: scenes with exact truth, fixtures, the gate.

pub mod board;
pub mod ci;
pub mod fixtures;
pub mod flags;
pub mod scene;
pub mod synth_eval;
pub mod tidy;

use std::path::{Path, PathBuf};

/// Folder of the workspace this program was built from.
pub fn workspace_root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_path_buf()
}
