//! The check of a configuration, once, against the table of all keys.

use super::error::ConfigError;
use super::fields::FIELDS;
use super::sections::Config;

/// A configuration whose every value lies in its range.
#[derive(Debug, Clone, PartialEq)]
pub struct ValidConfig(Config);

impl core::ops::Deref for ValidConfig {
    type Target = Config;
    fn deref(&self) -> &Config {
        &self.0
    }
}

impl Config {
    /// Checks every value against its range.
    ///
    /// # Errors
    /// [`ConfigError::OutOfRange`] for the first value outside.
    pub fn check(self) -> Result<ValidConfig, ConfigError> {
        for field in FIELDS {
            field.check(&self)?;
        }
        Ok(ValidConfig(self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn out_of_range_names_key_value_and_range() {
        let mut config = Config::default();
        config.filter.particles = 0;
        let text = config.check().unwrap_err().to_string();
        assert!(
            text.contains("filter.particles") && text.contains("is 0"),
            "{text}"
        );
        let mut config = Config::default();
        config.features.sigma_px = f64::NAN;
        let text = config.check().unwrap_err().to_string();
        assert!(text.contains("features.sigma_px"), "{text}");
    }

    #[test]
    fn values_are_shown_as_toml_writes_them() {
        let config = Config::default();
        let shown = |key: &str| {
            let field = FIELDS.iter().find(|field| field.key == key).unwrap();
            field.value_text(&config)
        };
        assert_eq!(
            shown("method"),
            format!("\"{}\"", config.filter.method.name())
        );
        assert_eq!(shown("particles"), "10");
        assert_eq!(shown("contrast_threshold"), "0.04");
        assert_eq!(shown("edge_ratio"), "10.0");
        assert_eq!(shown("min_parallax_px"), "8.0");
    }
}
