//! Rules for crates: what a manifest inherits, who may depend on whom, what a
//! library ships with, and that ARCHITECTURE.md knows every crate.

use super::{packages, text};
use anyhow::Context;
use serde_json::Value;
use std::fs;
use std::path::Path;

/// The layers from the bottom up; a crate may only depend on earlier ones.
const LAYERS: &[&str] = &[
    "estimation-base",
    "simd-level",
    "vision-sift",
    "feature-kdtree",
    "mono-geometry",
    "ukf",
    "es-evolve",
    "trajectory-eval",
    "rbpf-core",
    "camera-calibration",
    "range-bearing-slam",
    "slam-pipeline",
    "slam-io",
    "slam-report",
    "mono-slam",
    "xtask",
];
/// The ground floor: crates that depend on none of ours and that every crate may use.
const GROUND: &[&str] = &["estimation-base", "simd-level"];
/// Crates useful alone: of ours they use the ground floor only.
const ALONE: &[&str] = &[
    "vision-sift",
    "feature-kdtree",
    "mono-geometry",
    "ukf",
    "es-evolve",
    "trajectory-eval",
    "rbpf-core",
];
/// The crates of ours that `range-bearing-slam` may use.
const FILTER_PARTS: &[&str] = &["ukf", "es-evolve", "rbpf-core"];
/// Keys every manifest takes from the workspace.
const INHERITED: [&str; 4] = ["version", "edition", "rust-version", "license"];

/// Violations in the workspace's manifests and crate folders.
///
/// # Errors
/// A manifest cannot be read.
pub fn violations(root: &Path, metadata: &Value) -> anyhow::Result<Vec<String>> {
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

/// A dependency that does not point down, or that the crate must not have at all.
fn wrong_edge(from: &str, to: &str) -> Option<String> {
    let layer = |name: &str| LAYERS.iter().position(|known| *known == name);
    let (Some(above), Some(below)) = (layer(from), layer(to)) else {
        return Some(format!("{from} -> {to}: not in the layer order"));
    };
    let forbidden = !GROUND.contains(&to)
        && (ALONE.contains(&from) || (from == "range-bearing-slam" && !FILTER_PARTS.contains(&to)));
    (above <= below || forbidden)
        .then(|| format!("{from} -> {to}: this dependency is against the layers"))
}

/// README, example and bench of a library crate.
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
    if has("lib") {
        for kind in ["example", "bench"] {
            if !has(kind) {
                found.push(format!("{name}: no {kind}"));
            }
        }
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
            ("range-bearing-slam", "rbpf-core"),
            ("vision-sift", "simd-level"),
            ("slam-pipeline", "vision-sift"),
            ("xtask", "slam-pipeline"),
        ] {
            assert_eq!(wrong_edge(from, to), None);
        }
        for (from, to) in [
            ("ukf", "rbpf-core"),
            ("simd-level", "ukf"),
            ("mono-geometry", "vision-sift"),
            ("rbpf-core", "ukf"),
            ("range-bearing-slam", "mono-geometry"),
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
    fn a_library_without_example_and_bench_is_reported() {
        let package = json!({ "targets": [{ "kind": ["lib"] }, { "kind": ["bench"] }] });
        let found = missing_parts("a", &package, Path::new("no-such-folder"));
        assert_eq!(found, ["a: README.md is missing", "a: no example"]);
    }
}
