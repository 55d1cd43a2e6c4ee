//! Every key of the configuration: unit, range, reason.

use core::fmt;

use super::error::ConfigError;
use super::sections::Config;

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
    /// Its effect, in one line.
    pub reason: &'static str,
    value: fn(&Config) -> Value,
}

/// The value of one key.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Value {
    Name(&'static str),
    Integer(u64),
    /// Shown with the digits of an `f32`.
    Short(f32),
    Number(f64),
}

impl From<u32> for Value {
    fn from(value: u32) -> Self {
        Self::Integer(value.into())
    }
}

impl From<u64> for Value {
    fn from(value: u64) -> Self {
        Self::Integer(value)
    }
}

impl From<f32> for Value {
    fn from(value: f32) -> Self {
        Self::Short(value)
    }
}

impl From<f64> for Value {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl fmt::Display for Value {
    /// The value as TOML writes it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self {
            Self::Name(name) => return write!(f, "\"{name}\""),
            Self::Integer(value) => return write!(f, "{value}"),
            Self::Short(value) => value.to_string(),
            Self::Number(value) => value.to_string(),
        };
        // A float keeps its point.
        let point = if text.contains(['.', 'e', 'n', 'i']) {
            ""
        } else {
            ".0"
        };
        write!(f, "{text}{point}")
    }
}

impl Field {
    /// The value as TOML text.
    #[must_use]
    pub fn value_text(&self, config: &Config) -> String {
        (self.value)(config).to_string()
    }

