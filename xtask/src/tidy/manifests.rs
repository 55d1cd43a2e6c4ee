//! Rules for crates: what a manifest inherits, who may depend on whom, what a
//! library ships with, and that ARCHITECTURE.md knows every crate.

use crate::tidy::metadata::{packages, text};
use anyhow::Context;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// The floors of the house; a crate may only depend on crates of lower floors.
const FLOORS: [&[&str]; 9] = [
    &["estimation-base", "simd-level"],
    &[
        "vision-sift",
        "feature-kdtree",
        "mono-geometry",
        "ukf",
        "es-evolve",
        "trajectory-eval",
        "robot-logs",
    ],
    &[
        "rbpf-core",
        "camera-calibration",
        "motion-consistency",
        "place-recognition",
        "wall-scenes",
    ],
    &["range-bearing-slam", "slam-pipeline"],
    &["slam-batch", "slam-io"],
    &["slam-report"],
    &["mono-slam"],
    &["synth-eval"],
    &["xtask"],
];
/// The floor of the program, from which on a library needs no example and no bench of its own.
const PROGRAM_FLOOR: usize = 6;
/// Crates that depend on none of ours, though they could: tooling compiles before everything else.
const ALONE: [&str; 1] = ["xtask"];
/// Licence texts that every published crate carries, equal to those of the workspace.
const LICENCES: [&str; 2] = ["LICENSE-APACHE", "LICENSE-MIT"];
/// The line by which a library shows its README as its front page, and compiles the code in it.
const FRONT_PAGE: &str = "#![doc = include_str!(\"../README.md\")]";
/// Keys every manifest takes from the workspace.
const INHERITED: [&str; 4] = ["version", "edition", "rust-version", "license"];

/// Violations in the workspace's manifests and crate folders.
///
/// # Errors
/// A manifest cannot be read.
pub(crate) fn violations(root: &Path, metadata: &Value) -> anyhow::Result<Vec<String>> {
    let mut found = Vec::new();
    let architecture = fs::read_to_string(root.join("ARCHITECTURE.md"));
    if architecture.is_err() {
        found.push(String::from("ARCHITECTURE.md is missing"));
    }
    for package in packages(metadata).filter(|package| package["source"].is_null()) {
        let name = text(package, "name");
        let manifest = Path::new(text(package, "manifest_path"));
        let content = fs::read_to_string(manifest)
            .with_context(|| format!("cannot read {}", manifest.display()))?;
        found.extend(not_inherited(name, &content));
        for dependency in package["dependencies"].as_array().into_iter().flatten() {
            // Development dependencies (kind "dev") may point anywhere.
            if dependency["kind"].is_null() && dependency["path"].is_string() {
                found.extend(wrong_edge(name, text(dependency, "name")));
            }
        }
        if let Ok(architecture) = &architecture
            && !architecture.contains(&format!("`{name}`"))
        {
            found.push(format!("ARCHITECTURE.md does not mention `{name}`"));
        }
        let folder = manifest.parent().unwrap_or(root);
        if folder.parent() == Some(&root.join("crates")) {
            found.extend(missing_parts(name, package, folder));
            if package["publish"].is_null() {
                found.extend(not_publishable(name, root, folder));
            }
        }
    }
    Ok(found)
}

/// Keys a manifest states itself instead of inheriting them.
fn not_inherited(name: &str, manifest: &str) -> Vec<String> {
    let compact: Vec<String> = manifest.lines().map(|line| line.replace(' ', "")).collect();
    let mut found = Vec::new();
    for key in INHERITED {
        if !compact.contains(&format!("{key}.workspace=true")) {
            found.push(format!(
                "{name}: `{key}.workspace = true` is missing from the manifest"
            ));
        }
    }
    if !compact
        .windows(2)
        .any(|pair| pair[0] == "[lints]" && pair[1] == "workspace=true")
    {
        found.push(format!(
            "{name}: `[lints] workspace = true` is missing from the manifest"
        ));
    }
    found
}

/// The floor of a crate.
fn floor(name: &str) -> Option<usize> {
    FLOORS.iter().position(|crates| crates.contains(&name))
}

