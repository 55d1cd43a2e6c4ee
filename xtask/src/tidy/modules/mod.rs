//! Cycles between the files of a crate: a file may use another one, but never be used by it in turn.
//!
//! Every file of a crate is a node. A file uses another one when a path of its code (`use` or expression) names an item
//! that is defined there; a path that passes through a parent or through a re-export leads to the file of the
//! definition. A parent that declares its children by `mod` does not use them for that, but a parent that re-exports an
//! item of a child does; a child that takes an item defined in such a parent closes a cycle. Code under `#[cfg(test)]`
//! does not count.
//!
//! Steps: the files are read into items, imports and paths (`parse`), the paths are followed to their definitions
//! (`resolve`), and the files that reach one another are reported (`cycles`).

mod cycles;
mod parse;
mod resolve;

use crate::tidy::metadata::{packages, text};
use anyhow::Context;
use parse::{File, ModulePath};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// One sentence for each group of files that use one another, with the shortest ring through its first file, over all
/// crates of the workspace.
///
/// # Errors
/// A source file cannot be read or is no Rust.
pub(crate) fn violations(root: &Path, metadata: &Value) -> anyhow::Result<Vec<String>> {
    let mut found = Vec::new();
    for package in packages(metadata).filter(|package| package["source"].is_null()) {
        for target in package["targets"].as_array().into_iter().flatten() {
            if matches!(target["kind"][0].as_str(), Some("lib" | "bin")) {
                let files = read(root, Path::new(text(target, "src_path")))?;
                found.extend(of_crate(&files));
            }
        }
    }
    Ok(found)
}

/// The groups of files of one crate that use one another.
fn of_crate(files: &[File]) -> Vec<String> {
    let edges = resolve::edges(files);
    cycles::cycles(files.len(), &edges)
        .iter()
        .map(|ring| {
            let steps: Vec<String> = ring
                .iter()
                .map(|edge| {
                    format!(
                        "{} uses {} ({})",
                        files[edge.from].name, files[edge.to].name, edge.path
                    )
                })
                .collect();
            format!("cycle between files: {}", steps.join(", "))
        })
        .collect()
}

/// The files of a crate from its root file on, read and parsed; names are given below `root`.
fn read(root: &Path, root_file: &Path) -> anyhow::Result<Vec<File>> {
    let mut files = Vec::new();
    let folder = root_file.parent().unwrap_or(root_file).to_path_buf();
    // Files to read: path, the module they hold, and the folder of its children.
    let mut open: Vec<(PathBuf, ModulePath, PathBuf)> =
        vec![(root_file.to_path_buf(), Vec::new(), folder)];
    while let Some((path, module, folder)) = open.pop() {
        let name = path
            .strip_prefix(root)
            .unwrap_or(&path)
            .display()
            .to_string();
        let code =
            fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
        let file = File::parse(&name, &module, &code)?;
        for child in &file.file_modules {
            // Inline modules between file and child are folders as well.
            let inner: PathBuf = child[module.len()..].iter().collect();
            let beside = folder.join(&inner).with_extension("rs");
            let within = folder.join(&inner).join("mod.rs");
            let path = if beside.is_file() { beside } else { within };
            open.push((path, child.clone(), folder.join(&inner)));
        }
        files.push(file);
    }
    Ok(files)
}

#[cfg(test)]
mod tests;
