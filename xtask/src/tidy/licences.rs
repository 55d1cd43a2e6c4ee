//! Licences of the whole dependency tree against a list.
//!
//! A package's SPDX expression passes when some choice of its `OR` branches uses listed
//! licences only; the old `/` means `OR`. Exceptions name the crate, and why.

use super::{packages, text};
use serde_json::Value;

/// Licences that may be combined with MIT or Apache-2.0.
const ALLOWED: [&str; 10] = [
    "MIT",
    "Apache-2.0",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "0BSD",
    "ISC",
    "Zlib",
    "Unicode-3.0",
    "BSL-1.0",
    "Unlicense",
];
/// Packages that pass all the same: name, reason, and when to remove the line.
const EXCEPTIONS: [(&str, &str); 0] = [];

/// Packages whose licence is not on the list.
pub fn violations(metadata: &Value) -> Vec<String> {
    let mut found = Vec::new();
    for package in packages(metadata) {
        let (name, licence) = (text(package, "name"), text(package, "license"));
        let excepted = EXCEPTIONS.iter().any(|(excepted, _)| *excepted == name);
        if !excepted && !passes(licence) {
            found.push(format!("{name}: licence `{licence}` is not on the list"));
        }
    }
    found
}

/// Whether an SPDX expression can be satisfied with listed licences.
fn passes(expression: &str) -> bool {
    let spaced = expression
        .replace('(', " ( ")
        .replace(')', " ) ")
        .replace('/', " OR ");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut at = 0;
    either(&words, &mut at) == Some(true) && at == words.len()
}

/// Branches joined by `OR`; `None` when the expression is malformed.
fn either(words: &[&str], at: &mut usize) -> Option<bool> {
    let mut value = both(words, at)?;
    while words.get(*at) == Some(&"OR") {
        *at += 1;
        value |= both(words, at)?;
    }
    Some(value)
}

fn both(words: &[&str], at: &mut usize) -> Option<bool> {
    let mut value = single(words, at)?;
    while words.get(*at) == Some(&"AND") {
        *at += 1;
        value &= single(words, at)?;
    }
    Some(value)
}

fn single(words: &[&str], at: &mut usize) -> Option<bool> {
    let word = *words.get(*at)?;
    *at += 1;
    if word == "(" {
        let value = either(words, at)?;
        let closed = words.get(*at) == Some(&")");
        *at += 1;
        return closed.then_some(value);
    }
    if words.get(*at) == Some(&"WITH") {
        // An exception to a licence only adds permissions.
        *at += 2;
    }
    Some(ALLOWED.contains(&word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expressions_are_read_as_spdx_means_them() {
        for good in [
            "MIT",
            "MIT/Apache-2.0",
            "(MIT OR GPL-3.0-only) AND Unicode-3.0",
            "GPL-3.0-only OR Zlib",
            "Apache-2.0 WITH LLVM-exception OR GPL-2.0-only",
        ] {
            assert!(passes(good), "{good}");
        }
        for bad in [
            "",
            "GPL-3.0-only",
            "MIT AND GPL-3.0-only",
            "(MIT",
            "MIT MIT",
            "MIT OR",
        ] {
            assert!(!passes(bad), "{bad}");
        }
    }
}