    pub(super) fn check(&self, config: &Config) -> Result<(), ConfigError> {
        let number = match (self.value)(config) {
            Value::Name(_) => return Ok(()),
            Value::Integer(value) => value as f64,
            Value::Short(value) => value.into(),
            Value::Number(value) => value,
        };
        match self.range {
            // A NaN is in no range.
            Range::Between(low, high) if !(number >= low && number <= high) => {
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
    value: fn(&Config) -> Value,
) -> Field {
    Field {
        section,
        key,
        unit,
        range: Range::Between(low, high),
        reason,
        value,
    }
}

/// All keys, in the order they are printed.
pub const FIELDS: &[Field] = &[
    Field {
        section: "filter",
        key: "method",
        unit: "",
        range: Range::OneOf(&["\"exact\"", "\"paper\"", "\"conventional\""]),
        reason: "which filter runs: the paper's made exact, as printed, or the conventional one",
        value: |c| Value::Name(c.filter.method.name()),
    },
    field(
        "filter",
        "particles",
        "",
        1.0,
        100_000.0,
        "hypotheses about the path; more cost proportionally more time",
        |c| c.filter.particles.into(),
    ),
    field(
        "filter",
        "seed",
        "",
        0.0,
        9.2e18,
        "same seed, same bytes",
        |c| c.filter.seed.into(),
    ),
    field(
        "filter",
        "threads",
        "",
        0.0,
        1024.0,
        "0 takes all cores; results do not depend on it",
        |c| c.filter.threads.into(),
    ),
    field(
        "filter",
        "resampling_threshold",
        "share of N",
        0.0,
        1.0,
        "resample when N_eff falls below (II.C)",
        |c| c.filter.resampling_threshold.into(),
    ),
    field(
        "filter",
        "evolution_steps",
        "",
        0.0,
        1000.0,
        "evolution steps after a resampling (II.D)",
        |c| c.filter.evolution_steps.into(),
    ),
    field(
        "filter",
        "iterations",
        "",
        1.0,
        20.0,
        "linearisations of the pose proposal",
        |c| c.filter.iterations.into(),
    ),
    field(
        "filter",
        "lag",
        "keyframes",
        0.0,
        50.0,
        "after so many keyframes the recent path is solved again; 0 never does",
        |c| c.filter.lag.into(),
    ),
    field(
        "filter",
        "window",
        "keyframes",
        2.0,
        100.0,
        "length of the recent path that is solved again; never shorter than filter.lag",
        |c| c.filter.window.into(),
    ),
    Field {
        section: "robot",
        key: "preset",
        unit: "",
        range: Range::OneOf(&["\"table-top\"", "\"room\"", "\"car\""]),
        reason: "kind of robot; it sets noise, turning centre and keyframes where no key states them, so delete those keys",
        value: |c| Value::Name(c.robot.preset.name()),
    },
    field(
        "odometry",
        "forward_per_sqrt_m",
        "m/sqrt(m)",
        0.0,
        10.0,
        "forward noise of the wheels; grows with the square root of the distance, whatever the row rate",
        |c| c.odometry.forward_per_sqrt_m.into(),
    ),
    field(
        "odometry",
        "forward_per_sqrt_s",
        "m/sqrt(s)",
        0.0,
        10.0,
        "forward noise of the wheels that grows with time",
        |c| c.odometry.forward_per_sqrt_s.into(),
    ),
    field(
        "odometry",
        "sideways_per_sqrt_m",
        "m/sqrt(m)",
        0.0,
        10.0,
        "sideways motion the wheels do not tell; a camera yawed by an error of its mount looks the same",
        |c| c.odometry.sideways_per_sqrt_m.into(),
    ),
    field(
        "odometry",
        "turn_per_sqrt_rad",
        "rad/sqrt(rad)",
        0.0,
        10.0,
        "turn noise that grows with the angle turned",
        |c| c.odometry.turn_per_sqrt_rad.into(),
    ),
    field(
        "odometry",
        "turn_per_sqrt_m",
        "rad/sqrt(m)",
        0.0,
        10.0,
        "turn noise that grows with the distance",
        |c| c.odometry.turn_per_sqrt_m.into(),
    ),
    field(
        "odometry",
        "turn_per_sqrt_s",
        "rad/sqrt(s)",
        0.0,
        10.0,
        "turn noise that grows with time",
        |c| c.odometry.turn_per_sqrt_s.into(),
    ),
    field(
        "odometry",
        "scale_bias",
        "share",
        0.0,
        0.5,
        "constant error of the wheel radius; no sensor here sees it, the covariance carries it",
        |c| c.odometry.scale_bias.into(),
    ),
    field(
        "carrier",
        "tilt_sigma",
        "rad",
        0.0,
        0.2,
        "roll and pitch of the carrier; 0 for a strictly planar one",
        |c| c.carrier.tilt_sigma.into(),
    ),
    field(
        "carrier",
        "tilt_time_s",
        "s",
        0.001,
        1000.0,
        "time in which roll and pitch are forgotten",
        |c| c.carrier.tilt_time_s.into(),
    ),
    field(
        "carrier",
        "slope_sigma",
        "m/m",
        0.0,
        0.5,
        "height change per distance driven; 0 for a flat floor",
        |c| c.carrier.slope_sigma.into(),
    ),
    field(
        "carrier",
        "scale_drift",
        "1/sqrt(m)",
        0.0,
        0.5,
        "drift of the map's scale, renewed by odometry",
        |c| c.carrier.scale_drift.into(),
    ),
    field(
        "carrier",
        "scale_sigma",
        "share",
        0.0,
        0.2,
        "scale uncertainty at the start; 0 freezes the scale (paper)",
        |c| c.carrier.scale_sigma.into(),
    ),
    field(
        "carrier",
        "first_heading_sigma",
        "rad",
        0.0,
        1.0,
        "alignment of the first heading; no image sees it, the covariance carries it",
        |c| c.carrier.first_heading_sigma.into(),
    ),
    field(
        "carrier",
        "mount_yaw_sigma",
        "rad",
        0.0,
        1.0,
        "yaw of the camera mount; no image sees it, the covariance carries it",
        |c| c.carrier.mount_yaw_sigma.into(),
    ),
    field(
        "carrier",
        "focal_sigma",
        "share",
        0.0,
        0.5,
        "focal length; turns are wrong by as much, the covariance carries it",
        |c| c.carrier.focal_sigma.into(),
    ),
    field(
        "carrier",
        "turn_bias_sigma",
        "rad/s",
        0.0,
        1.0,
        "constant error of the turn rate (gyro bias, unequal wheels) at the start; learned during the run",
        |c| c.carrier.turn_bias_sigma.into(),
    ),
    field(
        "carrier",
        "turning_centre_sigma_m",
        "m",
        0.0,
        10.0,
        "how far ahead of the body origin the point lies that does not slip sideways; learned during the run",
        |c| c.carrier.turning_centre_sigma_m.into(),
    ),
    field(
        "features",
        "max_keypoints",
        "",
        10.0,
        100_000.0,
        "strongest keypoints kept in a frame",
        |c| c.features.max_keypoints.into(),
    ),
    field(
        "features",
        "contrast_threshold",
        "",
        0.0,
        1.0,
        "SIFT contrast threshold; lower finds more",
        |c| c.features.contrast_threshold.into(),
    ),
    field(
        "features",
        "edge_ratio",
        "",
        1.0,
        1000.0,
        "SIFT limit on the ratio of principal curvatures",
        |c| c.features.edge_ratio.into(),
    ),
    field(
        "features",
        "sigma_px",
        "px",
        0.01,
        20.0,
        "noise of the coordinates of the smallest keypoints",
        |c| c.features.sigma_px.into(),
    ),
    field(
        "association",
        "ratio",
        "",
        0.1,
        1.0,
        "nearest over second nearest descriptor (Eq. 21)",
        |c| c.association.ratio.into(),
    ),
    field(
        "association",
        "gate",
        "chi-square, 2 dof",
        1.0,
        1000.0,
        "largest squared normalised innovation of a match",
        |c| c.association.gate.into(),
    ),
    field(
        "association",
        "guided_distance",
        "descriptor units",
        0.0,
        1000.0,
        "largest descriptor distance where a landmark is predicted",
        |c| c.association.guided_distance.into(),
    ),
    field(
        "association",
        "guided_ratio",
        "",
        0.1,
        1.0,
        "the ratio test among keypoints in a landmark's gate",
        |c| c.association.guided_ratio.into(),
    ),
    field(
        "association",
        "outlier_share",
        "share",
        0.0001,
        0.9,
        "wrong matches the likelihood allows for",
        |c| c.association.outlier_share.into(),
    ),
    field(
        "association",
        "max_scored",
        "",
        4.0,
        100_000.0,
        "matches that weigh particles; the rest only update the map",
        |c| c.association.max_scored.into(),
    ),
    field(
        "mapping",
        "min_depth_m",
        "m",
        0.001,
        1000.0,
        "nearest depth a new landmark is expected at",
        |c| c.mapping.min_depth_m.into(),
    ),
    field(
        "mapping",
        "open_depth",
        "sigma_rho / rho",
        0.001,
        1.0,
        "above it a depth is open and scored across its epipolar line only",
        |c| c.mapping.open_depth.into(),
    ),
    field(
        "mapping",
        "min_parallax",
        "rad",
        0.0001,
        1.0,
        "parallax of a two-view start (paper, conventional)",
        |c| c.mapping.min_parallax.into(),
    ),
    field(
        "mapping",
        "tentative_keyframes",
        "",
        1.0,
        1000.0,
        "keyframes a feature waits for its second sighting",
        |c| c.mapping.tentative_keyframes.into(),
    ),
    field(
        "mapping",
        "max_new",
        "",
        1.0,
        100_000.0,
        "features started in one keyframe",
        |c| c.mapping.max_new.into(),
    ),
    field(
        "mapping",
        "max_landmarks",
        "",
        50.0,
        10_000_000.0,
        "landmarks of the map; beyond it the least used ones out of view leave. About 0.95 kB each",
        |c| c.mapping.max_landmarks.into(),
    ),
    field(
        "mapping",
        "max_keyframes",
        "",
        32.0,
        4096.0,
        "keyframes whose joint covariance is kept, old ones thinned out; 36 bytes times its square",
        |c| c.mapping.max_keyframes.into(),
    ),
    field(
        "mapping",
        "max_megabytes",
        "MB",
        0.0,
        1e6,
        "memory of the map of all particles; beyond it landmarks leave as beyond max_landmarks. 0 bounds nothing",
        |c| c.mapping.max_megabytes.into(),
    ),
    field(
        "keyframes",
        "min_parallax_px",
        "px",
        0.0,
        1000.0,
        "median image motion, rotation taken out, that makes a filter step; 0 steps every frame",
        |c| c.keyframes.min_parallax_px.into(),
    ),
    field(
        "keyframes",
        "min_overlap",
        "share",
        0.0,
        1.0,
        "a step is made when matches fall below this share of the last step's",
        |c| c.keyframes.min_overlap.into(),
    ),
    field(
        "keyframes",
        "max_gap_s",
        "s",
        0.0,
        100_000.0,
        "a step is made after so many seconds at the latest",
        |c| c.keyframes.max_gap_s.into(),
    ),
];
