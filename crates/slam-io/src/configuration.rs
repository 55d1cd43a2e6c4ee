//! The configuration of a run as TOML text.
//!
//! Keys that are missing take their defaults, unknown keys are errors. [`documented_toml`] prints
//! every key with unit, range and reason from the table that also drives the check of the values.

use std::path::Path;

use slam_pipeline::config::{Config, ConfigError, FIELDS, Field};
use thiserror::Error;

use crate::error::SequenceError;
use crate::text::{quoted, read_text};
use crate::toml_fault::{TomlFault, line_of_key, section_of, syntax_fault};

/// A text that is not TOML, has a value of the wrong type or an unknown key.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("configuration{}: expected {}, found {}", at_line(fault.line), fault.expected, fault.found)]
pub struct SyntaxError {
    fault: TomlFault,
}

/// Reads a configuration file and checks its values against their ranges.
///
/// # Errors
/// [`SequenceError`] with the file, the line, what was expected and what was found: no text, no TOML, an unknown key, a value
/// of the wrong type or out of its range.
pub fn read_configuration(path: &Path) -> Result<Config, SequenceError> {
    let text = read_text(path)?;
    let config = from_toml(&text).map_err(|error| error.fault.of_file(path))?;
    match config.clone().check() {
        Ok(_) => Ok(config),
        Err(ConfigError::OutOfRange { key, value, range }) => {
            let line = key
                .split_once('.')
                .and_then(|(section, key)| line_of_key(&text, Some(section), key));
            Err(TomlFault {
                line,
                expected: format!("{range} for {key}"),
                found: value,
            }
            .of_file(path))
        }
    }
}

/// Reads TOML text; the values are not yet checked against their ranges ([`Config::check`]).
///
/// # Errors
/// [`SyntaxError`] naming line and key.
pub fn from_toml(text: &str) -> Result<Config, SyntaxError> {
    let syntax = |error: toml::de::Error| SyntaxError {
        fault: value_fault(text, &error)
            .unwrap_or_else(|| syntax_fault("a configuration", text, &error)),
    };
    // Read for its faults and for the kind of robot, whose defaults lie below the keys of the text.
    let plain: Config = toml::from_str(text).map_err(syntax)?;
    let defaults = Config::for_robot(plain.robot.preset);
    if defaults == Config::default() {
        return Ok(plain);
    }
    let mut table: toml::Table = toml::from_str(&to_toml(&defaults)).map_err(syntax)?;
    let stated: toml::Table = toml::from_str(text).map_err(syntax)?;
    for (section, keys) in stated {
        if let (Some(toml::Value::Table(below)), toml::Value::Table(keys)) =
            (table.get_mut(&section), keys)
        {
            below.extend(keys);
        }
    }
    table.try_into().map_err(syntax)
}

/// The configuration as TOML text without comments.
pub fn to_toml(config: &Config) -> String {
    // Plain numbers and names always serialise.
    toml::to_string(config).unwrap_or_default()
}

/// The default configuration with every key explained.
pub fn documented_toml() -> String {
    let mut out = String::from(
        "# Every key with its default, unit and range. Delete what you do not change.\n",
    );
    let defaults = Config::default();
    let mut section = "";
    for field in FIELDS {
        if field.section != section {
            section = field.section;
            out.push_str(&format!("\n[{section}]\n"));
        }
        let unit = if field.unit.is_empty() {
            String::new()
        } else {
            format!(" [{}]", field.unit)
        };
        out.push_str(&format!(
            "# {}{unit}; {}\n{} = {}\n",
            field.reason,
            field.range,
            field.key,
            field.value_text(&defaults)
        ));
    }
    out
}

/// The fault of a value of the wrong type, in the words of the table of all keys.
fn value_fault(text: &str, error: &toml::de::Error) -> Option<TomlFault> {
    let kind = error.message();
    if !["invalid type", "invalid value", "unknown variant"]
        .iter()
        .any(|start| kind.starts_with(start))
    {
        return None;
    }
    let before = text.get(..error.span()?.start)?;
    let line = 1 + before.matches('\n').count();
    let (key, value) = text.lines().nth(line - 1)?.split_once('=')?;
    let section = section_of(text, line)?;
    let field = FIELDS
        .iter()
        .find(|field| field.section == section && field.key == key.trim())?;
    Some(TomlFault {
        line: Some(line as u64),
        expected: format!(
            "{}{} for {section}.{}",
            kind_of(field),
            field.range,
            field.key
        ),
        found: quoted(value.split('#').next().unwrap_or_default().trim()),
    })
}

