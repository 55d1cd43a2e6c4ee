//! Manifests with the names of the family, line by line: the workspace's own are regular enough.

use super::names::{Published, family};
use std::fmt::Write as _;

/// The manifest of the workspace without `xtask` and without profiles, which are no part of a package.
pub(super) fn root(text: &str, names: &[&str]) -> String {
    let kept = text
        .lines()
        .take_while(|line| !line.starts_with("[profile"));
    let mut written = String::new();
    for line in kept {
        let own = names
            .iter()
            .find(|name| line.starts_with(&format!("{name} = {{ path = ")));
        written += &match own {
            Some(name) => line.replacen("{ ", &format!("{{ package = \"{}\", ", family(name)), 1),
            None if line.starts_with("members = ") => line.replace(", \"xtask\"", ""),
            None => line.to_owned(),
        };
        written.push('\n');
    }
    written
}

/// The manifest of one crate: its name in the family, the name in `use`, the repository.
pub(super) fn member(
    text: &str,
    package: &Published,
    names: &[&str],
    repository: Option<&str>,
) -> String {
    let own_name = format!("name = \"{}\"", package.name);
    let (mut written, mut section) = (String::new(), "");
    for line in text.lines() {
        if line.starts_with('[') {
            section = line.trim();
        }
        if section == "[package]" && line == own_name {
            let _ = writeln!(written, "name = \"{}\"", family(&package.name));
            if let Some(repository) = repository {
                let _ = writeln!(written, "repository = \"{repository}\"");
            }
            continue;
        }
        let key = line.split(['.', ' ']).next().unwrap_or_default();
        if section == "[dev-dependencies]" && names.contains(&key) {
            written += &without_version(line, key);
        } else {
            written += line;
        }
        written.push('\n');
    }
    if package.library && !text.contains("\n[lib]") {
        let name = package.name.replace('-', "_");
        let _ = write!(written, "\n[lib]\nname = \"{name}\"\n");
    }
    if package.binary && !text.contains("\n[[bin]]") {
        let name = &package.name;
        let _ = write!(
            written,
            "\n[[bin]]\nname = \"{name}\"\npath = \"src/main.rs\"\n"
        );
    }
    written
}

/// A dependency for development on a crate of the workspace, by its path alone.
fn without_version(line: &str, key: &str) -> String {
    let place = format!("path = \"../{key}\", package = \"{}\"", family(key));
    if line.contains("workspace = true,") {
        line.replacen("workspace = true", &place, 1)
    } else {
        format!("{key} = {{ {place} }}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_change_and_the_name_in_use_stays() {
        let package = Published {
            name: String::from("rbpf-core"),
            library: true,
            binary: false,
        };
        let text = "[package]\nname = \"rbpf-core\"\nversion.workspace = true\n\n[dependencies]\nukf.workspace = true\n\
                    \n[dev-dependencies]\nukf.workspace = true\nrand.workspace = true\n\
                    es-evolve = { workspace = true, features = [\"a\"] }\n";
        let told = member(
            text,
            &package,
            &["ukf", "es-evolve"],
            Some("https://a.example/b"),
        );
        assert_eq!(
            told,
            "[package]\nname = \"monoslam-rbpf-core\"\nrepository = \"https://a.example/b\"\nversion.workspace = true\n\
             \n[dependencies]\nukf.workspace = true\n\n[dev-dependencies]\nukf = { path = \"../ukf\", package = \"monoslam-ukf\" }\n\
             rand.workspace = true\nes-evolve = { path = \"../es-evolve\", package = \"monoslam-es-evolve\", features = [\"a\"] }\n\
             \n[lib]\nname = \"rbpf_core\"\n"
        );
    }

    #[test]
    fn the_root_loses_what_is_no_part_of_a_package() {
        let text = "members = [\"crates/*\", \"xtask\"]\nukf = { path = \"crates/ukf\", version = \"0.1.0\" }\n\
                    rand = \"1\"\n\n[profile.dev]\nopt-level = 2\n";
        assert_eq!(
            root(text, &["ukf"]),
            "members = [\"crates/*\"]\nukf = { package = \"monoslam-ukf\", path = \"crates/ukf\", version = \"0.1.0\" }\n\
             rand = \"1\"\n\n"
        );
    }
}
