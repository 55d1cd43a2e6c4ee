//! The configuration of a run as TOML text.
//!
//! Keys that are missing take their defaults, unknown keys are errors. [`documented_toml`] prints
//! every key with unit, range and reason from the table that also drives the check of the values.

use slam_pipeline::config::{Config, FIELDS};
use thiserror::Error;

/// A text that is not TOML, has a value of the wrong type or an unknown key.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("configuration: {message}")]
pub struct SyntaxError {
    /// The fault and, where it is known, its line.
    message: String,
}

/// Reads TOML text; the values are not yet checked against their ranges ([`Config::check`]).
///
/// # Errors
/// [`SyntaxError`] naming line and key.
pub fn from_toml(text: &str) -> Result<Config, SyntaxError> {
    let syntax = |error: toml::de::Error| SyntaxError {
        message: syntax_message(text, &error),
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

fn syntax_message(text: &str, error: &toml::de::Error) -> String {
    let line = error
        .span()
        .map(|s| text[..s.start.min(text.len())].matches('\n').count() + 1);
    match line {
        Some(line) => format!("line {line}: {}", error.message()),
        None => error.message().to_owned(),
    }
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
    fn a_value_that_is_no_number_is_read_and_then_refused() {
        let config = from_toml("[features]\nsigma_px = nan").unwrap();
        let text = config.check().unwrap_err().to_string();
        assert!(text.contains("features.sigma_px"), "{text}");
    }
}
