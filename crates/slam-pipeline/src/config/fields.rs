//! Every key of the configuration: unit, range, reason.

use core::fmt;

use super::{Config, ConfigError};

/// Values a key may take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// From the first to the second, both allowed.
    Between(f64, f64),
    /// One of these names.
    OneOf(&'static [&'static str]),
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Between(low, high) => write!(f, "{low} to {high}"),
            Self::OneOf(names) => write!(f, "one of {}", names.join(", ")),
        }
    }
}

/// One key.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    /// TOML section.
    pub section: &'static str,
    /// Key in the section.
    pub key: &'static str,
    /// Unit; empty for plain numbers.
    pub unit: &'static str,
    /// Values allowed.
    pub range: Range,
    /// What it does, in one line.
    pub reason: &'static str,
}

impl Field {
    fn value(&self, config: &Config) -> Option<toml::Value> {
        let table = toml::Table::try_from(config).ok()?;
        table.get(self.section)?.get(self.key).cloned()
    }

    /// The value as TOML text.
    #[must_use]
    pub fn value_text(&self, config: &Config) -> String {
        match self.value(config) {
            // f32 keys print their shortest form, not their f64 expansion.
            Some(toml::Value::Float(v)) => {
                let short = v as f32;
                let text = if f64::from(short) == v {
                    short.to_string()
                } else {
                    v.to_string()
                };
                if text.contains(['.', 'e', 'n', 'i']) {
                    text
                } else {
                    format!("{text}.0")
                }
            }
            Some(v) => v.to_string(),
            None => String::new(),
        }
    }

    pub(super) fn check(&self, config: &Config) -> Result<(), ConfigError> {
        let Some(value) = self.value(config) else {
            return Ok(());
        };
        let number = match &value {
            toml::Value::Integer(i) => Some(*i as f64),
            toml::Value::Float(v) => Some(*v),
            _ => None,
        };
        match (self.range, number) {
            // A NaN is in no range.
            (Range::Between(low, high), Some(v)) if !(v >= low && v <= high) => {
                Err(ConfigError::OutOfRange {
                    key: format!("{}.{}", self.section, self.key),
                    value: self.value_text(config),
                    range: self.range.to_string(),
                })
            }
            _ => Ok(()),
        }
    }
}

const fn field(
    section: &'static str,
    key: &'static str,
    unit: &'static str,
    low: f64,
    high: f64,
    reason: &'static str,
) -> Field {
    Field {
        section,
        key,
        unit,
        range: Range::Between(low, high),
        reason,
    }
}