/// A dependency that does not point down, or that the crate must not have at all.
fn wrong_edge(from: &str, to: &str) -> Option<String> {
    let (Some(above), Some(below)) = (floor(from), floor(to)) else {
        return Some(format!("{from} -> {to}: not on the floors of the house"));
    };
    (above <= below || ALONE.contains(&from))
        .then(|| format!("{from} -> {to}: floor {above} may not depend on floor {below}"))
}

/// README, and example and bench of a library below the program.
fn missing_parts(name: &str, package: &Value, folder: &Path) -> Vec<String> {
    let has = |kind: &str| {
        let targets = package["targets"].as_array().into_iter().flatten();
        targets.into_iter().any(|target| {
            let mut kinds = target["kind"].as_array().into_iter().flatten();
            kinds.any(|value| value.as_str() == Some(kind))
        })
    };
    let mut found = Vec::new();
    if !folder.join("README.md").is_file() {
        found.push(format!("{name}: README.md is missing"));
    }
    if has("lib") && floor(name).is_none_or(|floor| floor < PROGRAM_FLOOR) {
        for kind in ["example", "bench"] {
            if !has(kind) {
                found.push(format!("{name}: no {kind}"));
            }
        }
    }
    found
}

/// A licence that is missing or differs, and a library whose README is not its front page.
fn not_publishable(name: &str, root: &Path, folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for licence in LICENCES {
        let ours = fs::read(root.join(licence)).ok();
        if ours.is_none() || fs::read(folder.join(licence)).ok() != ours {
            found.push(format!(
                "{name}: {licence} is not that of the workspace (copy it into the crate)"
            ));
        }
    }
    let library = fs::read_to_string(folder.join("src/lib.rs")).unwrap_or_default();
    if !library.is_empty() && library.matches(FRONT_PAGE).count() != 1 {
        found.push(format!(
            "{name}: src/lib.rs has to hold `{FRONT_PAGE}` once"
        ));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn edges_point_down_only() {
        for (from, to) in [
            ("rbpf-core", "ukf"),
            ("slam-pipeline", "vision-sift"),
            ("synth-eval", "mono-slam"),
            ("ukf", "estimation-base"),
        ] {
            assert_eq!(wrong_edge(from, to), None);
        }
        for (from, to) in [
            ("ukf", "rbpf-core"),
            ("mono-geometry", "vision-sift"),
            ("wall-scenes", "camera-calibration"),
            ("slam-pipeline", "slam-io"),
            ("xtask", "wall-scenes"),
            ("slam-pipeline", "slam-pipeline"),
            ("slam-pipeline", "stranger"),
        ] {
            assert!(wrong_edge(from, to).is_some(), "{from} -> {to}");
        }
    }

    #[test]
    fn a_manifest_must_inherit_every_key() {
        let good = "version.workspace = true\nedition.workspace=true\nrust-version.workspace = true\n\
                    license.workspace = true\n[lints]\nworkspace = true\n";
        assert!(not_inherited("a", good).is_empty());
        assert_eq!(
            not_inherited(
                "a",
                &good.replace("edition.workspace=true", "edition = \"2024\"")
            )
            .len(),
            1
        );
        assert_eq!(
            not_inherited("a", &good.replace("[lints]", "[features]")).len(),
            1
        );
    }

    #[test]
    fn a_crate_without_licences_and_front_page_cannot_be_published() {
        let root = crate::workspace_root();
        assert!(not_publishable("ukf", &root, &root.join("crates/ukf")).is_empty());
        let found = not_publishable("xtask", &root, &root.join("xtask"));
        assert_eq!(found.len(), 2, "{found:?}");
    }

    #[test]
    fn a_library_without_example_and_bench_is_reported() {
        let package = json!({ "targets": [{ "kind": ["lib"] }, { "kind": ["bench"] }] });
        let of_program = missing_parts("mono-slam", &package, Path::new("no-such-folder"));
        assert_eq!(of_program, ["mono-slam: README.md is missing"]);
        let found = missing_parts("a", &package, Path::new("no-such-folder"));
        assert_eq!(found, ["a: README.md is missing", "a: no example"]);
    }
}
