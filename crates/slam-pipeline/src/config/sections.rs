//! The sections of a configuration and their defaults, as plain data.

use serde::{Deserialize, Serialize};

/// Which filter runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// The paper's filter made exact: the default.
    Exact,
    /// The paper's printed formulas.
    Paper,
    /// The conventional RBPF: poses from odometry, weights from the likelihood.
    Conventional,
}

impl Method {
    /// Name as written in the configuration.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Exact => "exact",
            Self::Paper => "paper",
            Self::Conventional => "conventional",
        }
    }
}

/// `[filter]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FilterSection {
    /// Which filter runs.
    pub method: Method,
    /// Number of particles.
    pub particles: u32,
    /// Seed of all random streams.
    pub seed: u64,
    /// Threads; 0 takes all cores.
    pub threads: u32,
    /// Resample below this share of N.
    pub resampling_threshold: f64,
    /// Evolution steps after resampling.
    pub evolution_steps: u32,
    /// Linearisations of the pose proposal.
    pub iterations: u32,
    /// Keyframes between smoothings of the recent path; 0 never smooths it.
    pub lag: u32,
    /// Keyframes whose path is smoothed.
    pub window: u32,
}

/// `[odometry]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OdometrySection {
    /// Forward noise, m per square root of a metre.
    pub forward_per_sqrt_m: f64,
    /// Forward noise, m per square root of a second.
    pub forward_per_sqrt_s: f64,
    /// Sideways slip, m per square root of a metre.
    pub sideways_per_sqrt_m: f64,
    /// Turn noise, rad per square root of a radian.
    pub turn_per_sqrt_rad: f64,
    /// Turn noise, rad per square root of a metre.
    pub turn_per_sqrt_m: f64,
    /// Turn noise, rad per square root of a second.
    pub turn_per_sqrt_s: f64,
    /// Constant scale error of the odometry, standard deviation.
    pub scale_bias: f64,
}

/// `[carrier]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CarrierSection {
    /// Roll and pitch, standard deviation, radians.
    pub tilt_sigma: f64,
    /// Correlation time of roll and pitch, seconds.
    pub tilt_time_s: f64,
    /// Slope of the floor, standard deviation.
    pub slope_sigma: f64,
    /// Drift of the local scale per square root of a metre.
    pub scale_drift: f64,
    /// Scale at the start, standard deviation.
    pub scale_sigma: f64,
    /// Heading of the body axes against the first direction of the reference, standard deviation, radians.
    pub first_heading_sigma: f64,
    /// Yaw of the camera mount, standard deviation, radians.
    pub mount_yaw_sigma: f64,
    /// Focal length, relative standard deviation.
    pub focal_sigma: f64,
    /// Constant error of the turn rate, standard deviation, rad/s.
    pub turn_bias_sigma: f64,
    /// How far ahead of the body origin the point lies that does not slip, standard deviation, metres.
    pub turning_centre_sigma_m: f64,
}

/// `[features]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FeaturesSection {
    /// Strongest keypoints kept.
    pub max_keypoints: u32,
    /// Contrast threshold of SIFT.
    pub contrast_threshold: f32,
    /// Edge ratio of SIFT.
    pub edge_ratio: f32,
    /// Noise of a coordinate of the smallest keypoints, standard deviation; it grows with the size of a keypoint.
    pub sigma_px: f64,
}

/// `[association]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AssociationSection {
    /// Ratio of Eq. 21.
    pub ratio: f32,
    /// Gate on the squared normalised innovation.
    pub gate: f64,
    /// Descriptor distance a predicted landmark accepts.
    pub guided_distance: f32,
    /// Ratio of the guided search.
    pub guided_ratio: f32,
    /// Share of wrong matches the likelihood allows for.
    pub outlier_share: f64,
    /// Matches that score, at most.
    pub max_scored: u32,
}

