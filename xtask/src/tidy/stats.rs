//! Figures of every crate: lines, files longer than the house likes, test binaries.

use crate::tidy::metadata::{packages, text};
use anyhow::Context;
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// Lines above which a file counts as long.
const LONG_FILE_LINES: usize = 400;

/// Figures of one crate.
#[derive(Debug, Default, PartialEq, Eq)]
struct Figures {
    /// Lines of Rust in `src`, unit tests included.
    source_lines: usize,
    /// Lines of Rust elsewhere: integration tests, examples, benches.
    other_lines: usize,
    /// Files with more than [`LONG_FILE_LINES`] lines.
    long_files: usize,
    /// Integration-test targets, each a binary of its own.
    test_binaries: usize,
}

/// The figures of all crates of the workspace as a table, with their sum.
///
/// # Errors
/// A file or folder cannot be read.
pub(crate) fn table(metadata: &Value) -> anyhow::Result<String> {
    let mut out = format!(
        "{:<22}{:>10}{:>10}{:>12}{:>15}\n",
        "crate", "src lines", "others", "files > 400", "test binaries"
    );
    let mut sum = Figures::default();
    for package in packages(metadata).filter(|package| package["source"].is_null()) {
        let figures = figures(package)?;
        row(&mut out, text(package, "name"), &figures);
        sum.source_lines += figures.source_lines;
        sum.other_lines += figures.other_lines;
        sum.long_files += figures.long_files;
        sum.test_binaries += figures.test_binaries;
    }
    row(&mut out, "all", &sum);
    Ok(out)
}

fn row(out: &mut String, name: &str, figures: &Figures) {
    let _ = writeln!(
        out,
        "{name:<22}{:>10}{:>10}{:>12}{:>15}",
        figures.source_lines, figures.other_lines, figures.long_files, figures.test_binaries
    );
}

fn figures(package: &Value) -> anyhow::Result<Figures> {
    let manifest = Path::new(text(package, "manifest_path"));
    let folder = manifest.parent().unwrap_or(manifest);
    let mut figures = Figures {
        test_binaries: package["targets"]
            .as_array()
            .into_iter()
            .flatten()
            .filter(|target| target["kind"][0] == "test")
            .count(),
        ..Figures::default()
    };
    for file in rust_files(folder)? {
        let content =
            fs::read_to_string(&file).with_context(|| format!("cannot read {}", file.display()))?;
        let lines = content.lines().count();
        figures.long_files += usize::from(lines > LONG_FILE_LINES);
        if file.starts_with(folder.join("src")) {
            figures.source_lines += lines;
        } else {
            figures.other_lines += lines;
        }
    }
    Ok(figures)
}

/// The Rust files below a folder, build output left out.
fn rust_files(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let (mut files, mut open) = (Vec::new(), vec![folder.to_path_buf()]);
    while let Some(inner) = open.pop() {
        let entries =
            fs::read_dir(&inner).with_context(|| format!("cannot list {}", inner.display()))?;
        for entry in entries {
            let path = entry?.path();
            if path.is_dir() {
                if path.file_name().is_none_or(|name| name != "target") {
                    open.push(path);
                }
            } else if path.extension().is_some_and(|end| end == "rs") {
                files.push(path);
            }
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn lines_long_files_and_test_binaries_are_counted() {
        let folder = std::env::temp_dir().join(format!("stats-{}", std::process::id()));
        for inner in ["src/inner", "tests", "target"] {
            fs::create_dir_all(folder.join(inner)).unwrap();
        }
        fs::write(folder.join("src/lib.rs"), "//! A.\nmod inner;\n").unwrap();
        fs::write(folder.join("src/inner/mod.rs"), "\n".repeat(401)).unwrap();
        fs::write(folder.join("tests/one.rs"), "\n".repeat(400)).unwrap();
        fs::write(folder.join("target/built.rs"), "\n".repeat(500)).unwrap();
        let package = json!({
            "manifest_path": folder.join("Cargo.toml"),
            "targets": [{ "kind": ["lib"] }, { "kind": ["test"] }, { "kind": ["example"] }],
        });
        let found = figures(&package).unwrap();
        fs::remove_dir_all(&folder).unwrap();
        let expected = Figures {
            source_lines: 403,
            other_lines: 400,
            long_files: 1,
            test_binaries: 1,
        };
        assert_eq!(found, expected);
    }
}