/// The kind of number of a key, before its range.
fn kind_of(field: &Field) -> &'static str {
    let written = field.value_text(&Config::default());
    if written.parse::<u64>().is_ok() {
        "a whole number, "
    } else if written.parse::<f64>().is_ok() {
        "a number, "
    } else {
        ""
    }
}

fn at_line(line: Option<u64>) -> String {
    line.map_or_else(String::new, |line| format!(", line {line}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use slam_pipeline::config::Robot;

    #[test]
    fn documented_text_is_the_default_and_complete() {
        let read = from_toml(&documented_toml()).unwrap();
        assert_eq!(read, Config::default());
        let table: toml::Table = toml::from_str(&to_toml(&Config::default())).unwrap();
        let keys: usize = table.values().map(|s| s.as_table().unwrap().len()).sum();
        assert_eq!(keys, FIELDS.len(), "every key is documented and checked");
    }

    /// The table of keys reads the same value that serialisation writes, key by key.
    #[test]
    fn the_table_shows_the_value_that_is_written() {
        let config = Config::default();
        let table: toml::Table = toml::from_str(&to_toml(&config)).unwrap();
        for field in FIELDS {
            let written = &table[field.section][field.key];
            let shown: toml::Table =
                toml::from_str(&format!("v = {}", field.value_text(&config))).unwrap();
            match (written, &shown["v"]) {
                (toml::Value::Float(a), toml::Value::Float(b)) => {
                    assert_eq!(*a as f32, *b as f32, "{}", field.key);
                }
                (a, b) => assert_eq!(a, b, "{}", field.key),
            }
        }
    }

    #[test]
    fn a_preset_sets_what_the_text_does_not() {
        let car = Config::for_robot(Robot::Car);
        assert_eq!(from_toml("[robot]\npreset = \"car\"\n").unwrap(), car);
        let read = from_toml(
            "[robot]\npreset = \"car\"\n[keyframes]\nmin_parallax_px = 7.0\n[filter]\nseed = 3\n",
        )
        .unwrap();
        assert_eq!(read.keyframes.min_parallax_px, 7.0);
        assert_eq!(read.filter.seed, 3);
        assert_eq!(read.carrier, car.carrier);
        assert_eq!(read.odometry, car.odometry);
        let unknown = from_toml("[robot]\npreset = \"boat\"\n")
            .unwrap_err()
            .to_string();
        assert!(
            unknown.contains("line 2") && unknown.contains("boat"),
            "{unknown}"
        );
    }

    #[test]
    fn unknown_key_is_named_with_its_line() {
        let error = from_toml("[filter]\nparticels = 3\n").unwrap_err();
        let text = error.to_string();
        assert!(
            text.contains("line 2") && text.contains("particels"),
            "{text}"
        );
    }

    #[test]
    fn regress_faults_of_the_toml_library_were_shown_as_they_are() {
        let told = |text: &str| from_toml(text).unwrap_err().to_string();
        assert_eq!(
            told("[mapping]\nmax_landmarks = -5\n"),
            "configuration, line 2: expected a whole number, 50 to 10000000 for mapping.max_landmarks, found \"-5\""
        );
        assert_eq!(
            told("[features]\nsigma_px = 1,5\n"),
            "configuration, line 2: expected a number with a decimal point for sigma_px, found 1,5"
        );
        assert_eq!(
            told("[filter]\nmethod = \"best\" # ?\n"),
            r#"configuration, line 2: expected one of "exact", "paper", "conventional" for filter.method, found "\"best\"""#
        );
        let unknown = told("[filters]\nparticles = 3\n");
        assert!(
            unknown.starts_with("configuration, line 1: expected one of the keys filter, robot, ")
                && unknown.ends_with(" in a configuration, found [filters]"),
            "{unknown}"
        );
    }

    #[test]
    fn a_value_that_is_no_number_is_read_and_then_refused() {
        let config = from_toml("[features]\nsigma_px = nan").unwrap();
        let text = config.check().unwrap_err().to_string();
        assert!(text.contains("features.sigma_px"), "{text}");
    }
}
