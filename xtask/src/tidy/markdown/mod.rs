//! Paths and commands in Markdown files name what is there.
//!
//! Every span in backticks and every line of a `sh` block is read. A word that ends like a source, or that
//! begins at a folder of the workspace, must be the end of the path of some file or folder. The commands of cargo must
//! name packages, targets and tasks that exist, those of `mono-slam` subcommands that exist (`commands`). Words with a
//! placeholder (`<question>`, `*`) are left alone.

mod commands;

use anyhow::Context;
use commands::Commands;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// Ends of the names that are files of the repository wherever they are named; data and pages are often results.
const FILE_ENDS: [&str; 3] = [".rs", ".py", ".sh"];
/// Folders at which a path of the repository begins.
const ROOTS: [&str; 4] = ["crates/", "docs/", "fixtures/", "xtask/"];
/// Signs of a placeholder.
const PLACEHOLDERS: [char; 5] = ['<', '>', '*', '{', '$'];

/// Violations in all Markdown files below `root`.
///
/// # Errors
/// A folder or file cannot be read.
pub(crate) fn violations(root: &Path, metadata: &Value) -> anyhow::Result<Vec<String>> {
    let paths = crate::tidy::sources::paths(root)?;
    let commands = Commands::new(root, metadata)?;
    let mut found = Vec::new();
    for file in paths
        .iter()
        .filter(|path| path.extension().is_some_and(|end| end == "md"))
    {
        let text = fs::read_to_string(root.join(file))
            .with_context(|| format!("cannot read {}", file.display()))?;
        found.extend(in_text(
            &file.display().to_string(),
            &text,
            &paths,
            &commands,
        ));
    }
    Ok(found)
}

/// Violations in one text.
fn in_text(name: &str, text: &str, paths: &[PathBuf], commands: &Commands) -> Vec<String> {
    let mut found = Vec::new();
    for (line, span) in spans(text) {
        let missing = span
            .split_whitespace()
            .filter(|word| is_path(word) && !exists(word, paths))
            .map(|word| format!("no file `{word}`"));
        let wrong = commands.wrong(&span);
        found.extend(
            missing
                .chain(wrong)
                .map(|what| format!("{name}:{line}: {what}")),
        );
    }
    found
}

/// Spans in backticks and lines of shell blocks, each with the number of its line.
fn spans(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    // The language of the fenced block that the line is in.
    let mut block: Option<&str> = None;
    for (index, line) in text.lines().enumerate() {
        if let Some(language) = line.trim_start().strip_prefix("```") {
            block = if block.is_some() {
                None
            } else {
                Some(language.trim())
            };
        } else if block == Some("sh") {
            let command = line.split(" #").next().unwrap_or_default();
            found.push((index + 1, command.to_owned()));
        } else if block.is_none() {
            let inside = line.split('`').skip(1).step_by(2);
            found.extend(inside.map(|span| (index + 1, span.to_owned())));
        }
    }
    found
}

/// Whether a word is meant as a path of the repository.
fn is_path(word: &str) -> bool {
    let bare = FILE_ENDS
        .iter()
        .any(|end| word.ends_with(end) && word.len() > end.len());
    (bare || ROOTS.iter().any(|root| word.starts_with(root)))
        && !word.contains(PLACEHOLDERS)
        && !word.contains("://")
}

/// Whether some file or folder ends with these parts.
fn exists(word: &str, paths: &[PathBuf]) -> bool {
    // A path may be given as a reader of the file sees it.
    let word = word.trim_start_matches("../").trim_start_matches("./");
    paths.iter().any(|path| path.ends_with(word))
}

#[cfg(test)]
mod tests;