/// All keys, in the order they are printed.
pub const FIELDS: &[Field] = &[
    Field {
        section: "filter",
        key: "method",
        unit: "",
        range: Range::OneOf(&["\"novel\"", "\"paper\"", "\"conventional\""]),
        reason: "which filter runs: the paper's made exact, as printed, or the conventional one",
    },
    field(
        "filter",
        "particles",
        "",
        1.0,
        100_000.0,
        "hypotheses about the path; more cost proportionally more time",
    ),
    field("filter", "seed", "", 0.0, 9.2e18, "same seed, same bytes"),
    field(
        "filter",
        "threads",
        "",
        0.0,
        1024.0,
        "0 takes all cores; results do not depend on it",
    ),
    field(
        "filter",
        "resampling_threshold",
        "share of N",
        0.0,
        1.0,
        "resample when N_eff falls below (II.C)",
    ),
    field(
        "filter",
        "evolution_steps",
        "",
        0.0,
        1000.0,
        "evolution steps after a resampling (II.D)",
    ),
    field(
        "filter",
        "iterations",
        "",
        1.0,
        20.0,
        "linearisations of the pose proposal",
    ),
    field(
        "odometry",
        "velocity_noise_ratio",
        "share of |v|",
        0.0,
        1.0,
        "white noise of v in each odometry row",
    ),
    field(
        "odometry",
        "velocity_noise_mps",
        "m/s",
        0.0,
        10.0,
        "white noise of v in each row at standstill",
    ),
    field(
        "odometry",
        "turn_noise_ratio",
        "share of |omega|",
        0.0,
        1.0,
        "white noise of omega in each odometry row",
    ),
    field(
        "odometry",
        "turn_noise_radps",
        "rad/s",
        0.0,
        10.0,
        "white noise of omega in each row when driving straight",
    ),
    field(
        "odometry",
        "slip_ratio",
        "share of |v|",
        0.0,
        1.0,
        "sideways motion the wheels do not tell, in each row; a camera yawed by an error of its mount looks the same",
    ),
    field(
        "odometry",
        "scale_bias",
        "share",
        0.0,
        0.5,
        "constant error of the wheel radius; no sensor here sees it, the covariance carries it",
    ),
    field(
        "carrier",
        "tilt_sigma",
        "rad",
        0.0,
        0.2,
        "roll and pitch of the carrier; 0 for a strictly planar one",
    ),
    field(
        "carrier",
        "tilt_time_s",
        "s",
        0.001,
        1000.0,
        "time in which roll and pitch are forgotten",
    ),
    field(
        "carrier",
        "slope_sigma",
        "m/m",
        0.0,
        0.5,
        "height change per distance driven; 0 for a flat floor",
    ),
    field(
        "carrier",
        "scale_drift",
        "1/sqrt(m)",
        0.0,
        0.5,
        "drift of the map's scale, renewed by odometry",
    ),
    field(
        "carrier",
        "scale_sigma",
        "share",
        0.0,
        0.2,
        "scale uncertainty at the start; 0 freezes the scale (paper)",
    ),
    field(
        "features",
        "max_keypoints",
        "",
        10.0,
        100_000.0,
        "strongest keypoints kept in a frame",
    ),
    field(
        "features",
        "contrast_threshold",
        "",
        0.0,
        1.0,
        "SIFT contrast threshold; lower finds more",
    ),
    field(
        "features",
        "edge_ratio",
        "",
        1.0,
        1000.0,
        "SIFT limit on the ratio of principal curvatures",
    ),
    field(
        "features",
        "sigma_px",
        "px",
        0.01,
        20.0,
        "noise of a keypoint's coordinates",
    ),
    field(
        "association",
        "ratio",
        "",
        0.1,
        1.0,
        "nearest over second nearest descriptor (Eq. 21)",
    ),
    field(
        "association",
        "gate",
        "chi-square, 2 dof",
        1.0,
        1000.0,
        "largest squared normalised innovation of a match",
    ),
    field(
        "association",
        "guided_distance",
        "descriptor units",
        0.0,
        1000.0,
        "largest descriptor distance where a landmark is predicted",
    ),
    field(
        "association",
        "guided_ratio",
        "",
        0.1,
        1.0,
        "the ratio test among keypoints in a landmark's gate",
    ),
    field(
        "association",
        "outlier_share",
        "share",
        0.0001,
        0.9,
        "wrong matches the likelihood allows for",
    ),
    field(
        "association",
        "max_scored",
        "",
        4.0,
        100_000.0,
        "matches that weigh particles; the rest only update the map",
    ),
    field(
        "mapping",
        "min_depth_m",
        "m",
        0.001,
        1000.0,
        "nearest depth a new landmark is expected at",
    ),
    field(
        "mapping",
        "open_depth",
        "sigma_rho / rho",
        0.001,
        1.0,
        "above it a depth is open and scored across its epipolar line only",
    ),
    field(
        "mapping",
        "min_parallax",
        "rad",
        0.0001,
        1.0,
        "parallax of a two-view start (paper, conventional)",
    ),
    field(
        "mapping",
        "tentative_keyframes",
        "",
        1.0,
        1000.0,
        "keyframes a feature waits for its second sighting",
    ),
    field(
        "mapping",
        "max_new",
        "",
        1.0,
        100_000.0,
        "features started in one keyframe",
    ),
    field(
        "keyframes",
        "min_flow_px",
        "px",
        0.0,
        1000.0,
        "median image motion that makes a filter step; 0 steps every frame",
    ),
    field(
        "keyframes",
        "min_overlap",
        "share",
        0.0,
        1.0,
        "a step is made when matches fall below this share of the last step's",
    ),
    field(
        "keyframes",
        "max_gap",
        "frames",
        1.0,
        100_000.0,
        "a step is made after so many frames at the latest",
    ),
];
