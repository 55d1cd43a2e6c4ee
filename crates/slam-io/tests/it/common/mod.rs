//! Helpers shared by the tests: a folder that disappears, a small sequence, a small run.

pub(crate) mod run;
pub(crate) mod sequence;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

static NEXT: AtomicUsize = AtomicUsize::new(0);

/// A fresh folder, removed with everything in it when the value is dropped.
pub(crate) struct ScratchFolder(PathBuf);

impl ScratchFolder {
    pub(crate) fn new() -> Self {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let path =
            std::env::temp_dir().join(format!("mono-slam-test-{}-{number}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        ScratchFolder(path)
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for ScratchFolder {
    fn drop(&mut self) {
        // Leaving a folder behind is no reason to fail a test.
        drop(fs::remove_dir_all(&self.0));
    }
}

/// The optional data folder, `MONO_SLAM_DATA` or `../shared/data` beside the workspace.
pub(crate) fn data_folder(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("MONO_SLAM_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let folder = root.join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: no {}", folder.display());
    None
}
