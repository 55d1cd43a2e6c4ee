//! Faults of TOML files in the words of their user: the key, what should stand there and what does.
//!
//! The TOML library speaks of keys, tables and tokens; a person who wrote `fx = 368,8` is to read that a decimal point
//! was expected for fx.

use std::path::Path;

use crate::error::SequenceError;
use crate::text::{line_fault, quoted};

/// A fault of a TOML text, without the name of its file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct TomlFault {
    /// The line, from one.
    pub(crate) line: Option<u64>,
    pub(crate) expected: String,
    pub(crate) found: String,
}

impl TomlFault {
    /// The fault of a file.
    pub(crate) fn of_file(self, path: &Path) -> SequenceError {
        match self.line {
            Some(line) => line_fault(path, line, self.expected, self.found),
            None => SequenceError::File {
                path: path.to_path_buf(),
                expected: self.expected,
                found: self.found,
            },
        }
    }
}

/// The fault of a text that is no such file: `kind` with its article.
pub(crate) fn syntax_fault(kind: &str, text: &str, error: &toml::de::Error) -> TomlFault {
    let offset = error.span().map_or(0, |span| span.start.min(text.len()));
    let line = 1 + text.as_bytes()[..offset]
        .iter()
        .filter(|&&byte| byte == b'\n')
        .count();
    let content = text.lines().nth(line - 1).unwrap_or_default().trim();
    let message = error.message().replace('\n', " ");
    let at = |expected: String, found: String| TomlFault {
        line: Some(line as u64),
        expected,
        found,
    };
    let section = section_of(text, line).filter(|_| header(content).is_none());
    if let Some(key) = named(&message, "missing field `") {
        let place = section.map_or(String::new(), |name| format!(" in [{name}]"));
        let example = match (key, section) {
            ("model", None) => "model = \"pinhole\"",
            _ => key,
        };
        return TomlFault {
            line: None,
            expected: format!("the key {example}{place}"),
            found: "none".to_owned(),
        };
    }
    if let Some(key) = named(&message, "unknown field `") {
        let known: Vec<&str> = message
            .split_once("expected ")
            .map(|(_, names)| names.split('`').skip(1).step_by(2).collect())
            .unwrap_or_default();
        let place = section.map_or(kind.to_owned(), |name| format!("[{name}]"));
        let found = match header(content) {
            Some(name) => format!("[{name}]"),
            None => key.to_owned(),
        };
        return at(
            format!("one of the keys {} in {place}", known.join(", ")),
            found,
        );
    }
    if let Some((key, value)) = content.split_once('=') {
        let (key, value) = (key.trim(), value.split('#').next().unwrap_or("").trim());
        if let Some((whole, decimals)) = value.split_once(',')
            && !whole.is_empty()
            && whole
                .trim_start_matches(['-', '+'])
                .bytes()
                .chain(decimals.bytes())
                .all(|byte| byte.is_ascii_digit())
        {
            return at(
                format!("a number with a decimal point for {key}"),
                value.to_owned(),
            );
        }
        if message.starts_with("invalid type") || message.starts_with("invalid value") {
            let wanted = message
                .rsplit_once("expected ")
                .map_or("another value", |(_, wanted)| wanted);
            let wanted = match wanted {
                "f64" => "a number",
                "u32" | "u64" => "a whole number",
                "a string" => "a word in quotes",
                other => other,
            };
            return at(format!("{wanted} for {key}"), quoted(value));
        }
        if message.contains("duplicate key") {
            return at(format!("{key} once"), "the key a second time".to_owned());
        }
        return at(format!("a value of TOML for {key}"), quoted(value));
    }
    at(
        "key = value, or a section in brackets".to_owned(),
        quoted(content),
    )
}

/// The line of a key: at the top, or within a section.
pub(crate) fn line_of_key(text: &str, section: Option<&str>, key: &str) -> Option<u64> {
    let mut here = None;
    for (content, line) in text.lines().zip(1_u64..) {
        let content = content.trim();
        if let Some(name) = header(content) {
            here = Some(name);
        } else if here == section
            && content
                .split_once('=')
                .is_some_and(|(name, _)| name.trim() == key)
        {
            return Some(line);
        }
    }
    None
}

/// The section that a line (from one) stands in.
pub(crate) fn section_of(text: &str, line: usize) -> Option<&str> {
    text.lines()
        .take(line)
        .filter_map(|content| header(content.trim()))
        .last()
}

fn header(content: &str) -> Option<&str> {
    content
        .strip_prefix('[')?
        .split(']')
        .next()
        .map(str::trim)
        .filter(|name| !name.starts_with('['))
}

fn named<'m>(message: &'m str, before: &str) -> Option<&'m str> {
    message.split_once(before)?.1.split('`').next()
}
