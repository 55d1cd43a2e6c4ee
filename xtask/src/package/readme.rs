//! Links of a README that point into the repository, for readers who have the package alone.

/// The text with every relative link made absolute, or, without a repository, made plain text.
pub(super) fn with_links(text: &str, crate_name: &str, repository: Option<&str>) -> String {
    let mut written = String::new();
    let mut rest = text;
    while let Some(middle) = rest.find("](") {
        let after = &rest[middle + 2..];
        let target = after.split(')').next().unwrap_or_default();
        let start = rest[..middle].rfind('[');
        let (Some(start), true) = (start, is_relative(target)) else {
            written += &rest[..middle + 2];
            rest = after;
            continue;
        };
        let path = in_repository(target, crate_name);
        written += &match repository {
            Some(repository) => format!("{}]({repository}/blob/HEAD/{path}", &rest[..middle]),
            None => {
                let label = &rest[start + 1..middle];
                let plain = label.trim_matches('`').replace('\n', " ");
                let place = if plain == path || plain == path.trim_start_matches("crates/") {
                    String::from(" in the repository")
                } else {
                    format!(" ({path} in the repository)")
                };
                format!("{}{label}{place}", &rest[..start])
            }
        };
        rest = &after[target.len() + usize::from(repository.is_none())..];
    }
    written + rest
}

/// Whether the target of a link is a path and not an address or a place of the same page.
fn is_relative(target: &str) -> bool {
    !target.contains("://") && !target.starts_with('#') && !target.is_empty()
}

/// A path from the README of a crate as a path from the root of the repository.
fn in_repository(target: &str, crate_name: &str) -> String {
    let mut parts = vec!["crates", crate_name];
    for part in target.split('/') {
        match part {
            ".." => {
                parts.pop();
            }
            "." | "" => {}
            other => parts.push(other),
        }
    }
    parts.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "See [the\nresults](../../docs/results/a.md), [`ukf`](../ukf) and [evo](https://evo.example).\n";

    #[test]
    fn links_into_the_repository_become_absolute() {
        assert_eq!(
            with_links(TEXT, "rbpf-core", Some("https://a.example/b")),
            "See [the\nresults](https://a.example/b/blob/HEAD/docs/results/a.md), \
             [`ukf`](https://a.example/b/blob/HEAD/crates/ukf) and [evo](https://evo.example).\n"
        );
    }

    #[test]
    fn without_a_repository_they_are_plain_text() {
        assert_eq!(
            with_links(TEXT, "rbpf-core", None),
            "See the\nresults (docs/results/a.md in the repository), `ukf` in the repository and \
             [evo](https://evo.example).\n"
        );
    }
}
