//! The rules of the tree, checked by `cargo xtask tidy` and by an ordinary test.
//!
//! Source files (`sources`): a module comment first, a bounded length, no leftovers, no machine paths. Manifests
//! (`manifests`): inheritance, the floors of the house, README, example and bench of each library. Licences
//! (`licences`): the whole dependency tree against a list. Markdown files
//! (`markdown`): the paths and commands in them are there. Modules (`modules`): no cycle between the files of a crate.
//! Fixtures: their manifests. A rule returns sentences, one a
//! violation; the caller sees all of them at once. `stats` counts and judges nothing.

mod licences;
mod manifests;
mod markdown;
mod metadata;
mod modules;
mod sources;
mod stats;

use crate::fixtures;
use anyhow::bail;
pub(crate) use metadata::{metadata, packages, text};
pub(crate) use sources::paths;
use std::path::Path;

/// Checks everything in the workspace at `root`.
///
/// # Errors
/// All violations, one a line, or a tree that cannot be read.
pub(crate) fn run(root: &Path) -> anyhow::Result<()> {
    let metadata = metadata(root)?;
    let mut violations = sources::violations(root)?;
    violations.extend(manifests::violations(root, &metadata)?);
    violations.extend(markdown::violations(root, &metadata)?);
    violations.extend(licences::violations(&metadata));
    violations.extend(modules::violations(root, &metadata)?);
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

#[cfg(test)]
mod tests {
    #[test]
    fn the_tree_is_tidy() {
        if let Err(error) = super::run(&crate::workspace_root()) {
            panic!("{error:#}");
        }
    }
}
