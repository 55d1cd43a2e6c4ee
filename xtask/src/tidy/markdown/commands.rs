//! The commands that a reader may be told to type: cargo's, those of `xtask`, those of `mono-slam`.

use crate::tidy::metadata::{packages, text};
use anyhow::Context;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Tasks of `cargo xtask`.
const TASKS: [&str; 8] = [
    "scene",
    "board",
    "fixtures",
    "synth-eval",
    "tidy",
    "package",
    "ci",
    "help",
];
/// The file whose `enum Command` lists the subcommands of the program.
const PROGRAM: &str = "crates/mono-slam/src/main.rs";

/// The packages, targets and subcommands that can be run.
#[derive(Debug, Default)]
pub(super) struct Commands {
    /// The targets of each package as (kind, name).
    packages: BTreeMap<String, BTreeSet<(String, String)>>,
    /// Subcommands of `mono-slam`.
    subcommands: BTreeSet<String>,
}

impl Commands {
    /// The commands of the workspace at `root`.
    ///
    /// # Errors
    /// The program's file cannot be read.
    pub(super) fn new(root: &Path, metadata: &Value) -> anyhow::Result<Self> {
        let code = fs::read_to_string(root.join(PROGRAM))
            .with_context(|| format!("cannot read {PROGRAM}"))?;
        let mut commands = Self {
            subcommands: subcommands(&code),
            ..Self::default()
        };
        for package in packages(metadata).filter(|package| package["source"].is_null()) {
            let targets = package["targets"].as_array().into_iter().flatten();
            let targets = targets.map(|target| {
                let kind = target["kind"][0].as_str().unwrap_or_default();
                (kind.to_owned(), text(target, "name").to_owned())
            });
            commands.add(text(package, "name"), targets);
        }
        Ok(commands)
    }

    /// Adds a package with its targets.
    pub(super) fn add(&mut self, name: &str, targets: impl Iterator<Item = (String, String)>) {
        self.packages.insert(name.to_owned(), targets.collect());
    }

    /// Sets the subcommands of the program from its code.
    #[cfg(test)]
    pub(super) fn set_program(&mut self, code: &str) {
        self.subcommands = subcommands(code);
    }

    /// The names in a command line that are not there; none for a line that is no command of ours.
    pub(super) fn wrong(&self, line: &str) -> Vec<String> {
        let words: Vec<&str> = line
            .split_whitespace()
            // Variables set for the command alone stand before it.
            .skip_while(|word| word.contains('=') && !word.starts_with('-'))
            .collect();
        match words.as_slice() {
            ["cargo", "xtask", task, ..] if !task.starts_with('-') && !TASKS.contains(task) => {
                vec![format!("no task `cargo xtask {task}`")]
            }
            [
                "cargo",
                "run" | "test" | "bench" | "build" | "check" | "doc" | "clippy",
                rest @ ..,
            ] => self.wrong_targets(rest),
            ["mono-slam", command, ..]
                if is_name(command) && !self.subcommands.contains(*command) =>
            {
                vec![format!("no command `mono-slam {command}`")]
            }
            _ => Vec::new(),
        }
    }

    /// Packages and targets among the arguments of cargo that are not there.
    fn wrong_targets(&self, arguments: &[&str]) -> Vec<String> {
        let own = arguments
            .split(|word| *word == "--")
            .next()
            .unwrap_or_default();
        let value = |names: &[&str]| {
            let at = own.iter().position(|word| names.contains(word))?;
            own.get(at + 1).copied()
        };
        let package = value(&["-p", "--package"]);
        if let Some(name) = package
            && !self.packages.contains_key(name)
        {
            return vec![format!("no package `{name}`")];
        }
        let mut found = Vec::new();
        for kind in ["example", "test", "bench", "bin"] {
            let Some(name) = value(&[&format!("--{kind}")]) else {
                continue;
            };
            let target = (kind.to_owned(), name.to_owned());
            let there = match package {
                Some(package) => self.packages[package].contains(&target),
                None => self
                    .packages
                    .values()
                    .any(|targets| targets.contains(&target)),
            };
            if !there {
                let of = package.map_or(String::new(), |package| format!(" in `{package}`"));
                found.push(format!("no {kind} `{name}`{of}"));
            }
        }
        found
    }
}

/// Whether a word can be the name of a subcommand.
fn is_name(word: &str) -> bool {
    !word.is_empty()
        && word.chars().all(|c| c.is_ascii_lowercase() || c == '-')
        && !word.starts_with('-')
}

/// The variants of `enum Command`, in lower case, and `help`.
fn subcommands(code: &str) -> BTreeSet<String> {
    let body = code
        .split_once("enum Command {")
        .and_then(|(_, rest)| rest.split_once("\n}"))
        .map_or("", |(body, _)| body);
    let variant = |line: &str| {
        let name: String = line
            .trim()
            .chars()
            .take_while(char::is_ascii_alphanumeric)
            .collect();
        name.starts_with(|first: char| first.is_ascii_uppercase())
            .then(|| name.to_ascii_lowercase())
    };
    body.lines()
        .filter_map(variant)
        .chain([String::from("help")])
        .collect()
}
