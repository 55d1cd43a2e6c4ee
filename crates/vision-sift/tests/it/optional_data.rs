//! Recorded pictures that are not in the repository, see CONTRIBUTING.md.

use std::path::PathBuf;

/// The folder of this name among the optional data; `None`, and a line on standard output, where it is absent.
pub(crate) fn folder(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("MONO_SLAM_DATA").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    present(root.join(name))
}

/// The folder at `path`; `None`, and a line on standard output, where it is absent.
#[expect(clippy::print_stdout, reason = "a test that is skipped says so")]
pub(crate) fn present(path: PathBuf) -> Option<PathBuf> {
    if path.is_dir() {
        return Some(path);
    }
    println!("skipped: no optional data at {}", path.display());
    None
}
