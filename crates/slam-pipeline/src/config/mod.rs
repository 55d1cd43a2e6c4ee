//! The configuration of a run: every setting with a default.
//!
//! [`Config`] is plain data; [`Config::check`] turns it into a [`ValidConfig`] once, against the
//! ranges of [`FIELDS`], the table of all keys with unit, range and reason. `slam-io` reads and
//! writes it as TOML and documents it from the same table, so that check and documentation agree.

mod error;
mod fields;
mod robot;
mod sections;
mod valid;

pub use error::ConfigError;
pub use fields::{FIELDS, Field, Range};
pub use sections::{
    AssociationSection, CarrierSection, Config, FeaturesSection, FilterSection, KeyframesSection,
    MappingSection, Method, OdometrySection, Robot, RobotSection,
};
pub use valid::ValidConfig;