/// `[mapping]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MappingSection {
    /// Nearest depth of a new landmark, metres.
    pub min_depth_m: f64,
    /// Depth is open while sigma_rho / rho exceeds this.
    pub open_depth: f64,
    /// Parallax of a two-view start, radians (delayed methods).
    pub min_parallax: f64,
    /// Keyframes a tentative feature waits for its second sighting.
    pub tentative_keyframes: u32,
    /// Tentative features started per keyframe.
    pub max_new: u32,
    /// Landmarks of the map beyond which the least used ones leave.
    pub max_landmarks: u32,
    /// Keyframes whose joint covariance is kept.
    pub max_keyframes: u32,
    /// Memory of the map beyond which the least used landmarks leave, megabytes; 0 bounds nothing.
    pub max_megabytes: f64,
}

/// `[keyframes]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct KeyframesSection {
    /// Median parallax that makes a filter step, pixels.
    pub min_parallax_px: f64,
    /// Share of the last keyframe's matches below which a step is made.
    pub min_overlap: f64,
    /// Seconds between filter steps, at most.
    pub max_gap_s: f64,
}

/// The kind of robot that carries the camera.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Robot {
    /// A decimetre or two, such as a model car.
    TableTop,
    /// Some decimetres, driven indoors on two wheels whose axle is the body origin: the default.
    #[default]
    Room,
    /// Metres, steered, with the body origin somewhere between the axles.
    Car,
}

impl Robot {
    /// Name as written in the configuration.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::TableTop => "table-top",
            Self::Room => "room",
            Self::Car => "car",
        }
    }
}

/// `[robot]`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RobotSection {
    /// Kind of robot; it sets the defaults of the other sections.
    pub preset: Robot,
}

/// Everything a run can be told.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The particle filter.
    pub filter: FilterSection,
    /// The robot.
    pub robot: RobotSection,
    /// Noise of the odometry.
    pub odometry: OdometrySection,
    /// The carrier beyond its odometry.
    pub carrier: CarrierSection,
    /// Keypoints.
    pub features: FeaturesSection,
    /// Matching.
    pub association: AssociationSection,
    /// Landmarks.
    pub mapping: MappingSection,
    /// Filter steps.
    pub keyframes: KeyframesSection,
}

impl Default for FilterSection {
    fn default() -> Self {
        Self {
            method: Method::Exact,
            particles: 10,
            seed: 1,
            threads: 0,
            resampling_threshold: 0.6,
            evolution_steps: 8,
            iterations: 2,
            lag: 3,
            window: 30,
        }
    }
}

impl Default for OdometrySection {
    fn default() -> Self {
        Self {
            forward_per_sqrt_m: 0.01,
            forward_per_sqrt_s: 0.0016,
            sideways_per_sqrt_m: 0.006,
            turn_per_sqrt_rad: 0.01,
            turn_per_sqrt_m: 0.0,
            turn_per_sqrt_s: 0.02,
            scale_bias: 0.01,
        }
    }
}

impl Default for CarrierSection {
    fn default() -> Self {
        Self {
            tilt_sigma: 0.006,
            tilt_time_s: 1.0,
            slope_sigma: 0.01,
            scale_drift: 0.01,
            scale_sigma: 0.05,
            first_heading_sigma: 0.005,
            mount_yaw_sigma: 0.005,
            focal_sigma: 0.003,
            turn_bias_sigma: 0.002,
            turning_centre_sigma_m: 0.0,
        }
    }
}

impl Default for FeaturesSection {
    fn default() -> Self {
        Self {
            max_keypoints: 1000,
            contrast_threshold: 0.04,
            edge_ratio: 10.0,
            sigma_px: 0.3,
        }
    }
}

impl Default for AssociationSection {
    fn default() -> Self {
        Self {
            ratio: 0.7,
            gate: 13.8,
            guided_distance: 160.0,
            guided_ratio: 0.8,
            outlier_share: 0.05,
            max_scored: 150,
        }
    }
}

impl Default for MappingSection {
    fn default() -> Self {
        Self {
            min_depth_m: 0.4,
            open_depth: 0.15,
            min_parallax: 0.02,
            tentative_keyframes: 3,
            max_new: 300,
            max_landmarks: 100_000,
            max_keyframes: 256,
            max_megabytes: 0.0,
        }
    }
}

impl Default for KeyframesSection {
    fn default() -> Self {
        Self {
            min_parallax_px: 8.0,
            min_overlap: 0.5,
            max_gap_s: 10.0,
        }
    }
}
