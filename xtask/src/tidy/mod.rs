//! The rules of the tree, checked by `cargo xtask tidy` and by an ordinary test.
//!
//! Source files (`sources`): a module comment first, a bounded length, no leftovers, no machine paths. Manifests
//! (`manifests`): inheritance, the floors of the house, README, example and bench of each library. Licences
//! (`licences`): the whole dependency tree against a list. Fixtures: their manifests. A rule returns sentences, one a
//! violation; the caller sees all of them at once. `stats` counts and judges nothing.

mod licences;
mod manifests;
mod sources;
mod stats;

use crate::{fixtures, programs};
use anyhow::{Context, bail};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// Checks everything in the workspace at `root`.
///
/// # Errors
/// All violations, one a line, or a tree that cannot be read.
pub(crate) fn run(root: &Path) -> anyhow::Result<()> {
    let metadata = metadata(root)?;
    let mut violations = sources::violations(root)?;
    violations.extend(manifests::violations(root, &metadata)?);
    violations.extend(licences::violations(&metadata));
    violations.extend(fixtures::violations(root));
    violations.sort();
    if !violations.is_empty() {
        bail!("{} violations\n{}", violations.len(), violations.join("\n"));
    }
    Ok(())
}

/// The figures of every crate of the workspace at `root`.
///
/// # Errors
/// A tree that cannot be read.
pub(crate) fn table(root: &Path) -> anyhow::Result<String> {
    stats::table(&metadata(root)?)
}

/// `cargo metadata` with the whole dependency tree.
fn metadata(root: &Path) -> anyhow::Result<Value> {
    let output = Command::new(programs::cargo())
        .args(["metadata", "--format-version", "1", "--locked"])
        .current_dir(root)
        .output()
        .context("cannot run cargo metadata")?;
    if !output.status.success() {
        bail!(
            "cargo metadata failed: {}",
            String::from_utf8_lossy(&output.stderr).trim()
        );
    }
    serde_json::from_slice(&output.stdout).context("cargo metadata is not JSON")
}

/// The packages of a metadata document.
fn packages(metadata: &Value) -> impl Iterator<Item = &Value> {
    metadata["packages"].as_array().into_iter().flatten()
}

/// A text field of a metadata object, empty when missing.
fn text<'a>(value: &'a Value, field: &str) -> &'a str {
    value[field].as_str().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_tree_is_tidy() {
        if let Err(error) = super::run(&crate::workspace_root()) {
            panic!("{error:#}");
        }
    }
}
