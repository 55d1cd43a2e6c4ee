//! The crates that are published and their names on a registry.

use crate::tidy::{packages, text};
use serde_json::Value;

/// Prefix of the family on a registry.
const PREFIX: &str = "monoslam-";
/// The program, whose name is the family's own.
const PROGRAM: &str = "mono-slam";

/// A crate that is published.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Published {
    /// Its name in the workspace.
    pub(super) name: String,
    /// Whether it has a library.
    pub(super) library: bool,
    /// Whether it has a binary.
    pub(super) binary: bool,
}

/// The name of a crate on a registry.
pub(super) fn family(name: &str) -> String {
    if name == PROGRAM {
        name.to_owned()
    } else {
        format!("{PREFIX}{name}")
    }
}

/// The crates that may be published, by name.
pub(super) fn published(metadata: &Value) -> Vec<Published> {
    let mut found: Vec<Published> = packages(metadata)
        .filter(|package| package["source"].is_null() && package["publish"].is_null())
        .map(|package| {
            let has = |kind: &str| {
                let mut targets = package["targets"].as_array().into_iter().flatten();
                targets.any(|target| target["kind"][0].as_str() == Some(kind))
            };
            Published {
                name: text(package, "name").to_owned(),
                library: has("lib"),
                binary: has("bin"),
            }
        })
        .collect();
    found.sort_by(|a, b| a.name.cmp(&b.name));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_program_keeps_its_name() {
        assert_eq!(family("ukf"), "monoslam-ukf");
        assert_eq!(family("mono-slam"), "mono-slam");
    }
}
