//! Rules for files: module comment, length, leftovers, machine paths, doc comments that open with a noun, and no build
//! products under version control.

use anyhow::Context;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Longest allowed source file, lines.
const MOST_LINES: usize = 600;
/// Folders that hold no sources of ours.
const SKIPPED: [&str; 3] = ["target", ".git", "out"];
/// Ends of the names of text files that are read.
const TEXT: [&str; 9] = [
    "rs", "toml", "md", "yml", "json", "txt", "csv", "html", "run",
];
/// The first line of a library whose front page is its README.
const FRONT_PAGE: &str = "#![doc = include_str!(\"../README.md\")]";
/// Ends of the names of files that a compiler or a run makes.
const PRODUCTS: [&str; 9] = [
    "o",
    "a",
    "so",
    "d",
    "rlib",
    "rmeta",
    "crate",
    "checkpoint",
    "profraw",
];
/// Forbidden in Rust code; in two halves, so that this file does not hold it.
const LEFTOVERS: [[&str; 2]; 4] = [
    ["todo", "!("],
    ["unimplemented", "!("],
    ["dbg", "!("],
    ["#[ig", "nore"],
];
/// Forbidden in any text file: places of one machine.
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
    found.extend(committed(root).iter().filter_map(|file| product(file)));
    for file in paths(root)?.iter().filter(|path| is_text(path)) {
        let bytes =
            fs::read(root.join(file)).with_context(|| format!("cannot read {}", file.display()))?;
        let name = file.display().to_string();
        found.extend(in_file(&name, &String::from_utf8_lossy(&bytes)));
    }
    Ok(found)
}

/// The files under version control; none where git does not say.
fn committed(root: &Path) -> Vec<String> {
    let output = Command::new("git")
        .args(["ls-files", "-z"])
        .current_dir(root)
        .output();
    let listed = output.map(|output| output.stdout).unwrap_or_default();
    String::from_utf8_lossy(&listed)
        .split_terminator('\0')
        .map(str::to_owned)
        .collect()
}

/// A committed file that a build or a run made.
fn product(file: &str) -> Option<String> {
    let mut parts = file.split('/');
    let name = parts.next_back().unwrap_or_default();
    let made = name
        .rsplit_once('.')
        .is_some_and(|(_, end)| PRODUCTS.contains(&end));
    (made || parts.any(|folder| folder == "target"))
        .then(|| format!("{file}: a product of a build or a run is committed"))
}

/// Whether a file is read, by the end of its name.
fn is_text(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    TEXT.contains(&name.rsplit('.').next().unwrap_or_default())
}

/// Violations in one file.
fn in_file(name: &str, content: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut patterns: Vec<String> = MACHINE_PATHS.iter().map(|halves| halves.concat()).collect();
    if name.ends_with(".rs") {
        let front_page = name.ends_with("src/lib.rs") && content.starts_with(FRONT_PAGE);
        if !content.starts_with("//!") && !front_page {
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
        if name.ends_with(".rs") && opens_with_what(line) {
            found.push(format!(
                "{name}:{}: a doc comment opens with the thing itself, not with \"What\"",
                index + 1
            ));
        }
        for pattern in patterns
            .iter()
            .filter(|pattern| line.contains(pattern.as_str()))
        {
            found.push(format!("{name}:{}: `{pattern}` is forbidden", index + 1));
        }
    }
    found
}

/// Whether a line of a doc comment begins with the word "What": such a line names no thing.
fn opens_with_what(line: &str) -> bool {
    let line = line.trim_start();
    let text = line
        .strip_prefix("///")
        .or_else(|| line.strip_prefix("//!"));
    text.is_some_and(|text| text.split_whitespace().next() == Some("What"))
}

/// All files and folders below `root`, as paths from it, sorted; build output and the like are left out.
///
/// # Errors
/// A folder cannot be read.
pub(crate) fn paths(root: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let (mut paths, mut open) = (Vec::new(), vec![root.to_path_buf()]);
    while let Some(folder) = open.pop() {
        for entry in
            fs::read_dir(&folder).with_context(|| format!("cannot list {}", folder.display()))?
        {
            let entry = entry?;
            let (path, name) = (entry.path(), entry.file_name());
            if entry.file_type()?.is_dir() {
                if SKIPPED.iter().any(|skipped| name == *skipped) {
                    continue;
                }
                open.push(path.clone());
            }
            paths.push(path.strip_prefix(root).unwrap_or(&path).to_path_buf());
        }
    }
    paths.sort();
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_known_by_folder_and_end() {
        for file in [
            "target/debug/a.txt",
            "crates/ukf/target/x",
            "a/b.rlib",
            "run.checkpoint",
            "c.o",
        ] {
            assert!(product(file).is_some(), "{file}");
        }
        for file in [
            "docs/formats/checkpoint.md",
            "crates/ukf/src/target.rs",
            "fixtures/logs/wall.bag",
            "LICENSE",
        ] {
            assert_eq!(product(file), None, "{file}");
        }
    }

    #[test]
    fn each_rule_finds_its_violation_and_nothing_else() {
        assert!(in_file("a.rs", "//! Good.\nfn f() {}\n").is_empty());
        assert_eq!(in_file("a.rs", "fn f() {}\n").len(), 1);
        let page = format!("{FRONT_PAGE}\n");
        assert!(in_file("crates/a/src/lib.rs", &page).is_empty());
        assert_eq!(in_file("crates/a/src/b.rs", &page).len(), 1);
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
        for (line, wrong) in [
            ("/// What a step costs.", 1),
            ("    //! What it is.", 1),
            ("/// Whatever it costs.", 0),
            ("/// The cost. What a step costs.", 0),
            ("// What a step costs.", 0),
        ] {
            assert_eq!(
                in_file("a.rs", &format!("//! A.\n{line}\n")).len(),
                wrong,
                "{line}"
            );
            assert!(in_file("a.md", line).is_empty());
        }
        for halves in MACHINE_PATHS {
            assert_eq!(
                in_file("a.md", &format!("see {}x", halves.concat())).len(),
                1
            );
        }
    }
}
