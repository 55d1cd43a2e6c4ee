//! Licences of the whole dependency tree against a list.
//!
//! A package passes when its SPDX expression can be satisfied with listed licences only; the old `/` between licences
//! means `OR`. Exceptions name the package and the reason.

use crate::tidy::metadata::{packages, text};
use serde_json::Value;
use spdx::{Expression, LicenseItem, ParseMode};

/// Licences that may be combined with MIT or Apache-2.0.
const ALLOWED: [&str; 11] = [
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
    "bzip2-1.0.6",
];
/// Packages that pass all the same: name, reason, and when to remove the line.
const EXCEPTIONS: [(&str, &str); 0] = [];

/// Packages whose licence is not on the list.
pub(crate) fn violations(metadata: &Value) -> Vec<String> {
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

/// Whether an SPDX expression can be satisfied with listed licences; an exception to a licence only adds permissions.
fn passes(expression: &str) -> bool {
    let mode = ParseMode {
        allow_slash_as_or_operator: true,
        ..ParseMode::STRICT
    };
    Expression::parse_mode(expression, mode).is_ok_and(|parsed| {
        parsed.evaluate(|required| match &required.license {
            LicenseItem::Spdx { id, .. } => ALLOWED.contains(&id.name),
            LicenseItem::Other { .. } => false,
        })
    })
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
            "LicenseRef-ours",
        ] {
            assert!(!passes(bad), "{bad}");
        }
    }
}
