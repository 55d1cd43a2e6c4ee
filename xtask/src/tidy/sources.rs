//! Rules for files: module comment, length, leftovers, machine paths.

use anyhow::Context;
use std::fs;
use std::path::{Path, PathBuf};

/// Longest allowed source file, lines.
const MOST_LINES: usize = 600;
/// Folders that hold no sources of ours.
const SKIPPED: [&str; 4] = ["target", ".git", "out", "images"];
/// Ends of the names of text files that are read.
const TEXT: [&str; 9] = [
    "rs", "toml", "md", "yml", "json", "txt", "csv", "html", "run",
];
/// What may not stand in Rust code; in two halves, so that this file does not hold it.
const LEFTOVERS: [[&str; 2]; 4] = [
    ["todo", "!("],
    ["unimplemented", "!("],
    ["dbg", "!("],
    ["#[ig", "nore"],
];
/// What may not stand in any text file: places of one machine.
const MACHINE_PATHS: [[&str; 2]; 4] = [
    ["/wo", "rk/"],
    ["/ho", "me/"],
    ["/ro", "ot/"],
    ["/tm", "p/"],
];

/// Violations in all text files below `root`.
///
/// # Errors
/// A folder or file cannot be read.
pub(crate) fn violations(root: &Path) -> anyhow::Result<Vec<String>> {
    let mut found = Vec::new();
    for file in text_files(root)? {
        let bytes = fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?;
        let name = file
            .strip_prefix(root)
            .unwrap_or(&file)
            .display()
            .to_string();
        found.extend(in_file(&name, &String::from_utf8_lossy(&bytes)));
    }
    Ok(found)
}

/// Violations in one file.
fn in_file(name: &str, content: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut patterns: Vec<String> = MACHINE_PATHS.iter().map(|halves| halves.concat()).collect();
    if name.ends_with(".rs") {
        if !content.starts_with("//!") {
            found.push(format!("{name}: the first line is no `//!` module comment"));
        }
        let lines = content.lines().count();
        if lines > MOST_LINES {
            found.push(format!(
                "{name}: {lines} lines, at most {MOST_LINES} are allowed"
            ));
        }
        patterns.extend(LEFTOVERS.iter().map(|halves| halves.concat()));
    }
    for (index, line) in content.lines().enumerate() {
        for pattern in patterns
            .iter()
            .filter(|pattern| line.contains(pattern.as_str()))
        {
            found.push(format!("{name}:{}: `{pattern}` is forbidden", index + 1));
        }
    }
    found
}

fn text_files(root: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let (mut files, mut open) = (Vec::new(), vec![root.to_path_buf()]);
    while let Some(folder) = open.pop() {
        for entry in
            fs::read_dir(&folder).with_context(|| format!("cannot list {}", folder.display()))?
        {
            let entry = entry?;
            let (path, name) = (
                entry.path(),
                entry.file_name().to_string_lossy().into_owned(),
            );
            if entry.file_type()?.is_dir() {
                if !SKIPPED.contains(&name.as_str()) {
                    open.push(path);
                }
            } else if TEXT.contains(&name.rsplit('.').next().unwrap_or_default()) {
                files.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_rule_finds_its_violation_and_nothing_else() {
        assert!(in_file("a.rs", "//! Good.\nfn f() {}\n").is_empty());
        assert_eq!(in_file("a.rs", "fn f() {}\n").len(), 1);
        assert_eq!(
            in_file("a.rs", &format!("//! Long.\n{}", "\n".repeat(600))).len(),
            1
        );
        assert!(in_file("a.rs", &format!("//! Long.\n{}", "\n".repeat(599))).is_empty());
        for halves in LEFTOVERS {
            assert_eq!(
                in_file("a.rs", &format!("//! A.\n{}\n", halves.concat())).len(),
                1
            );
            assert!(in_file("a.md", &halves.concat()).is_empty());
        }
        for halves in MACHINE_PATHS {
            assert_eq!(
                in_file("a.md", &format!("see {}x", halves.concat())).len(),
                1
            );
        }
    }
}
