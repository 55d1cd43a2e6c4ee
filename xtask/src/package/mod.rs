//! The crates as they would be published: `cargo xtask package`.
//!
//! Inside the workspace a crate has a short name (`cargo test -p ukf`); on a registry names are shared with everybody, and
//! some short ones are taken. The names of the family are therefore given here and only here: the publishable crates are
//! copied to a folder of their own, every package becomes `monoslam-NAME` there (the program keeps its name), the name in
//! `use` stays what it was, and cargo packages the copy. Two things that only the place of publication can tell are filled in
//! too: the address of the repository, and with it the links of the READMEs, which point into the repository.
//!
//! Dependencies for development between the crates lose their version, so that cargo leaves them out of what is published;
//! otherwise two crates that test each other could not be published in any order.

mod manifest;
mod names;
mod readme;

use crate::programs;
use anyhow::{Context, bail, ensure};
use names::{Published, family, published};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The flags of the command.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Options {
    /// Folder of the copy and the packages; `out/package` when absent.
    pub(crate) out: Option<PathBuf>,
    /// Address of the repository, without a slash at its end.
    pub(crate) repository: Option<String>,
    /// Compile every package from its own files.
    pub(crate) verify: bool,
    /// Ask the registry whether the names are free.
    pub(crate) check_names: bool,
}

/// Packages every publishable crate of the workspace at `root`; the printed table has a line for each.
///
/// # Errors
/// A file cannot be read or written, or cargo refuses a package.
pub(crate) fn run(root: &Path, metadata: &Value, options: &Options) -> anyhow::Result<String> {
    let published = published(metadata);
    let out = options
        .out
        .clone()
        .unwrap_or_else(|| root.join("out/package"));
    let copy = out.join("workspace");
    if copy.exists() {
        fs::remove_dir_all(&copy).with_context(|| format!("cannot empty {}", copy.display()))?;
    }
    copy_workspace(root, &copy, &published, options.repository.as_deref())?;

    let target = out.join("target");
    let mut command = Command::new(programs::cargo());
    command.args(["package", "--workspace", "--allow-dirty", "--target-dir"]);
    command.arg(&target).current_dir(&copy);
    if !options.verify {
        command.arg("--no-verify");
    }
    let output = command.output().context("cannot run cargo package")?;
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    ensure!(output.status.success(), "cargo package failed:\n{said}");
    // Without a repository that warning is known: the table says it.
    let warnings: BTreeSet<&str> = said
        .lines()
        .filter(|line| line.starts_with("warning: "))
        .filter(|line| options.repository.is_some() || !line.ends_with("or repository"))
        .collect();
    for warning in warnings {
        eprintln!("{warning}");
    }

    let sizes = sizes(&said);
    let mut table = format!(
        "{:<22}{:<32}{:>6}{:>12}  registry\n",
        "crate", "package", "files", "packed"
    );
    for package in &published {
        let family = family(&package.name);
        let (files, packed) = sizes
            .get(&family)
            .with_context(|| format!("cargo did not package {family}"))?;
        let on_registry = if options.check_names {
            availability(&family)?
        } else {
            "not asked"
        };
        writeln!(
            table,
            "{:<22}{family:<32}{files:>6}{packed:>12}  {on_registry}",
            package.name
        )?;
    }
    let folder = target.join("package");
    writeln!(
        table,
        "{} packages in {}",
        published.len(),
        folder.display()
    )?;
    if options.repository.is_none() {
        table += "no --repository: the manifests name none, and links into the repository became plain text\n";
    }
    Ok(table)
}

/// Copies root manifest, lock and the published crates, with names and links changed on the way.
fn copy_workspace(
    root: &Path,
    copy: &Path,
    published: &[Published],
    repository: Option<&str>,
) -> anyhow::Result<()> {
    let names: Vec<&str> = published.iter().map(|one| one.name.as_str()).collect();
    let read = |path: &Path| {
        fs::read_to_string(root.join(path))
            .with_context(|| format!("cannot read {}", path.display()))
    };
    for path in crate::tidy::paths(root)? {
        let mut parts = path.iter().map(|part| part.to_string_lossy());
        let (first, second) = (parts.next(), parts.next());
        let wanted = first.as_deref() == Some("crates")
            && second.as_deref().is_some_and(|name| names.contains(&name));
        if !wanted {
            continue;
        }
        let to = copy.join(&path);
        if root.join(&path).is_dir() {
            fs::create_dir_all(&to)?;
            continue;
        }
        let within = path.iter().count();
        let file = path.file_name().unwrap_or_default();
        let package = published
            .iter()
            .find(|one| Some(one.name.as_str()) == second.as_deref());
        match (file.to_str(), within, package) {
            (Some("Cargo.toml"), 3, Some(package)) => {
                let text = manifest::member(&read(&path)?, package, &names, repository);
                fs::write(&to, text)
            }
            (Some("README.md"), 3, Some(package)) => fs::write(
                &to,
                readme::with_links(&read(&path)?, &package.name, repository),
            ),
            _ => fs::copy(root.join(&path), &to).map(|_| ()),
        }
        .with_context(|| format!("cannot write {}", to.display()))?;
    }
    fs::write(
        copy.join("Cargo.toml"),
        manifest::root(&read(Path::new("Cargo.toml"))?, &names),
    )?;
    fs::copy(root.join("Cargo.lock"), copy.join("Cargo.lock"))?;
    Ok(())
}

/// Number of files and packed size by package, from the lines that cargo prints.
fn sizes(said: &str) -> BTreeMap<String, (String, String)> {
    let (mut found, mut package) = (BTreeMap::new(), None);
    for line in said.lines().map(str::trim) {
        if let Some(rest) = line.strip_prefix("Packaging ") {
            package = rest.split_whitespace().next().map(str::to_owned);
        } else if let (Some(rest), Some(name)) = (line.strip_prefix("Packaged "), &package) {
            // 23 files, 96.6KiB (25.4KiB compressed)
            let files = rest.split_whitespace().next().unwrap_or_default();
            let packed = rest.split(['(', ')']).nth(1).unwrap_or_default();
            let packed = packed.trim_end_matches(" compressed");
            found.insert(name.clone(), (files.to_owned(), packed.to_owned()));
        }
    }
    found
}

/// Whether a name is free on crates.io, as `cargo info` says.
fn availability(name: &str) -> anyhow::Result<&'static str> {
    let output = Command::new(programs::cargo())
        .args(["info", "--quiet", "--registry", "crates-io", name])
        // In a workspace cargo would show the crate of that name here.
        .current_dir(std::env::temp_dir())
        .output()
        .context("cannot run cargo info")?;
    let said = String::from_utf8_lossy(&output.stderr);
    if output.status.success() {
        Ok("taken")
    } else if said.contains("could not find") {
        Ok("free")
    } else {
        bail!("the registry does not answer about {name}: {}", said.trim())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_from_what_cargo_prints() {
        let said = "   Packaging monoslam-ukf v0.1.0 (/a)\n    Updating index\n    \
                    Packaged 23 files, 96.6KiB (25.4KiB compressed)\n   Packaging mono-slam v0.1.0 (/b)\n    \
                    Packaged 7 files, 9.0KiB (2.0KiB compressed)\n";
        let found = sizes(said);
        assert_eq!(
            found["monoslam-ukf"],
            (String::from("23"), String::from("25.4KiB"))
        );
        assert_eq!(found["mono-slam"].0, "7");
    }
}
